"""A walk planned by placo, in placo's own environment: python placo_walk.py ROBOT.urdf GAIT.json WALK.npz.

Nothing of screwkin is imported here: placo pins an older Pinocchio. GAIT.json holds ``Tc stride lift height
spacing sole trunk joints`` (names in the order of the result, and their positions at home by name).
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import placo

DT = 0.005
"""Time between samples, in each of which the solver takes ``REFINE`` steps."""
REFINE = 4
DOUBLE = 0.2
"""Share of a single support that both feet are on the floor in between."""


def parameters(gait: dict) -> placo.HumanoidParameters:
    p = placo.HumanoidParameters()
    p.single_support_duration = gait["Tc"] / (1 + DOUBLE)
    p.single_support_timesteps = 10
    p.double_support_ratio = DOUBLE
    p.startend_double_support_ratio = 1.5
    p.planned_timesteps = 48
    p.walk_com_height = gait["height"]
    p.walk_foot_height = gait["lift"]
    p.walk_trunk_pitch = 0.0
    p.walk_foot_rise_ratio = 0.2
    p.foot_length, p.foot_width = gait["sole"]
    p.feet_spacing = gait["spacing"]
    p.zmp_margin = 0.01
    p.foot_zmp_target_x = p.foot_zmp_target_y = 0.0
    p.walk_max_dx_forward = p.walk_max_dx_backward = p.walk_max_dy = p.walk_max_dtheta = 1.0
    return p


def footsteps(gait: dict, feet: tuple[np.ndarray, np.ndarray]) -> placo.Footsteps:
    """Both feet where they stand, then steps of half a stride each; the last comes beside the other."""
    listed, ahead = placo.Footsteps(), 0.0
    for k in range(gait["steps"] + 2):
        left = k % 2 == 0
        if 1 < k < gait["steps"] + 1:
            ahead += gait["stride"] / 2
        step = placo.Footstep(gait["sole"][1], gait["sole"][0])
        step.side = placo.HumanoidRobot_Side.left if left else placo.HumanoidRobot_Side.right
        frame = placo.flatten_on_floor(feet[0 if left else 1])
        frame[0, 3] += ahead
        step.frame = frame
        listed.append(step)
    return listed


def walk(urdf: str, gait: dict) -> dict[str, np.ndarray]:
    """Samples of a walk: feet side by side, ``steps`` steps ahead, feet side by side."""
    robot, p = placo.HumanoidRobot(urdf, placo.Flags.ignore_collisions), parameters(gait)
    solver = placo.KinematicsSolver(robot)
    solver.enable_velocity_limits(False)
    solver.dt = DT / REFINE
    tasks = placo.WalkTasks()
    tasks.initialize_tasks(solver, robot)
    arms = solver.add_joints_task()
    arms.set_joints({name: gait["joints"][name] for name in gait["arms"]})
    arms.configure("arms", "soft", 1.0)
    for name, value in gait["joints"].items():
        robot.set_joint(name, value)
    robot.update_kinematics()
    tasks.reach_initial_pose(np.eye(4), p.feet_spacing, p.walk_com_height, p.walk_trunk_pitch)
    steps = footsteps(gait, (robot.get_T_world_left(), robot.get_T_world_right()))
    supports = placo.FootstepsPlanner.make_supports(steps, 0.0, True, p.has_double_support(), True)
    generator = placo.WalkPatternGenerator(robot, p)
    plan = generator.plan(supports, robot.com_world(), 0.0)
    rows = []
    for t in np.arange(plan.t_start, plan.t_end, DT):
        tasks.update_tasks_from_trajectory(plan, float(t))
        for _ in range(REFINE):
            robot.update_kinematics()
            solver.solve(True)
        robot.update_kinematics()
        both = plan.support_is_both(float(t))
        side = None if both else plan.support_side(float(t))
        on = [both or side == placo.HumanoidRobot_Side.right, both or side == placo.HumanoidRobot_Side.left]
        q = [robot.get_joint(name) for name in gait["joints"]]
        rows.append((float(t), q, robot.get_T_world_fbase().copy(), on))
    time, q, T, contact = zip(*rows, strict=True)
    return {
        "time": np.array(time),
        "q": np.array(q),
        "T_world_base": np.array(T),
        "contact": np.array(contact),
    }


if __name__ == "__main__":
    np.savez(sys.argv[3], **walk(sys.argv[1], json.loads(Path(sys.argv[2]).read_text())))
