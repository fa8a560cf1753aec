"""The trajectory: everything a walk prescribes and predicts, sample by sample, and its files.

``.npz`` holds all of it and is what the other commands read; ``.csv`` (time, then joint columns in rad) and
``.json`` (the shape of ROS trajectory_msgs/JointTrajectory) are for other programs. Pickles are never read or
written. The bytes of an ``.npz`` depend on the content alone, so its SHA-256 identifies the trajectory.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwkin.algebra.arrays import Array
from screwkin.algebra.fields import flags_field, json_field, names_field, numbers_field
from screwkin.algebra.hermite import hermite, places
from screwkin.algebra.se3 import as_array, rotation_exp, rotation_from_array, rotation_log
from screwkin.dynamics.standing import stood
from screwkin.errors import InputError, TrajectoryError, expect
from screwkin.files import (
    atomic_write,
    atomic_write_bytes,
    csv_text,
    npz_bytes,
    read_file,
    read_json,
    read_npz,
    ros_text,
    versions,
)
from screwkin.kinematics.rigid import foreign
from screwkin.model.display import html_table, listing
from screwkin.model.recorded import robot_record
from screwkin.model.robot import Robot

TIP_PREFIX = "T_world_"
LONGEST = 3600.0
"""Duration of a trajectory [s]; a simulation holds every step of it in memory."""
LONGEST_GAP = 10.0
"""Time between two samples [s]: so the steps of a simulation are in proportion to the samples, too."""
_SHAPES: Mapping[str, tuple[str, ...]] = {
    "time": ("T",),
    "q": ("T", "n"),
    "qd": ("T", "n"),
    "qdd": ("T", "n"),
    "T_world_base": ("T", "4", "4"),
    "base_twist": ("T", "6"),
    "base_acceleration": ("T", "6"),
    "com": ("T", "3"),
    "zmp": ("T", "2"),
    "margin": ("T",),
}


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A motion of T samples of a robot with n joints; arrays are read-only copies.

    time (T,) [s], increasing; joint_names (n,); q, qd, qdd (T, n) [rad or m, per s, per s^2];
    T_world_base (T, 4, 4); base_twist, base_acceleration (T, 6): [omega; v of the base origin] in world
    axes and its time derivative; T_world_tip: (T, 4, 4) for every limb's tip; contact (T, feet) bool for the
    tips named in feet; com (T, 3) [m]; zmp (T, 2) [m], predicted from the motion of all links; margin (T,)
    [m]: distance of the ZMP inside the support polygon, negative outside; meta: JSON data about its making.

    Raises:
        TrajectoryError: a shape, dtype, name or value is wrong; all faults are named.
    """

    time: Array
    joint_names: tuple[str, ...]
    q: Array
    qd: Array
    qdd: Array
    T_world_base: Array
    base_twist: Array
    base_acceleration: Array
    T_world_tip: Mapping[str, Array]
    contact: NDArray[np.bool_]
    feet: tuple[str, ...]
    com: Array
    zmp: Array
    margin: Array
    meta: Mapping[str, Any] = field(default_factory=dict)
    _file_sha256: str = field(default="", init=False, repr=False)

    def __post_init__(self) -> None:
        faults: list[str] = []
        expect(self.T_world_tip, Mapping, "T_world_tip", "poses (T, 4, 4) by the name of their tip")
        for name in ("joint_names", "feet"):
            object.__setattr__(self, name, names_field(name, getattr(self, name), faults))
        sizes = {
            "T": len(np.atleast_1d(self.time)),
            "n": len(self.joint_names),
            "4": 4,
            "6": 6,
            "3": 3,
            "2": 2,
        }
        for name, axes in _SHAPES.items():
            shape = tuple(sizes[axis] for axis in axes)
            object.__setattr__(self, name, numbers_field(name, getattr(self, name), shape, faults))
        tips = {
            tip: numbers_field(TIP_PREFIX + tip, pose, (sizes["T"], 4, 4), faults)
            for tip, pose in self.T_world_tip.items()
        }
        object.__setattr__(self, "T_world_tip", MappingProxyType(tips))
        shape = (sizes["T"], len(self.feet))
        object.__setattr__(self, "contact", flags_field("contact", self.contact, shape, faults))
        object.__setattr__(self, "meta", json_field(self.meta, faults))
        if not faults:
            faults += _inconsistencies(self)
        if faults:
            raise TrajectoryError("; ".join(faults))

    @classmethod
    def from_joints(cls, robot: Robot, time: Any, q: Any, contact: Any = None) -> Trajectory:
        """A motion of joints from elsewhere on the floor: base, feet and ZMP follow from it.

        Feet in contact are taken to stand flat, as at home, and still on a level floor; rates are those of
        the cubic spline through the positions. The motion begins with the middle of its feet over the origin.

        Args:
            robot: of n joints, with legs, soles and a ``home`` posture; no closures.
            time: (T,) [s], increasing.
            q: (T, n) [rad or m], in the order of ``robot.joint_names``.
            contact: (T, feet) bool, which legs' tips stand, in the order of its limbs; default: those with
                the lowest sole, to 0.1 mm.

        Returns:
            Trajectory; its notes say how far the base jumps where feet that stand contradict each other.

        Raises:
            TrajectoryError: shapes or values of the arrays. InputError: the robot has no legs, soles or home,
                or closures; a sample in which no foot stands.

        Example:
            >>> import screwkin as sk
            >>> robot = sk.load_robot(sk.robot_names()[0])
            >>> walk = sk.walk(robot, sk.load_gait("walk"), steps=1)
            >>> again = sk.Trajectory.from_joints(robot, walk.time, walk.q)
            >>> round(float(again.T_world_base[-1, 0, 3] - again.T_world_base[0, 0, 3]), 3)
            0.1
        """
        expect(robot, Robot, "robot", 'load_robot("NAME")')
        moved = stood(robot, time, q, contact)
        record, made_by = robot_record(robot), versions("numpy", "scipy", "screwkin")
        meta = {"robot": record, "notes": list(moved.notes), "versions": made_by}
        return cls(joint_names=robot.joint_names, meta=meta, **moved.fields)

    def __reduce__(self) -> Any:
        """For pickles and copies: constructed anew, checked, with read-only arrays of its own."""
        values = {f.name: getattr(self, f.name) for f in fields(self) if f.init}
        values |= {name: dict(values[name]) for name in ("T_world_tip", "meta")}
        return _restored, (values, self._file_sha256)

    def __repr__(self) -> str:
        way = ", ".join(f"{x + 0.0:.4g}" for x in self.T_world_base[-1, :3, 3] - self.T_world_base[0, :3, 3])
        return (
            f"Trajectory: {self.samples} samples in {self.duration:g} s, {len(self.joint_names)} joints, "
            f"feet {listing(self.feet)}\n"
            f"  the base moves by ({way}) m; margin at least {1e3 * self.margin.min():.3g} mm"
        )

    def _repr_html_(self) -> str:
        """Shapes and ranges of the arrays, for notebooks."""
        arrays = {name: array for name, array in _arrays(self).items() if array.dtype.kind == "f"}
        rows = [
            [name, str(a.shape), *(f"{x:.4g}" for x in (a.min(initial=np.inf), a.max(initial=-np.inf)))]
            for name, a in arrays.items()
        ]
        return html_table(repr(self).splitlines()[0], ["array", "shape", "least", "largest"], rows)

    @property
    def samples(self) -> int:
        """Number of samples T."""
        return len(self.time)

    @property
    def duration(self) -> float:
        """Time from the first to the last sample [s]."""
        return float(self.time[-1] - self.time[0])

    @property
    def sha256(self) -> str:
        """SHA-256 of the ``.npz`` file it was loaded from, or would be saved as."""
        return self._file_sha256 or hashlib.sha256(npz_bytes(_arrays(self))).hexdigest()

    def sampled(self, times: Array) -> tuple[Array, Array]:
        """Joint positions and rates at other times, by cubic Hermite interpolation of q and qd.

        Args:
            times: (...,) [s]. Before the first and after the last sample the motion rests there.

        Returns:
            q (..., n) [rad or m], and qd (..., n) per second.
        """
        return hermite(self.time, self.q, self.qd, np.asarray(times, dtype=float))

    def base_sampled(self, times: Array) -> Array:
        """Planned base poses (..., 4, 4) at other times (...,) [s].

        The origin moves on the cubic Hermite spline of its positions and velocities, the orientation turns
        evenly from sample to sample.
        """
        times = np.asarray(times, dtype=float)
        T = np.zeros((*times.shape, 4, 4))
        T[..., 3, 3] = 1.0
        T[..., :3, 3] = hermite(self.time, self.T_world_base[:, :3, 3], self.base_twist[:, 3:], times)[0]
        i, u, _ = places(self.time, times)
        before = rotation_from_array(self.T_world_base[i, :3, :3])
        turned = rotation_log(before.T @ rotation_from_array(self.T_world_base[i + 1, :3, :3]))
        T[..., :3, :3] = as_array(before @ rotation_exp(turned * u))
        return T

    def save(self, path: str | Path) -> Path:
        """Write ``.npz``, ``.csv`` or ``.json``, by the suffix of the path.

        Args:
            path: of the new file; one that exists is replaced.

        Returns:
            The path.

        Raises:
            TrajectoryError: another suffix.
            OutputError: the file cannot be written.
        """
        path = Path(path)
        if path.suffix == ".npz":
            with atomic_write_bytes(path) as binary:
                binary.write(npz_bytes(_arrays(self)))
        elif path.suffix in (".csv", ".json"):
            with atomic_write(path) as text:
                joints = self.time, self.joint_names, self.q
                text.write(
                    csv_text(*joints) if path.suffix == ".csv" else ros_text(*joints, self.qd, self.qdd)
                )
        else:
            raise TrajectoryError(f"{path}: unknown suffix {path.suffix!r}; use .npz, .csv or .json")
        return path


