"""placo: tasks for the tips, solved as quadratic programs, iterated until the joints rest."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks.contest import Contestant, Contestants, Result
from benchmarks.workloads import Reach, Stance
from screwkin.algebra.se3 import as_array
from screwkin.model.robot import Limb, Robot
from screwkin.model.urdf import urdf_frames, urdf_of_bodies

Array = Any
TOLERANCE, MOST = 1e-7, 50
"""Largest change of a joint [rad] in the last iteration; iterations."""
NOTE = f"frame and position tasks, iterated until joints change by less than {TOLERANCE:g}, at most {MOST}"


def urdf_with_tips(robot: Robot) -> str:
    """The robot with a link of its own at every tip."""
    frames, tips = urdf_frames(robot), []
    for limb in robot.limbs:
        p = " ".join(repr(float(c)) for c in as_array((frames[limb.link].inverse @ limb.frame).p))
        ends = f'<parent link="{limb.link}"/><child link="{limb.tip}"/><origin xyz="{p}"/>'
        tips.append(f'<link name="{limb.tip}"/><joint name="to_{limb.tip}" type="fixed">{ends}</joint>')
    text: str = urdf_of_bodies(robot.with_inertia_floor())
    return text.replace("</robot>", "".join(tips) + "</robot>")


class Body:
    """A robot as placo reads it, and a solver that moves its joints alone."""

    def __init__(self, robot: Robot, limbs: tuple[Limb, ...]) -> None:
        import placo

        with TemporaryDirectory() as directory:
            Path(directory, "robot.urdf").write_text(urdf_with_tips(robot))
            self.robot = placo.RobotWrapper(directory, placo.Flags.ignore_collisions)
        self.solver = placo.KinematicsSolver(self.robot)
        self.solver.mask_fbase(True)
        self.solver.enable_joint_limits(False)
        self.names = robot.joint_names
        self.poses, self.points = {}, {}
        for limb in limbs:
            if limb.kind == "leg":
                self.poses[limb.tip] = self.solver.add_frame_task(limb.tip, np.eye(4))
                self.poses[limb.tip].configure(limb.tip, "soft", 1.0, 1.0)
            else:
                self.points[limb.tip] = self.solver.add_position_task(limb.tip, np.zeros(3))

    def start(self, q: Array) -> None:
        """Joint positions in table order."""
        for name, value in zip(self.names, q, strict=True):
            self.robot.set_joint(name, float(value))

    def solve(self, T: Array, tips: dict[str, Array]) -> tuple[Array, bool]:
        """Joint positions for a base pose and tip targets, from where the robot is; whether they rest."""
        self.robot.set_T_world_fbase(T)
        self.robot.update_kinematics()
        for name, wanted in tips.items():
            if name in self.poses:
                self.poses[name].T_world_frame = wanted
            else:
                self.points[name].target_world = wanted
        rests = False
        for _ in range(MOST):
            change = self.solver.solve(True)
            self.robot.update_kinematics()
            rests = bool(np.abs(change).max() < TOLERANCE)
            if rests:
                break
        return np.array([self.robot.get_joint(name) for name in self.names]), rests


def reach(robot: Robot, given: Reach) -> Contestants:
    """W2."""
    body, home = Body(robot, (given.limb,)), np.zeros(len(robot.joints))
    home[list(given.chain.joints)] = given.guess

    def run() -> list[tuple[Array, bool]]:
        found = []
        body.start(home)
        for T in given.target:
            if not given.follows:
                body.start(home)
            found.append(body.solve(np.eye(4), {given.limb.tip: T}))
        return found

    def result(found: list[tuple[Array, bool]]) -> Result:
        q = np.array([x for x, _ in found])[:, list(given.chain.joints)]
        return _judged(q, np.array([rests for _, rests in found]), given)

    return {"placo": Contestant(run, result, NOTE)}


def _judged(q: Array, rests: Array, given: Reach) -> Result:
    """At rest means solved only where the tip has arrived too: it also rests at the nearest pose."""
    from screwkin.kinematics.serial_chain import distance

    return {"q": q, "solved": rests & (distance(given.chain, q, given.target) < 1e-6)}


def positions(robot: Robot, given: Stance) -> Contestants:
    """W3."""
    body = Body(robot, robot.limbs)

    def run() -> list[tuple[Array, bool]]:
        body.start(given.guess)
        return [
            body.solve(T, {name: wanted[k] for name, wanted in given.tips.items()})
            for k, T in enumerate(given.T_world_base)
        ]

    def result(found: list[tuple[Array, bool]]) -> Result:
        return {"q": np.array([x for x, _ in found]), "solved": np.array([rests for _, rests in found])}

    return {"placo": Contestant(run, result, NOTE)}
