"""Public robots: limbs as their makers name them, or refused. Names are for the judge only."""

import importlib.util
import os
import warnings
from pathlib import Path

import numpy as np
import pytest

from screwkin.algebra.se3 import as_array
from screwkin.anatomy.humanoid import anatomy
from screwkin.anatomy.limbs import AnatomyError
from screwkin.dynamics.support import sole_corners
from screwkin.errors import TableError
from screwkin.model.urdf_in import load_urdf

FEET = {
    "alexander_v1.lowerBodyOnly": "LEFT_FOOT",
    "bolt": "FL_LOWER_LEG",
    "g1_29dof_rev_1_0": "left_ankle_roll_link",
    "g1_29dof_with_hand_rev_1_0": "left_ankle_roll_link",
    "human": "left_foot",
    "icub": "l_ankle_2",
    "icub_reduced": "l_ankle_2",
    "romeo": "l_ankle",
    "romeo_small": "l_ankle",
    "romeo_laas_small": "l_ankle",
    "talos_full_v2": "leg_left_6_link",
    "talos_full_v2_box": "leg_left_6_link",
    "talos_reduced": "leg_left_6_link",
    "talos_reduced_box": "leg_left_6_link",
    "talos_reduced_corrected": "leg_left_6_link",
}
"""The left foot of every file that is a robot on two legs with feet that can be seen; all others are none."""
LEG = {"bolt": 3}
"""Joints of a leg that has not six."""
BACKWARDS = {"icub", "icub_reduced"}
"""Files whose x axis points backwards, as their makers say."""
SIDE_UP = {"human"}
"""Files with y up."""


def public_robots() -> list[Path]:
    """The files of the package, else of the folder in SCREWKIN_ROBOTS."""
    found = importlib.util.find_spec("example_robot_data")
    folder = (
        os.environ.get("SCREWKIN_ROBOTS", "") if found is None else str(Path(str(found.origin)).parents[4])
    )
    return sorted(Path(folder).rglob("*.urdf")) if folder else []


@pytest.mark.robots
def test_limbs_of_public_robots_are_those_that_their_makers_name():
    files = public_robots()
    if not files:
        pytest.skip("no public robots: install example-robot-data, or name their folder in SCREWKIN_ROBOTS")
    accepted = set()
    for path in files:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                seen = anatomy(load_urdf(path).robot)
            except (AnatomyError, TableError):
                continue
        name, robot = path.stem, seen.robot
        accepted.add(name)
        assert robot.limb("left_leg").link == FEET[name], name
        pelvis = robot.path_to(robot.limb("left_leg").link)
        shared = set(pelvis) & set(robot.path_to(robot.limb("right_leg").link))
        assert len(pelvis) - len(shared) == LEG.get(name, 6), name
        forward = as_array(seen.turn)[0].astype(float)
        np.testing.assert_allclose(forward, (-1 if name in BACKWARDS else 1, 0, 0), atol=1e-6, err_msg=name)
        up = as_array(seen.turn)[2].astype(float)
        np.testing.assert_allclose(up, (0, 1, 0) if name in SIDE_UP else (0, 0, 1), atol=1e-6, err_msg=name)
        left, right = (sole_corners(robot, f"{side}_leg") for side in ("left", "right"))
        assert len(left) == len(right), name
    assert accepted == {path.stem for path in files} & set(FEET)
