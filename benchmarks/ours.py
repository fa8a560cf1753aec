"""This library's contestants: for every workload a function from its inputs to named ways to compute it."""

from __future__ import annotations

from typing import Any

import numpy as np

import screwkin as sk
from benchmarks.contest import Contestant, Contestants, Result
from benchmarks.workloads import Dynamic, Motion, Reach, Stance
from screwkin.analysis.workspace import workspace
from screwkin.gait.balance import ground_reaction
from screwkin.model.robot import Robot

NAME = "screwkin"


def rates(robot: Robot, given: Motion) -> Contestants:
    """W1."""
    mechanism = sk.closed_mechanism(robot)
    state = sk.State(given.T_world_base, given.q)
    joints = [mechanism.secondary.index(name) for name in robot.joint_names]

    def run() -> Result:
        poses = [sk.frame_pose(robot, state, limb.tip) for limb in robot.limbs]
        primary = sk.virtual_motion(mechanism, state, given.waist, given.tips)
        followed = sk.secondary_rates(mechanism, state, primary)
        return {"poses": np.stack(poses, axis=1), "rates": followed[:, joints]}

    return {f"{NAME}, public functions": Contestant(run)}


def reach(robot: Robot, given: Reach) -> Contestants:
    """W2."""

    def run() -> sk.ScrewkinError | Any:
        return sk.limb_ik(robot, given.limb.name, given.target, guess=given.guess, least_squares=False)

    def result(found: Any) -> Result:
        return {"q": found.best, "solved": found.valid.any(axis=-1)}

    return {f"{NAME}, public functions": Contestant(run, result, "all branches in closed form")}


def positions(robot: Robot, given: Stance) -> Contestants:
    """W3."""
    targets = {"base": given.T_world_base, **given.tips}
    guess = sk.State(given.T_world_base, given.guess)

    def result(found: Any) -> Result:
        return {"q": found.state.q, "solved": found.status == 0}

    return {f"{NAME}, public functions": Contestant(lambda: sk.solve_pose(robot, targets, guess), result)}


def balance(robot: Robot, given: Dynamic) -> Contestants:
    """W4."""
    state = sk.State(given.T_world_base, given.q)

    def run() -> Result:
        zmp, com, _, _ = ground_reaction(
            robot, given.T_world_base, given.q, given.qd, given.qdd, given.twist, given.acceleration
        )
        return {"com": com, "momentum": sk.momentum(robot, state, given.qd, given.twist), "zmp": zmp}

    return {f"{NAME}, public functions": Contestant(run)}


def gait(robot: Robot, seconds: float, rate: float) -> Contestants:
    """W5: positions, rates, accelerations and ZMP of a walk of about so many seconds."""
    chosen = sk.load_gait("walk").replace(rate=rate)
    steps = max(1, round((seconds - 2 * chosen.ramp * chosen.Tc) / chosen.Tc))

    def result(walked: Any) -> Result:
        return {"time": walked.time, "margin": walked.margin}

    return {f"{NAME}, walk": Contestant(lambda: sk.walk(robot, chosen, steps), result)}


def reachable(robot: Robot, limb: str, heights: tuple[float, ...], resolution: float) -> Contestants:
    """W6."""

    def result(maps: Any) -> Result:
        return {"area": np.array([found.area for found in maps])}

    return {f"{NAME}, workspace": Contestant(lambda: workspace(robot, limb, heights, resolution), result)}