def load_trajectory(path: str | Path) -> Trajectory:
    """The trajectory of an ``.npz`` file, checked.

    Args:
        path: of the file.

    Returns:
        The motion with everything that the file holds, arrays read-only.

    Raises:
        InputError: not a path.
        TrajectoryError: not there, truncated, foreign, incomplete, inconsistent, or holding pickles.

    Example:
        >>> import screwkin as sk
        >>> robot = sk.load_robot(sk.robot_names()[0])
        >>> path = sk.walk(robot, sk.load_gait("walk"), steps=1).save("walk.npz")
        >>> sk.load_trajectory(path).joint_names == robot.joint_names
        True
    """
    expect(path, (str, Path), "path", "the path of an .npz file")
    path = Path(path)
    if path.suffix in (".csv", ".json"):
        raise TrajectoryError(
            f"{path}: a {path.suffix} file holds the joints only; give the .npz beside it, or make one:"
            f" screwkin zmp {path} --robot NAME -o DIR"
        )
    try:
        data = read_file(path)
        trajectory = _from_arrays(read_npz(data))
    except OSError as error:
        raise TrajectoryError(f"{path}: cannot be read: {error.strerror}") from None
    except InputError as error:
        raise TrajectoryError(f"{path}: {error}") from None
    object.__setattr__(trajectory, "_file_sha256", hashlib.sha256(data).hexdigest())
    return trajectory


