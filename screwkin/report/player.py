"""The part of a page that plays a motion: the robot, its plots and numbers, all inside and without network.

Poses are not stored: the page carries the joints' screws and q, and multiplies displacements as
``kinematics.positions`` does. Arrays are whole numbers of a small unit, differences along time, their bytes
apart, deflated: a walk of nine seconds takes some 40 kB.
"""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Mapping, Sequence
from functools import cache
from html import escape
from importlib.resources import files
from string import Template
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array
from screwkin.analysis.account import Account
from screwkin.analysis.placed_soles import support_polygons
from screwkin.analysis.validate import Validation
from screwkin.gait.ground import ground_of
from screwkin.model.robot import Robot
from screwkin.report.style import GCOM, PLAIN, ZMP
from screwkin.sim.solids import robot_size
from screwkin.viewer.scene import COARSE, STANDING, Piece, displacements, pieces_of

UNIT = 1e-6
"""Of stored lengths and angles [m, rad]."""
ABSENT = -(2**31)
"""What stands for a number that is none."""
RATE = 50.0
"""Samples per second of a motion in a page, at most."""
_SEEN = 25  # samples in which the camera's ball holds the robot


class Packed:
    """Arrays in one row of bytes; every array is described by where it begins, its shape and its unit."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._length = 0

    def add(self, values: Array, unit: float = UNIT) -> dict[str, Any]:
        """Store an array, of at least one axis, rounded to a unit; returns its description."""
        scaled = np.asarray(values, dtype=float) / unit
        whole = np.where(np.isfinite(scaled), np.rint(scaled), ABSENT).astype("<i4")
        steps = np.diff(whole, axis=0, prepend=np.zeros_like(whole[:1])).astype("<i4")
        data = steps.reshape(-1).view(np.uint8).reshape(-1, 4).T.tobytes()
        described = {"offset": self._length, "shape": list(whole.shape), "scale": unit}
        self._parts.append(data)
        self._length += len(data)
        return described

    @property
    def data(self) -> str:
        """All of it, deflated, in base64."""
        return deflated(b"".join(self._parts))


def deflated(data: bytes) -> str:
    """Bytes for a page: deflated, in base64."""
    return base64.b64encode(zlib.compress(data, 9)).decode("ascii")


def player_html(account: Account, check: Validation | None = None) -> str:
    """The player of a trajectory, and of its simulation if there was one."""
    packed = Packed()
    header = {
        "robot": _robot(account, check, packed),
        "motions": [_plan(account, packed), *([_simulated(check, packed)] if check else [])],
        "phases": _phases(account),
        "plots": _plots(account, packed),
    }
    resources = files("screwkin.report")
    template = Template(resources.joinpath("player.html").read_text(encoding="utf-8"))
    name = escape(account.robot.name)
    return template.substitute(
        view=f"{name} in motion, seen in three dimensions; drag to look from elsewhere",
        margin="Margin of the ZMP over time, with the present time",
        side="ZMP and centre of mass to the side over time, with the present time",
        header=json.dumps(header, allow_nan=False, separators=(",", ":")).replace("</", "<\\/"),
        data=packed.data,
        three=_library(),
        script=resources.joinpath("player.js").read_text(encoding="utf-8"),
    )


@cache
def _library() -> str:
    return deflated(files("screwkin.report").joinpath("three.min.js").read_bytes())


def _robot(account: Account, check: Validation | None, packed: Packed) -> dict[str, Any]:
    """Joints in the order in which links are carried, and the triangles of every link."""
    robot, names = account.robot, account.robot.link_names
    joints = []
    for i in robot.traversal:
        joint, (coordinate, ratio) = robot.tree[i], robot.gears[i]
        joints.append(
            {
                "parent": names.index(joint.parent),
                "child": names.index(joint.child),
                "slides": joint.type == "prismatic",
                "s": _numbers(joint.screw.s),
                "s0": _numbers(joint.screw.s0),
                "pitch": 0.0 if joint.type == "prismatic" else float(joint.screw.pitch),
                "coordinate": coordinate,
                "ratio": float(ratio),
                "offset": float(getattr(joint, "offset", 0.0)),
            }
        )
    pieces = pieces_of(robot, COARSE, ground_of(account.trajectory))
    plan = account.trajectory
    motions = [(plan.T_world_base, account.motion.q)]
    if check is not None:
        motions.append((check.run.T_world_base, check.run.q))
    middle, radius = _around(robot, pieces, motions)
    return {
        "size": _shown_size(robot, account),
        "middle": middle,
        "radius": radius,
        "tile": 0.1,
        "links": list(names),
        "roots": [names.index(robot.base_link)],
        "coordinates": len(robot.joints),
        "joints": joints,
        "pieces": [
            {
                "link": piece.link,
                "colour": piece.colour,
                "vertices": packed.add(piece.vertices, 1e-5),
                "faces": packed.add(piece.faces, 1.0),
            }
            for piece in pieces
        ],
    }


def _around(
    robot: Robot, pieces: Sequence[Piece], motions: Sequence[tuple[Array, Array]]
) -> tuple[float, float]:
    """Height of the middle and radius [m] of a ball that goes with the base and holds all of the robot.

    Args:
        robot: whose joints they are.
        pieces: of its links.
        motions: T_world_base (T, 4, 4) and q (T, n) of all that the page plays.
    """
    rows = [np.linspace(0, len(T) - 1, _SEEN).round().astype(int) for T, _ in motions]
    T_world_base, q = (
        np.concatenate([motion[k][own] for motion, own in zip(motions, rows, strict=True)]) for k in (0, 1)
    )
    Ts = displacements(robot, T_world_base, q)
    over = T_world_base[:, None, :3, 3] * [1.0, 1.0, 0.0]
    own = [
        piece.vertices @ Ts[:, piece.link, :3, :3].swapaxes(-1, -2) + Ts[:, piece.link, None, :3, 3] - over
        for piece in pieces
        if piece.link != STANDING
    ]
    points = np.concatenate([np.zeros((1, 3)), *(part.reshape(-1, 3) for part in own)])
    middle = 0.5 * float(points[:, 2].min() + points[:, 2].max())
    return middle, float(np.linalg.norm(points - [0.0, 0.0, middle], axis=1).max())


def _shown_size(robot: Robot, account: Account) -> float:
    """What marks are measured in [m]: the robot's size or the height of its waist."""
    return max(robot_size(robot), float(account.trajectory.T_world_base[0, 2, 3]))


