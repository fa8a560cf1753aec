"""Inverse kinematics of other libraries on the same limb, where they are installed.

Each function returns None where its library is absent or does not fit the limb.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array
from screwkin.ik.closed import EXACT
from screwkin.ik.numeric import IkSettings
from screwkin.kinematics.serial_chain import SerialChain, distance


@dataclass(frozen=True, eq=False)
class MethodOutcome:
    """What a method did with B samples: q (B, n), solved (B,) bool, iterations (B,), wall time [s]."""

    q: Array
    solved: Array
    iterations: Array
    seconds: float


def _library(name: str) -> Any:
    """A module, None where it is not installed."""
    try:
        return import_module(name)
    except ImportError:
        return None


def pinocchio_model(pin: Any, chain: SerialChain) -> Any:
    """The limb as a Pinocchio model; its joint frames are parallel to the base in the zero pose."""
    model, parent, origin = pin.Model(), 0, np.zeros(3)
    for name, screw in zip(chain.names, chain.screws, strict=True):
        s, s0 = as_array(screw.s).astype(float), as_array(screw.s0).astype(float)
        joint = pin.JointModelRevoluteUnaligned(s)
        parent = model.addJoint(parent, joint, pin.SE3(np.eye(3), s0 - origin), name)
        origin = s0
    return model


def pinocchio_clik(chain: SerialChain, target: Array, settings: IkSettings) -> MethodOutcome | None:
    """Closed-loop inverse kinematics as Pinocchio's documentation shows it: damping 1e-12, step 0.1."""
    pin = _library("pinocchio")
    if pin is None or not chain.turning.all():
        return None
    model = pinocchio_model(pin, chain)
    data, last = model.createData(), model.njoints - 1
    home = as_array(chain.tip).astype(float)
    reach = pin.SE3(home[:3, :3], home[:3, 3] - as_array(chain.screws[-1].s0).astype(float))
    q, iterations = np.zeros((len(target), model.nv)), np.zeros(len(target), dtype=int)
    solved = np.zeros(len(target), dtype=bool)
    begin = time.perf_counter()
    for k, T in enumerate(target):
        wanted = pin.SE3(T[:3, :3], T[:3, 3]) * reach.inverse()
        x = np.zeros(model.nv)
        for step in range(settings.max_iterations + 1):
            pin.forwardKinematics(model, data, x)
            gap = data.oMi[last].actInv(wanted)
            residual = pin.log6(gap).vector
            # The tip's own distance: the same displacement, seen at the tip.
            far = reach.actInv(gap * reach)
            if (
                np.linalg.norm(far.translation) <= settings.position_tolerance
                and np.linalg.norm(residual[3:]) <= settings.rotation_tolerance
            ):
                solved[k] = True
                break
            if step == settings.max_iterations:
                break
            J = -pin.Jlog6(gap.inverse()) @ pin.computeJointJacobian(model, data, x, last)
            x = x - 0.1 * J.T @ np.linalg.solve(J @ J.T + 1e-12 * np.eye(6), residual)
            iterations[k] += 1
        q[k] = x
    return MethodOutcome(q, solved, iterations, time.perf_counter() - begin)


def offset_parameters(chain: SerialChain) -> tuple[Array, Array]:
    """Axes (n, 3); offsets (n + 1, 3) from the base to the first, from axis to axis, and to the tip."""
    axes = np.array([as_array(screw.s) for screw in chain.screws], dtype=float)
    points = [np.zeros(3), *(as_array(screw.s0) for screw in chain.screws), as_array(chain.tip.p)]
    return axes, np.diff(np.array(points, dtype=float), axis=0)


def eaik(chain: SerialChain, target: Array, settings: IkSettings) -> MethodOutcome | None:
    """EAIK: subproblem decomposition chosen by the limb's geometry; its nearest branch to q = 0."""
    library = _library("eaik.IK_HP")
    if library is None or not chain.turning.all():
        return None
    robot = library.HPRobot(*offset_parameters(chain))
    if not robot.hasKnownDecomposition():
        return None
    home = as_array(chain.tip).astype(float)[:3, :3]
    q, solved = np.zeros((len(target), len(chain.names))), np.zeros(len(target), dtype=bool)
    begin = time.perf_counter()
    for k, T in enumerate(target):
        # Its tip is parallel to the base in the zero pose.
        wanted = T.copy()
        wanted[:3, :3] = T[:3, :3] @ home.T
        answer = robot.IK(wanted)
        branches = [np.asarray(x) for x, least in zip(answer.Q, answer.is_LS, strict=True) if not least]
        if branches:
            q[k], solved[k] = min(branches, key=lambda x: float(np.abs(np.sin(x / 2)).max())), True
    seconds = time.perf_counter() - begin
    solved &= distance(chain, q, target) <= np.sqrt(EXACT)
    return MethodOutcome(q, solved, np.ones(len(target), dtype=int), seconds)


OTHERS: tuple[tuple[str, str, Callable[[SerialChain, Array, IkSettings], MethodOutcome | None]], ...] = (
    ("pinocchio-clik", "from q = 0; damping 1e-12, step 0.1", pinocchio_clik),
    ("eaik", "all branches; solved to 1e-6", eaik),
)
"""Name, settings and function of every other library."""
