"""The Robotics Toolbox for Python: Levenberg-Marquardt in C, one call per pose."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.contest import Contestant, Contestants, Result
from benchmarks.workloads import Reach
from screwkin.algebra.se3 import as_array
from screwkin.model.robot import Robot

Array = Any
TOLERANCE = 1e-12
"""Of its error, half the square of what is missing."""


def reach(robot: Robot, given: Reach) -> Contestants:
    """W2."""
    import roboticstoolbox as rtb

    chain, place, axes = given.chain, np.zeros(3), []
    for screw in chain.screws:
        s, s0 = (as_array(v).astype(float) for v in (screw.s, screw.s0))
        if sorted(np.abs(s)) != [0, 0, 1]:
            return {}  # its joints turn about coordinate axes
        axes.append(rtb.ET.SE3(_shift(s0 - place)))
        turn = getattr(rtb.ET, "R" + "xyz"[int(np.abs(s).argmax())])
        axes.append(turn(flip=bool(s.sum() < 0)))
        place = s0
    home = as_array(chain.tip).astype(float)
    home[:3, 3] -= place
    solver = rtb.ETS([*axes, rtb.ET.SE3(home)])

    def run() -> list[Any]:
        found, q = [], given.guess
        for T in given.target:
            one = solver.ik_LM(T, q0=q, tol=TOLERANCE, joint_limits=False, method="chan", k=1e-4)
            found.append(one)
            q = _joints(one) if given.follows else given.guess
        return found

    def result(found: list[Any]) -> Result:
        return {"q": np.array([_joints(x) for x in found]), "solved": np.array([_good(x) for x in found])}

    told = f"ik_LM, method chan, k = 1e-4, tolerance {TOLERANCE:g}, restarts at random when it fails"
    return {"Robotics Toolbox, ik_LM": Contestant(run, result, told)}


def _joints(solution: Any) -> Array:
    return solution.q if hasattr(solution, "q") else solution[0]


def _good(solution: Any) -> bool:
    return bool(solution.success if hasattr(solution, "success") else solution[1])


def _shift(offset: Array) -> Array:
    T = np.eye(4)
    T[:3, 3] = offset
    return T
