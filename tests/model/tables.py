"""A small sound table to break, and forward kinematics that shares nothing with the package."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from screwkin.errors import Fault, TableError
from screwkin.model.robot import Inertia, Robot
from screwkin.model.table import parse_robot

MINI = """
[robot]
name = "mini"
base_link = "trunk"
base = "floating"

[parameters]
thigh = 0.1

[[link]]
name = "trunk"
mass = 2
com = [0, 0, 0.1]
inertia = { box = [0.1, 0.2, 0.3] }

[[link]]
name = "right_thigh"
mass = 0.5
com = [0, -0.05, "-thigh/2"]
inertia = { xx = 0.002, yy = 0.002, zz = 0.001 }

[[link]]
name = "right_shin"
mass = 0

[[joint]]
name = "right_hip"
parent = "trunk"
child = "right_thigh"
type = "revolute"
s = [0, 1, 0]
s0 = [0, -0.05, 0]
lower = -1
upper = 2

[[joint]]
name = "right_knee"
parent = "right_thigh"
child = "right_shin"
type = "revolute"
s = [1, 0, 0]
s0 = [0, -0.05, "-thigh"]
lower = "-20*deg"
upper = 1.5

[[limb]]
name = "right_leg"
kind = "leg"
link = "right_shin"
tip = "right_foot"
frame = { xyz = [0, -0.05, "-2*thigh"] }

[[limb]]
name = "left_leg"
mirror = "y"
of = "right_leg"

[[sole]]
limb = "right_leg"
corners = [[0.1, -0.09, -0.2], [0.1, -0.01, -0.2], [-0.1, -0.01, -0.2], [-0.1, -0.09, -0.2]]

[[posture]]
name = "home"
base_height = 0.2
q = { right_hip = 0.5, left_hip = 0.5 }
"""
HIP, KNEE = "[[joint]] 1 'right_hip'", "[[joint]] 2 'right_knee'"
"""Where the rows of its joints stand."""

FOURBAR = """
[robot]
name = "four-bar"
base_link = "ground"
base = "fixed"

[[link]]
name = "ground"
mass = 0

[[link]]
name = "crank"
mass = 0

[[link]]
name = "coupler"
mass = 0

[[joint]]
name = "input"
parent = "ground"
child = "crank"
type = "revolute"
s = [0, 0, 1]
s0 = [0, 0, 0]

[[joint]]
name = "pin"
parent = "crank"
child = "coupler"
type = "revolute"
s = [0, 0, 1]
s0 = [0, 1, 0]

[[closure]]
name = "loop"
link_a = "coupler"
frame_a = { xyz = [2, 1, 0], rpy = [0, 0, "90*deg"] }
link_b = "ground"
frame_b = { xyz = [2, 1, 0] }
"""


def changed(old: str, new: str, table: str = MINI) -> str:
    """The table with one place changed; the place must be there exactly once."""
    assert table.count(old) == 1, f"{table.count(old)} times: {old!r}"
    return table.replace(old, new)


def faults_of(text: str) -> tuple[Fault, ...]:
    """All faults of a text, which must be refused in one TableError whose message holds every one."""
    with pytest.raises(TableError) as caught:
        parse_robot(text, "mini.toml")
    assert str(caught.value).splitlines() == [f"mini.toml: {fault}" for fault in caught.value.faults]
    assert caught.value.exit_code == 2
    return caught.value.faults


def only_fault(text: str) -> Fault:
    """The one fault of a text."""
    faults = faults_of(text)
    assert len(faults) == 1, "\n".join(map(str, faults))
    return faults[0]


def displacements(robot: Robot, q: Mapping[str, float]) -> dict[str, NDArray[np.float64]]:
    """Displacement (4, 4) of every link from the zero pose, link by link from its parent's."""
    done = {robot.base_link: np.eye(4)}
    joints = {joint.child: joint for joint in robot.joints}

    def of(link: str) -> NDArray[np.float64]:
        if link not in done:
            joint = joints[link]
            s, s0 = (np.array([float(c) for c in v]) for v in (joint.screw.s, joint.screw.s0))
            angle = q.get(joint.name, 0.0)
            D = np.eye(4)
            if joint.type == "prismatic":
                D[:3, 3] = angle * s
            else:
                D[:3, :3] = Rotation.from_rotvec(angle * s).as_matrix()
                D[:3, 3] = s0 - D[:3, :3] @ s0 + float(joint.screw.pitch) * angle * s
            done[link] = of(joint.parent) @ D
        return done[link]

    return {name: of(name) for name in robot.link_names}


def matrix_of(inertia: Inertia) -> NDArray[np.float64]:
    """The inertia as a matrix (3, 3)."""
    i = inertia
    return np.array([[i.xx, i.xy, i.xz], [i.xy, i.yy, i.yz], [i.xz, i.yz, i.zz]], dtype=float)