def _numbers(vector: Any) -> list[float]:
    return [float(x) for x in as_array(vector)]


def _rows(time: Array) -> Array:
    """Samples of a motion that a page shows: all, or so many that ``RATE`` is not exceeded."""
    span = float(time[-1] - time[0])
    every = max(1, int(len(time) / max(RATE * span, 1.0)))
    rows = np.arange(0, len(time), every)
    return rows if rows[-1] == len(time) - 1 else np.append(rows, len(time) - 1)


def _poses(packed: Packed, time: Array, T_world_base: Array, q: Array) -> dict[str, Any]:
    from scipy.spatial.transform import Rotation

    return {
        "time": packed.add(time),
        "q": packed.add(q),
        "base": packed.add(T_world_base[:, :3, 3]),
        "turn": packed.add(Rotation.from_matrix(T_world_base[:, :3, :3]).as_quat()),
    }


def _plan(account: Account, packed: Packed) -> dict[str, Any]:
    trajectory, rows = account.trajectory, _rows(account.trajectory.time)
    time = trajectory.time - trajectory.time[0]
    arrays = _poses(packed, time[rows], trajectory.T_world_base[rows], account.motion.q[rows])
    arrays["zmp"] = packed.add(account.balance.zmp[rows])
    arrays["com"] = packed.add(account.balance.com[rows])
    arrays["margin"] = packed.add(account.balance.margin[rows])
    return {"name": "the plan", "arrays": arrays}


def _simulated(check: Validation, packed: Packed) -> dict[str, Any]:
    """What the simulation saw from the beginning of the trajectory on; its ZMP is that of contact forces."""
    run = check.run
    first = min(int(np.searchsorted(run.time, 0.0)), len(run.time) - 1)
    rows = first + _rows(run.time[first:])
    time = run.time[rows]
    arrays = _poses(packed, time - time[0], run.T_world_base[rows], run.q[rows])
    zmp = np.full((len(rows), 2), np.nan)
    if len(check.zmp.time):
        at = np.clip(np.searchsorted(check.zmp.time, time), 0, len(check.zmp.time) - 1)
        zmp = check.zmp.contact[at]
    arrays["zmp"] = packed.add(zmp)
    return {"name": f"the simulation ({check.engine})", "arrays": arrays}


def _phases(account: Account) -> list[dict[str, Any]]:
    """The support polygons with the times between which each holds [s]."""
    time = account.trajectory.time - account.trajectory.time[0]
    after = np.append(time[1:], np.inf)
    return [
        {
            "begin": float(time[begin]),
            "end": min(float(after[end]), 1e9),
            "corners": np.round(polygon, 5).tolist(),
        }
        for begin, end, polygon in support_polygons(account)
    ]


def _plots(account: Account, packed: Packed) -> Mapping[str, Any]:
    """Rows of the two plots [mm], over the samples of the plan."""
    rows, balance = _rows(account.trajectory.time), account.balance
    time = account.trajectory.time - account.trajectory.time[0]

    def row(name: str, colour: str, values: Array) -> dict[str, Any]:
        return {"name": name, "colour": colour, "values": packed.add(1e3 * values[rows], 1e-3)}

    return {
        "time": packed.add(time[rows]),
        "margin": [row("margin of the ZMP [mm]", ZMP, balance.margin)],
        "side": [
            row("y of the ZMP [mm]", ZMP, balance.zmp[:, 1]),
            row("y of the GCoM [mm]", GCOM, balance.com[:, 1]),
            row("y of the waist [mm]", PLAIN, account.trajectory.T_world_base[:, 1, 3]),
        ],
    }
