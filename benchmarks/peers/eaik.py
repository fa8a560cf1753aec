"""EAIK: all solutions of a limb by subproblem decomposition, one call per pose or one for all."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.contest import Contestant, Contestants, Result
from benchmarks.workloads import Reach
from screwkin.algebra.se3 import as_array
from screwkin.analysis.ik_others import offset_parameters
from screwkin.model.robot import Robot

THREADS = (1, 2)


def reach(robot: Robot, given: Reach) -> Contestants:
    """W2."""
    from eaik.IK_HP import HPRobot

    solver = HPRobot(*offset_parameters(given.chain))
    if not solver.hasKnownDecomposition():
        return {}
    target = given.target.copy()
    # Its tip is parallel to the base in the zero pose.
    target[:, :3, :3] = target[:, :3, :3] @ as_array(given.chain.tip).astype(float)[:3, :3].T

    def result(found: Any) -> Result:
        q, solved = np.zeros((len(found), 6)), np.zeros(len(found), dtype=bool)
        for k, one in enumerate(found):
            exact = [np.asarray(x) for x, least in zip(one.Q, one.is_LS, strict=True) if not least]
            if exact:
                q[k], solved[k] = min(exact, key=lambda x: float(np.abs(np.sin(x / 2)).max())), True
        return {"q": q, "solved": solved}

    told = "all branches"
    each = {"EAIK, call by call": Contestant(lambda: [solver.IK(T) for T in target], result, told)}
    for threads in THREADS:
        run = lambda threads=threads: solver.IK_batched(target, threads)  # noqa: E731
        each[f"EAIK, batched, threads: {threads}"] = Contestant(run, result, told)
    return each