def _restored(values: Mapping[str, Any], file_sha256: str) -> Trajectory:
    trajectory = Trajectory(**values)
    object.__setattr__(trajectory, "_file_sha256", file_sha256)
    return trajectory


def check_joints(robot: Robot, joint_names: Sequence[str], what: str = "the trajectory") -> None:
    """Refuse joints that are not all of a robot's, in the order of its table.

    Args:
        robot: the robot that is to move.
        joint_names: of what moves it.
        what: what that is, for the message.

    Raises:
        InputError: a joint is missing or foreign, or the order is another.
    """
    if tuple(joint_names) == robot.joint_names:
        return
    missing = [name for name in robot.joint_names if name not in joint_names]
    foreign = [name for name in joint_names if name not in robot.joint_names]
    faults = [f"it is without {', '.join(missing)}"] if missing else []
    faults += [f"it has the foreign {', '.join(foreign)}"] if foreign else []
    reason = " and ".join(faults) or "they stand in another order"
    raise InputError(
        f"{what}'s joints are not those of {robot.name}: {reason}; give the robot that it was planned for"
    )


def sha256_of(path: str | Path) -> str:
    """SHA-256 of a file's bytes, in hexadecimal.

    Raises:
        TrajectoryError: it cannot be read.
    """
    try:
        return hashlib.sha256(read_file(path)).hexdigest()
    except OSError as error:
        raise TrajectoryError(f"{path}: cannot be read: {error.strerror}") from None
    except InputError as error:
        raise TrajectoryError(f"{path}: {error}") from None


