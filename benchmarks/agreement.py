"""Whether results are right, judged before any time is taken."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

import screwkin as sk
from benchmarks.contest import Result
from benchmarks.workloads import Reach, Stance
from screwkin.kinematics.serial_chain import distance
from screwkin.model.robot import Robot

SAME = 1e-9
"""Largest relative difference of results that are computed directly; the conditions are below 1e4."""
NEAR = 1e-5
"""Largest distance [m and rad] of a pose that counts as reached: iterations stop before rounding does."""

Judge = Callable[[Result], Mapping[str, float]]


def like(reference: Result) -> Judge:
    """Every array that a contestant gives is as in the reference, relative to its largest entry."""

    def judge(result: Result) -> Mapping[str, float]:
        worst = 0.0
        assert result, "no result"
        for name, wanted in ((name, reference[name][: len(result[name])]) for name in result):
            assert result[name].shape == wanted.shape, f"{name} has shape {result[name].shape}"
            scale = max(1.0, float(np.abs(wanted).max()))
            worst = max(worst, float(np.abs(result[name] - wanted).max()) / scale)
        assert worst < SAME, f"differs by {worst:.2g}"
        return {"difference": worst}

    return judge


def reached(given: Reach) -> Judge:
    """The tip is where it is wanted, in every sample that is said to be solved."""

    def judge(result: Result) -> Mapping[str, float]:
        solved = np.asarray(result["solved"], dtype=bool)
        assert solved.any(), "nothing is solved"
        worst = float(distance(given.chain, result["q"][solved], given.target[: len(solved)][solved]).max())
        assert worst < NEAR, f"a tip is off by {worst:.2g}"
        return {"solved": float(solved.mean()), "error": worst}

    return judge


def stood(robot: Robot, given: Stance) -> Judge:
    """All tips are where they are wanted, in every sample whose limbs are all said to be solved."""

    def judge(result: Result) -> Mapping[str, float]:
        solved = np.asarray(result["solved"], dtype=bool).reshape(len(result["q"]), -1).all(axis=1)
        assert solved.any(), "nothing is solved"
        given_base = given.T_world_base[: len(solved)][solved]
        state, worst = sk.State(given_base, result["q"][solved]), 0.0
        for tip, wanted in given.tips.items():
            found = sk.frame_pose(robot, state, tip)
            if wanted.ndim == 2:
                found = found[:, :3, 3]
            worst = max(worst, float(np.abs(found - wanted[: len(solved)][solved]).max()))
        assert worst < NEAR, f"a tip is off by {worst:.2g}"
        return {"solved": float(solved.mean()), "error": worst}

    return judge


def anything(result: Result) -> Mapping[str, float]:
    """Nothing to compare with: numbers at least."""
    for name, values in result.items():
        assert np.isfinite(values).all(), f"{name} is not finite"
    return {}
