"""Pinocchio as a loop in C++, compiled from the headers that its wheel installs.

Everything is instantiated in our own unit with the flags of this processor: the wheel's libraries are built
for any processor. Inputs are laid out beforehand as Pinocchio wants them (samples in rows, quaternions).
"""

from __future__ import annotations

import ctypes
import hashlib
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.compiler import FAST, compiled, compiler
from benchmarks.environments import folder, installed_apart
from benchmarks.workloads import Motion
from screwkin.algebra.se3 import as_array
from screwkin.model.robot import Limb, Robot

Array = Any
SOURCE = Path(__file__).with_name("pinocchio_loop.cpp")
DEFINED = (  # what Pinocchio's own build files define for whoever uses its headers
    "-DBOOST_MPL_LIMIT_LIST_SIZE=30",
    "-DBOOST_MPL_LIMIT_VECTOR_SIZE=30",
    "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS",
    "-DBOOST_FUSION_INVOKE_MAX_ARITY=12",
)
FLAGS = ("-std=c++17", *FAST, "-DNDEBUG", *DEFINED)


def library(progress: Any = print) -> Path | None:
    """The compiled loop, kept between runs; None where compiler or headers are missing."""
    places = (Path(entry, "cmeel.prefix", "include") for entry in sys.path)
    headers = next((place for place in places if (place / "pinocchio").is_dir()), None)
    if headers is None or compiler(plus_plus=True) is None:
        return None
    eigen = installed_apart("eigen", ["cmeel-eigen"])
    if eigen is None:
        return None
    told = [SOURCE.read_text(), *FLAGS, metadata.version("pin"), _processor()]
    key = hashlib.sha256("\n".join(told).encode()).hexdigest()[:12]
    source = folder("compiled") / f"pinocchio-{key}.cpp"
    if (made := source.with_suffix(".so")).exists():
        return made
    progress("compiling Pinocchio's loop from its headers: a few minutes, once")
    shutil.copy(SOURCE, source)
    includes = [f"-I{headers}", f"-I{eigen / 'cmeel.prefix/include/eigen3'}"]
    return compiled(source, [*FLAGS, *includes])[0]


def _processor() -> str:
    lines = Path("/proc/cpuinfo")
    text = lines.read_text() if lines.exists() else ""
    return next((line for line in text.splitlines() if line.startswith("flags")), "")


@dataclass(frozen=True, eq=False)
class Description:
    """A robot of revolute joints as flat arrays, joints in Pinocchio's order."""

    joints: tuple[int, ...]
    arguments: tuple[Any, ...]
    limbs: tuple[Limb, ...]


def describe(robot: Robot, floating: bool, limbs: tuple[Limb, ...], turns: tuple[bool, ...]) -> Description:
    """What the loop is told: every joint's parent, axis, place; every body's mass, centre, inertia; tips."""
    kept = [i for limb in limbs for i in robot.path_to(limb.link)]
    place = {robot.joints[i].child: k for k, i in enumerate(kept)}
    origins = {robot.joints[i].child: _numbers(robot.joints[i].screw.s0) for i in kept}
    origins[robot.base_link] = np.zeros(3)
    bodies = [robot.base_link, *(robot.joints[i].child for i in kept)]
    links = [robot.link(name) for name in bodies]
    parents = [place.get(robot.joints[i].parent, -1) for i in kept]
    steps = [origins[robot.joints[i].child] - origins[robot.joints[i].parent] for i in kept]
    tips = []
    for limb in limbs:
        pose = as_array(limb.frame).astype(float)
        pose[:3, 3] -= origins[limb.link]
        tips.append(np.concatenate([pose[:3, :3].T.ravel(), pose[:3, 3]]))
    first = [place[robot.joints[robot.path_to(limb.link)[0]].child] for limb in limbs]
    inertias = [[link.inertia.xx, link.inertia.yy, link.inertia.zz] for link in links]
    products = [[link.inertia.xy, link.inertia.xz, link.inertia.yz] for link in links]
    arguments = (
        floating,
        len(kept),
        _integers(parents),
        _doubles([_numbers(robot.joints[i].screw.s) for i in kept]),
        _doubles(steps),
        _doubles([link.mass for link in links]),
        _doubles([_numbers(link.com) - origins[link.name] for link in links]),
        _doubles(np.concatenate([inertias, products], axis=1)),
        len(limbs),
        _integers([place[limb.link] for limb in limbs]),
        _integers(first),
        _integers([len(robot.path_to(limb.link)) for limb in limbs]),
        _integers(list(turns)),
        _doubles(tips),
    )
    return Description(tuple(kept), arguments, limbs)


