"""Robots made of DH tables: the same chains, shared joints once."""

import numpy as np
import pytest

from screwkin.algebra.se3 import as_array
from screwkin.errors import InputError, TableError
from screwkin.kinematics.positions import link_displacements, pose_in_base
from screwkin.model.dh_csv import load_dh, parse_dh
from screwkin.model.dh_robot import robot_from_dh
from screwkin.model.library import data_folder
from screwkin.model.table import load_robot
from tests.model.chains import fk_by_matrices

HEADER = "convention,limb,joint,type,alpha_deg,a_mm,d_mm,offset_deg\n"
TORSO = """standard,left_arm,turn,revolute,90,0,300,0
standard,left_arm,left_lift,prismatic,0,0,200,0
standard,left_arm,left_hand,fixed,0,50,0,0
standard,right_arm,turn,revolute,90,0,300,0
standard,right_arm,right_elbow,revolute,0,100,0,0
"""


def test_the_papers_table_becomes_a_robot_that_moves_as_the_bundled_one():
    tables = load_dh(data_folder("robots") / "dh" / "poppy12.csv")
    robot, bundled = robot_from_dh(tables, "twin"), load_robot("poppy12")
    assert robot.joint_names == bundled.joint_names
    assert [(limb.name, limb.kind, limb.tip) for limb in robot.limbs] == [
        (limb.name, limb.kind, limb.tip) for limb in bundled.limbs
    ]
    assert (robot.name, robot.base, robot.mass) == ("twin", "floating", 0)
    q = np.random.default_rng(1).uniform(-3, 3, (100, 12))
    displaced, expected = link_displacements(robot, list(q.T)), link_displacements(bundled, list(q.T))
    for tip in robot.tip_names:
        np.testing.assert_allclose(
            as_array(pose_in_base(robot, displaced, tip)),
            as_array(pose_in_base(bundled, expected, tip)),
            rtol=0,
            atol=1e-14,
        )


def test_chains_that_begin_with_the_same_joint_share_it():
    left, right = tables = parse_dh(HEADER + TORSO)
    robot = robot_from_dh(tables, "torso")
    assert robot.joint_names == ("turn", "left_lift", "right_elbow")
    assert (robot.base, [limb.kind for limb in robot.limbs]) == ("fixed", ["arm", "arm"])
    q = np.random.default_rng(2).uniform(-1, 1, (50, 3))
    displaced = link_displacements(robot, list(q.T))
    for table, columns in ((left, [0, 1]), (right, [0, 2])):
        found = as_array(pose_in_base(robot, displaced, table.tip))
        np.testing.assert_allclose(found, fk_by_matrices(table, q[:, columns]), rtol=0, atol=1e-15)


@pytest.mark.parametrize(("old", "new"), [("90,0,300,0\nstandard,right", "90,0,301,0\nstandard,right")])
def test_one_name_for_two_joints_is_refused(old, new):
    assert robot_from_dh(
        parse_dh(HEADER + TORSO.replace(old, new, 1)), "torso"
    )  # d along the axis: same line
    moved = TORSO.replace("right_arm,turn,revolute,90", "right_arm,turn,prismatic,90")
    with pytest.raises(InputError, match="joint 'turn' of chain 'right_arm' differs"):
        robot_from_dh(parse_dh(HEADER + moved), "torso")


def test_names_that_a_table_forbids_are_told():
    with pytest.raises(TableError, match="'1st' is not a name"):
        robot_from_dh(parse_dh(HEADER + "standard,arm,1st,revolute,0,0,0,0\n"), "arm")
