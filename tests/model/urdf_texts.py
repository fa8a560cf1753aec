"""URDF texts for tests: a small arm, and random trees."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

ARM = """<?xml version="1.0"?>
<robot name="arm">
  <link name="base"/>
  <link name="upper"><inertial><mass value="2"/><origin xyz="0 0 0.1"/>
    <inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><origin xyz="0 0 0.3" rpy="0 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="2" velocity="3" effort="4"/>
  </joint>
</robot>
"""

GRIP = """<?xml version="1.0"?>
<robot name="gripping">
  <link name="torso"/><link name="hip"/><link name="f1"/><link name="f2"/>
  <joint name="hip" type="revolute"><parent link="torso"/><child link="hip"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="f1" type="revolute"><origin xyz="0 0.02 -0.1"/><parent link="hip"/><child link="f1"/>
    <axis xyz="1 0 0"/><limit lower="0" upper="0.8" effort="1" velocity="1"/></joint>
  <joint name="f2" type="continuous"><origin xyz="0 -0.02 -0.1"/><parent link="hip"/><child link="f2"/>
    <axis xyz="1 0 0"/><mimic joint="f1" multiplier="-1" offset="0"/></joint>
</robot>
"""


def random_urdf(rng: np.random.Generator, links: int = 9) -> str:
    """A tree with turned origins, turned inertias, slanted axes of any length, and fixed joints."""

    def numbers(values: np.ndarray) -> str:
        return " ".join(repr(float(x)) for x in values)

    def origin() -> str:
        return f'<origin xyz="{numbers(rng.uniform(-1, 1, 3))}" rpy="{numbers(rng.uniform(-3, 3, 3))}"/>'

    text = ['<robot name="random">']
    for i in range(links):
        if rng.random() < 0.2:
            text.append(f'<link name="link{i}"/>')
            continue
        a, b, c = rng.uniform(0.1, 1, 3)
        R = Rotation.random(random_state=rng).as_matrix()
        inertia = R @ np.diag([b + c, a + c, a + b]) @ R.T
        pairs = {"ixx": (0, 0), "iyy": (1, 1), "izz": (2, 2), "ixy": (0, 1), "ixz": (0, 2), "iyz": (1, 2)}
        moments = " ".join(f'{key}="{float(inertia[at])!r}"' for key, at in pairs.items())
        mass = f'<mass value="{rng.uniform(0.1, 2)!r}"/>'
        text.append(f'<link name="link{i}"><inertial>{origin()}{mass}<inertia {moments}/></inertial></link>')
    for i in range(1, links):
        kind = rng.choice(["revolute", "continuous", "prismatic", "fixed"])
        ends = f'<parent link="link{rng.integers(i)}"/><child link="link{i}"/>'
        axis = f'<axis xyz="{numbers(rng.normal(size=3) * 2)}"/>' if kind != "fixed" else ""
        limit = '<limit lower="-2" upper="2" velocity="3" effort="4"/>'
        text.append(f'<joint name="joint{i}" type="{kind}">{ends}{origin()}{axis}{limit}</joint>')
    return "\n".join([*text, "</robot>"])
