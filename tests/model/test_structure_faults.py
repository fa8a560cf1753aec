"""Wrong names and connections: links that are no tree, limbs, soles and postures of what is not there."""

from __future__ import annotations

import pytest

from screwkin.model.table import parse_robot
from tests.model.tables import FOURBAR, HIP, KNEE, MINI, changed, faults_of, only_fault


@pytest.mark.parametrize(
    ("old", "new", "row", "key"),
    [
        ('parent = "right_thigh"', 'parent = "right_tigh"', KNEE, "parent"),
        ('link = "right_shin"', 'link = "right_tigh"', "[[limb]] 1 'right_leg'", "link"),
        ('base_link = "trunk"', 'base_link = "right_tigh"', "[robot]", "base_link"),
    ],
)
def test_an_unknown_link_is_told_with_the_nearest(old, new, row, key):
    faults = [fault for fault in faults_of(changed(old, new)) if fault.key == key]
    assert [(fault.row, fault.found) for fault in faults] == [(row, "there is no link 'right_tigh'")]
    assert "Did you mean 'right_thigh'?" in faults[0].fix
    assert "trunk" in faults[0].fix


def test_a_closure_to_an_unknown_link_is_told():
    fault = only_fault(changed('link_b = "ground"', 'link_b = "grund"', FOURBAR))
    assert (fault.row, fault.key) == ("[[closure]] 1 'loop'", "link_b")
    assert "Did you mean 'ground'?" in fault.fix


def test_a_closure_of_a_link_with_itself_is_told():
    assert only_fault(changed('link_b = "ground"', 'link_b = "coupler"', FOURBAR)).key == "link_b"


def test_parents_that_run_in_a_circle_are_told_with_the_way_round():
    fault = only_fault(changed('parent = "trunk"', 'parent = "right_shin"'))
    assert fault.key == "parent"
    assert fault.found.startswith("parents run in a circle: ")
    way = fault.found.partition(": ")[2].split(" -> ")
    assert way[0] == way[-1]
    assert set(way) == {"right_thigh", "right_shin"}


def test_a_second_root_is_told():
    fault = only_fault(FOURBAR + '\n[[link]]\nname = "loose"\nmass = 0\n')
    assert (fault.row, fault.key) == ("[[link]] 4 'loose'", "name")
    assert fault.found == "link 'loose' is carried by no joint: a second root beside base_link 'ground'"


def test_a_joint_that_carries_the_base_is_told():
    text = changed('parent = "ground"\nchild = "crank"', 'parent = "crank"\nchild = "ground"', FOURBAR)
    founds = [fault.found for fault in faults_of(text)]
    assert "carries the base link 'ground'" in founds


def test_a_link_carried_by_two_joints_is_told():
    extra = MINI[MINI.index("[[joint]]") : MINI.index('[[joint]]\nname = "right_knee"')]
    fault = only_fault(MINI + extra.replace("right_hip", "right_other"))
    assert (fault.row, fault.key) == ("[[joint]] 3 'right_other'", "child")
    assert fault.found == f"link 'right_thigh' is already carried by {HIP}"
    assert "[[closure]]" in fault.fix


def test_a_name_used_twice_is_told_with_both_places():
    fault = only_fault(changed('name = "pin"', 'name = "input"', FOURBAR))
    assert fault.row == "[[joint]] 2 'input'"
    assert fault.found == "there is a joint 'input' already, at [[joint]] 1 'input'"


def test_a_mirrored_name_that_exists_already_is_told_at_the_mirrored_limb():
    text = MINI + '\n[[link]]\nname = "left_shin"\nmass = 0\n'
    faults = faults_of(text)
    assert ("[[limb]] 2 'left_leg'", "of") in [(fault.row, fault.key) for fault in faults]
    assert any("there is a link 'left_shin' already" in fault.found for fault in faults)


def test_a_tip_that_bears_the_name_of_a_link_is_told():
    fault = faults_of(changed('tip = "right_foot"', 'tip = "right_shin"'))[0]
    assert (fault.key, fault.found) == ("tip", "tip 'right_shin' has the name of a link")


def test_a_reserved_tip_is_told():
    founds = [fault.found for fault in faults_of(changed('tip = "right_foot"', 'tip = "waist"'))]
    assert "tip 'waist' is a reserved name" in founds


def test_a_link_called_base_beside_the_base_link_is_told():
    text = FOURBAR.replace('"crank"', '"base"')
    assert only_fault(text).found == "link 'base' is not base_link"


