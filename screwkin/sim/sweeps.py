"""How many sweeps over motors and contacts a solver needs that takes them one at a time.

Such a solver (projected Gauss-Seidel) sees at each contact of a foot only what that contact alone would move:
the foot, as if the joints above it were free. Joints that motors hold make the whole robot resist there, and
that comes about from sweep to sweep, in as many as the robot is heavier than the corner of a sole feels by
itself. A robot of 53 kg on feet of .34 kg falls with the sweeps that serve one of 1.7 kg.

Rigid servos want more: with both feet down they close a chain that nothing in it gives way to.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from screwkin.dynamics.quantities import mass_matrix
from screwkin.dynamics.support import sole_corners
from screwkin.kinematics.body import frame_pose, jacobian
from screwkin.model.robot import Robot
from screwkin.model.state import State

LEAST = 200
"""Sweeps of any robot."""
SERVED = 250.0
"""How many times heavier than the corner of a sole the robots are that the least number serves."""
FURTHER = 2.0
"""Sweeps for every time more."""
RIGID = 2
"""Times as many with rigid servos. A kit's contact ZMP of ``step-in-place`` is then .12 mm RMS from
its plan, not .29; twice as many again take .05 mm off it."""


def sweeps(robot: Robot, rigid: bool = False) -> int:
    """Sweeps per step of a robot: the least number, and more the heavier it is than its soles' corners.

    Args:
        robot: of numbers; its feet are judged at its posture ``home``, or else with all joints at zero.
        rigid: its servos follow their commands exactly.
    """
    served = LEAST + math.ceil(FURTHER * max(0.0, load_ratio(robot) - SERVED))
    return RIGID * served if rigid else served


def load_ratio(robot: Robot) -> float:
    """Mass of a robot over the least mass with which a corner of its soles resists the floor's push.

    A unit push along a sole's normal, with free joints, accelerates its point by n^T J M^-1 J^T n.
    """
    tree = replace(robot.with_inertia_floor(), closures=())
    known = [posture.q for posture in robot.postures if posture.name == "home"]
    state = State(np.eye(4), np.array(known[0] if known else np.zeros(len(robot.joints)), dtype=float))
    legs = [robot.limb(sole.limb) for sole in robot.soles if robot.limb(sole.limb).kind == "leg"]
    if not legs:
        return 0.0
    mobility = np.linalg.inv(mass_matrix(tree, state))
    freest = 0.0
    for leg in legs:
        T = frame_pose(tree, state, leg.tip)
        corners = sole_corners(robot, leg.tip)
        across = np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
        n = T[:3, :3] @ across / np.linalg.norm(across)
        for corner in corners:
            push = n @ jacobian(tree, state, leg.tip, point=T[:3, :3] @ corner + T[:3, 3])[3:]
            freest = max(freest, float(push @ mobility @ push))
    return float(robot.mass) * freest