def _numbers(v: Any) -> Array:
    return np.array(list(v), dtype=float)


def _doubles(values: Any) -> Array:
    return np.ascontiguousarray(values, dtype=float)


def _integers(values: Any) -> Array:
    return np.ascontiguousarray(values, dtype=np.int32)


class Loop:
    """The compiled loop for one robot, or for some of its limbs alone on a fixed base."""

    def __init__(self, library: Path, robot: Robot, limbs: tuple[Limb, ...] | None = None) -> None:
        self.whole = limbs is None
        chosen = robot.limbs if limbs is None else limbs
        turns = tuple(limb.kind == "leg" or limbs is not None for limb in chosen)
        self.description = describe(robot, self.whole, chosen, turns)
        self.joints = list(self.description.joints)
        self._c = ctypes.CDLL(str(library))
        self._c.make.restype = ctypes.c_void_p
        given = [address(a) if isinstance(a, np.ndarray) else int(a) for a in self.description.arguments]
        self._robot = ctypes.c_void_p(self._c.make(*given))

    def __del__(self) -> None:
        self._c.unmake(self._robot)

    def configuration(self, T: Array, q: Array) -> Array:
        """Rows [p, quaternion, joints] of states; the base is left out where it is fixed."""
        chosen = q[:, self.joints]
        if not self.whole:
            return np.ascontiguousarray(chosen)
        return np.concatenate([T[:, :3, 3], Rotation.from_matrix(T[:, :3, :3]).as_quat(), chosen], axis=1)

    def velocity(self, T: Array, twist: Array, qd: Array) -> Array:
        """Rows [v, omega in base axes, joint rates] from [omega; v] in world axes."""
        back = T[:, :3, :3].swapaxes(1, 2)
        parts = [(back @ twist[:, 3:, None])[..., 0], (back @ twist[:, :3, None])[..., 0]]
        return np.concatenate([*parts, qd[:, self.joints]], axis=1)

    def acceleration(self, T: Array, twist: Array, change: Array, qdd: Array) -> Array:
        """The same of accelerations: Pinocchio's are derivatives of components in turning axes."""
        seen = np.concatenate([change[:, :3], change[:, 3:] - np.cross(twist[:, :3], twist[:, 3:])], axis=1)
        return self.velocity(T, seen, qdd)

    def bound(self, name: str, *arguments: Any) -> Callable[[], None]:
        """A call of one of the C++ functions on this robot, with its arguments ready."""
        function = getattr(self._c, name)
        given = [address(a) if isinstance(a, np.ndarray) else a for a in arguments]
        return lambda: function(self._robot, *given)


def address(array: Array) -> Any:
    return array.ctypes.data_as(ctypes.c_void_p)


def rates(loop: Loop, given: Motion) -> Callable[[], Array]:
    """W1: a function that gives rows of 12 per tip (columns of R, p), then rates in the loop's order."""
    q = loop.configuration(given.T_world_base, given.q)
    motions = np.ascontiguousarray(np.concatenate([given.waist, *given.tips.values()], axis=1))
    out = np.zeros((len(q), 12 * len(loop.description.limbs) + len(loop.joints)))

    call = loop.bound("rates", q, motions, out, ctypes.c_long(len(q)), motions.shape[1])

    def run() -> Array:
        call()
        return out

    return run


def in_table_order(loop: Loop, out: Array) -> Array:
    """Rows of ``rates`` with the joints where the table has them."""
    poses = 12 * len(loop.description.limbs)
    return out[:, [*range(poses), *(poses + np.argsort(loop.joints))]]
