"""Define a robot by a screw table, and check its kinematics by hand.

One row a joint: a unit axis `s` and any point `s0` on it, given in the base frame with the robot in its zero
pose. Here: a leg of three joints hanging from a bench. No joint frames appear anywhere.
"""

import numpy as np

import screwkin as sk
from screwkin.model.table import parse_robot

TABLE = """
[robot]
name = "bench-leg"
description = "hip, knee and ankle, all turning about y"
source = "example"
base_link = "bench"
base = "fixed"

[parameters]
thigh = 0.08
calf = 0.07

[[link]]
name = "bench"
mass = 1.0
com = [0, 0, 0]
inertia = { box = [0.1, 0.1, 0.1] }

[[link]]
name = "thigh_link"
mass = 0.15
com = [0, 0, "-thigh/2"]
inertia = { box = [0.03, 0.03, "thigh"] }

[[link]]
name = "calf_link"
mass = 0.15
com = [0, 0, "-thigh - calf/2"]
inertia = { box = [0.03, 0.03, "calf"] }

[[link]]
name = "foot_link"
mass = 0.03
com = [0, 0, "-thigh - calf"]
inertia = { box = [0.08, 0.05, 0.01] }

[[joint]]
name = "hip"
parent = "bench"
child = "thigh_link"
type = "revolute"
s = [0, 1, 0]
s0 = [0, 0, 0]

[[joint]]
name = "knee"
parent = "thigh_link"
child = "calf_link"
type = "revolute"
s = [0, 1, 0]
s0 = [0, 0, "-thigh"]

[[joint]]
name = "ankle"
parent = "calf_link"
child = "foot_link"
type = "revolute"
s = [0, 1, 0]
s0 = [0, 0, "-thigh - calf"]
"""


def main() -> float:
    """Compare the foot's position with elementary trigonometry at 1,000 postures; print the largest error."""
    robot = parse_robot(TABLE)
    q = np.random.default_rng(1).uniform(-1.5, 1.5, size=(1000, 3))
    state = sk.State(np.eye(4), q)
    foot = sk.frame_pose(robot, state, "foot_link")[:, :3, 3]

    hip, knee = q[:, 0], q[:, 0] + q[:, 1]
    x = -0.08 * np.sin(hip) - 0.07 * np.sin(knee)
    z = -0.08 * np.cos(hip) - 0.07 * np.cos(knee)
    error = float(np.abs(foot - np.stack([x, 0 * x, z], axis=1)).max())
    print(f"{robot.name}: {len(robot.joints)} screws, foot position against trigonometry: {error:.1e} m")
    return error


if __name__ == "__main__":
    main()