def _inconsistencies(trajectory: Trajectory) -> list[str]:
    """Faults that show only between well-formed fields."""
    faults = []
    time, steps = trajectory.time, np.diff(trajectory.time)
    if trajectory.samples < 2:
        faults.append(f"time has {trajectory.samples} samples, expected at least 2")
    elif steps.min() <= 0:
        row = int(np.argmax(steps <= 0)) + 1
        faults.append(f"time does not increase at sample {row} ({time[row]:g} s)")
    elif trajectory.duration > LONGEST:
        whole = f"time goes from {time[0]:g} to {time[-1]:g} s"
        faults.append(f"{whole}; at most {LONGEST:g} s are one motion, so play it in parts")
    elif steps.max() > LONGEST_GAP:
        gap = f"{steps.max():g} s lie between samples {steps.argmax()} and {steps.argmax() + 1}"
        faults.append(f"{gap}, at most {LONGEST_GAP:g} s; give samples of a rest, too")
    unknown = [foot for foot in trajectory.feet if foot not in trajectory.T_world_tip]
    if unknown:
        faults.append(f"feet names {', '.join(unknown)}, without {TIP_PREFIX}{unknown[0]}")
    if "base" in trajectory.T_world_tip:
        faults.append("a tip is called base, the name of the waist's pose; rename the tip")
    poses = {"base": trajectory.T_world_base, **trajectory.T_world_tip}
    return faults + [
        f"{TIP_PREFIX}{name} is not a rigid pose in sample {int(np.argmax(bad))}"
        for name, pose in poses.items()
        if (bad := foreign(pose)).any()
    ]


def _arrays(trajectory: Trajectory) -> dict[str, NDArray[Any]]:
    """The fields as they stand in the file."""
    arrays: dict[str, NDArray[Any]] = {}
    for f in fields(trajectory):
        value = getattr(trajectory, f.name)
        if f.name == "T_world_tip":
            arrays |= {TIP_PREFIX + tip: pose for tip, pose in value.items()}
        elif f.name == "meta":
            arrays[f.name] = np.array(json.dumps(dict(value), sort_keys=True))
        elif f.init:
            arrays[f.name] = np.asarray(value)
    return arrays


def _from_arrays(arrays: Mapping[str, NDArray[Any]]) -> Trajectory:
    """The record of a file's fields."""
    names = [f.name for f in fields(Trajectory) if f.init and f.name != "T_world_tip"]
    missing = [name for name in names if name not in arrays]
    tips = {
        key.removeprefix(TIP_PREFIX): pose
        for key, pose in arrays.items()
        if key.startswith(TIP_PREFIX) and key not in names
    }
    foreign = [key for key in arrays if key not in names and not key.startswith(TIP_PREFIX)]
    if missing or foreign:
        found = [f"it is without {', '.join(missing)}"] if missing else []
        found += [f"it holds the unknown {', '.join(foreign)}"] if foreign else []
        raise TrajectoryError(f"not a trajectory of screwkin: {' and '.join(found)}")
    rest: dict[str, Any] = {name: arrays[name] for name in names}
    meta = rest["meta"]
    try:
        rest["meta"] = read_json(str(meta)) if meta.dtype.kind == "U" and meta.ndim == 0 else None
    except InputError as error:
        raise TrajectoryError(f"meta is not the text of a JSON object: {error}") from None
    if not isinstance(rest["meta"], dict):
        raise TrajectoryError("meta is not the text of a JSON object")
    return Trajectory(T_world_tip=tips, **rest)