@pytest.mark.parametrize("name", ["right.knee", "right knee", "3knee", ""])
def test_a_name_that_no_other_format_could_hold_is_told(name):
    fault = faults_of(changed('name = "right_knee"', f'name = "{name}"'))[0]
    assert fault.found == f"{name!r} is not a name"


def test_a_virtual_chain_of_unknown_or_repeated_couplings_is_told():
    for chain, found in (('["px", "pq"]', "is no virtual chain"), ('["px", "px"]', "twice"), ("[]", "is no")):
        fault = only_fault(changed('tip = "right_foot"', f'tip = "right_foot"\nchain = {chain}'))
        assert fault.key == "chain"
        assert found in fault.found
        assert "px, py, pz, rx, ry, rz" in fault.fix


def test_a_limb_that_mirrors_an_unknown_one_is_told():
    fault = only_fault(changed('of = "right_leg"', 'of = "right_log"').replace(", left_hip = 0.5", ""))
    assert (fault.row, fault.key) == ("[[limb]] 2 'left_leg'", "of")
    assert fault.fix.startswith("Did you mean 'right_leg'?")


def test_a_mirrored_limb_with_keys_of_its_own_is_told():
    fault = only_fault(changed('mirror = "y"', 'mirror = "y"\nkind = "leg"'))
    assert (fault.key, fault.fix) == ("kind", "Keys: name, mirror, of")


def test_a_mirrored_limb_whose_name_is_not_the_other_side_is_told():
    fault = only_fault(changed('name = "left_leg"', 'name = "second_leg"'))
    assert fault.fix == "Write name = 'left_leg'"


def test_a_mirrored_part_that_names_no_side_is_told():
    fault = faults_of(MINI.replace("right_shin", "shin"))[0]
    assert fault.found == "link 'shin' is mirrored but names no side"


def test_a_sole_of_an_arm_is_told():
    fault = only_fault(changed('kind = "leg"', 'kind = "arm"'))
    assert (fault.row, fault.key) == ("[[sole]] 1 'right_leg'", "limb")
    assert fault.found == "limb 'right_leg' is no leg"


def test_a_sole_of_an_unknown_limb_is_told():
    fault = only_fault(changed('limb = "right_leg"', 'limb = "right_log"'))
    assert "Did you mean 'right_leg'?" in fault.fix


def test_a_second_sole_is_told_even_if_the_first_is_a_mirror_image():
    sole = MINI[MINI.index("[[sole]]") : MINI.index("[[posture]]")]
    assert only_fault(MINI + sole).found == "limb 'right_leg' has a sole at [[sole]] 1 'right_leg'"
    mirrored = only_fault(MINI + sole.replace("right_leg", "left_leg"))
    assert mirrored.found == "limb 'left_leg' has the mirrored sole of 'right_leg'"


def test_a_posture_with_an_unknown_joint_is_told():
    fault = only_fault(changed("right_hip = 0.5", "right_hop = 0.5"))
    assert (fault.row, fault.key) == ("[[posture]] 1 'home'", "q.right_hop")
    assert fault.fix == "Did you mean 'right_hip'? Joints: right_hip, right_knee, left_hip, left_knee"


def test_a_posture_outside_the_limits_is_told():
    fault = only_fault(changed("right_hip = 0.5", "right_hip = 2.5"))
    assert (fault.key, fault.found) == ("q.right_hip", "2.5 lies outside [-1, 2]")


def test_a_posture_outside_mirrored_limits_is_told():
    """The right knee goes from -20 to 86 degrees about x, so the left one from -86 to 20."""
    fault = only_fault(changed("right_hip = 0.5", "left_knee = 1.0"))
    assert (fault.key, fault.found) == ("q.left_knee", "1 lies outside [-1.5, 0.349066]")


def test_a_joint_left_out_of_a_posture_must_be_able_to_stand_at_zero():
    fault = only_fault(
        changed('lower = "-20*deg"', "lower = 0.2").replace("right_hip = 0.5", "left_knee = -0.3")
    )
    assert fault.key == "q.right_knee"
    assert "where joints left out are" in fault.found


def test_a_posture_of_a_floating_base_needs_its_height():
    assert only_fault(changed("base_height = 0.2\n", "")).key == "base_height"
    assert parse_robot(FOURBAR + '\n[[posture]]\nname = "zero"\n').posture("zero").base_height == 0.0
