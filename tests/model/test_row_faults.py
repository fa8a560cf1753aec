"""Wrong keys and values within a row: one error that says where, what was found and what would be right."""

from __future__ import annotations

import re

import pytest

from screwkin.errors import RobotRemark
from screwkin.model.table import parse_robot, robot_from_text
from tests.model.tables import FOURBAR, HIP, MINI, changed, only_fault

THIGH = 'name = "right_thigh"\nmass = 0.5'


def test_the_small_table_itself_is_sound():
    assert parse_robot(MINI).name == "mini"
    assert parse_robot(FOURBAR).name == "four-bar"


def test_an_unknown_key_is_told_with_the_nearest_and_all_valid_ones():
    fault = only_fault(changed(THIGH, THIGH + "\nmas = 3"))
    assert (fault.row, fault.key, fault.found) == ("[[link]] 2 'right_thigh'", "mas", "is unknown")
    assert fault.fix == "Did you mean 'mass'? Keys: name, mass, com, inertia, frame, boxes, shapes, spring"


def test_an_unknown_key_in_an_inline_table_is_told_with_its_place():
    fault = only_fault(changed("{ box = [0.1, 0.2, 0.3] }", "{ boxx = [0.1, 0.2, 0.3] }"))
    assert (fault.row, fault.key) == ("[[link]] 1 'trunk'", "inertia.boxx")
    assert fault.fix.startswith("Did you mean 'box'?")


def test_an_unknown_table_is_told():
    fault = only_fault(MINI + "\n[[joints]]\n")
    assert (fault.key, fault.found) == ("joints", "is unknown")
    assert "Did you mean 'joint'?" in fault.fix


def test_a_row_written_as_a_single_table_is_told():
    fault = only_fault(FOURBAR.replace("[[closure]]", "[closure]"))
    assert fault.row == "[closure]"
    assert "[[closure]]" in fault.fix


def test_a_missing_axis_is_told():
    fault = only_fault(changed("s = [0, 1, 0]\n", ""))
    assert (fault.row, fault.key, fault.found) == (HIP, "s", "is missing")
    assert fault.fix == "Write s = unit vector [x, y, z] of its axis"


def test_an_axis_that_is_no_unit_vector_is_told_with_the_normalised_one():
    fault = only_fault(changed("s = [0, 1, 0]", "s = [0, 3, 4]"))
    assert (fault.row, fault.key) == (HIP, "s")
    assert fault.found == "(0, 3, 4) has norm 5, expected 1"
    assert fault.fix == "Write s = [0, 0.6, 0.8]"


def test_an_axis_is_a_unit_vector_up_to_nine_digits():
    assert parse_robot(changed("s = [0, 1, 0]", "s = [0, 1.0000000009, 0]"))
    assert only_fault(changed("s = [0, 1, 0]", "s = [0, 1.0000000011, 0]")).key == "s"


def test_a_zero_axis_is_told():
    assert only_fault(changed("s = [0, 1, 0]", "s = [0, 0, 0]")).found == "s is the zero vector"


def test_an_axis_of_two_components_is_told():
    fault = only_fault(changed("s = [0, 1, 0]", "s = [0, 1]"))
    assert fault.fix == "Write three numbers, as [x, y, z]"


def test_nan_is_told():
    fault = only_fault(changed("s0 = [0, -0.05, 0]", "s0 = [0, nan, 0]"))
    assert (fault.row, fault.key, fault.found) == (HIP, "s0", "nan is not finite")


def test_infinity_is_told():
    assert only_fault(changed("upper = 2", "upper = inf")).found == "inf is not finite"


def test_a_text_that_is_no_number_is_told():
    fault = only_fault(changed("mass = 2", 'mass = "two"'))
    assert (fault.key, fault.found) == ("mass", "'two' uses the unknown name 'two'")


def test_a_boolean_is_no_number():
    assert only_fault(changed("mass = 2", "mass = true")).found == "True is not a number"


def test_code_in_a_formula_is_refused():
    fault = only_fault(changed("mass = 2", "mass = \"__import__('os').getcwd()\""))
    assert "refused" in fault.found or "__import__" in fault.found


def test_a_parameter_that_refers_to_itself_is_told_once_though_many_rows_use_it():
    fault = only_fault(changed("thigh = 0.1", 'thigh = "2*thigh"'))
    assert (fault.row, fault.key, fault.found) == (
        "[parameters]",
        "thigh",
        "refers to itself: thigh -> thigh",
    )


def test_a_division_by_zero_is_told_where_it_stands():
    fault = only_fault(changed('"-thigh/2"', '"1/(thigh - thigh)"'))
    assert (fault.row, fault.key) == ("[[link]] 2 'right_thigh'", "com")
    assert fault.found == "'1/(thigh - thigh)' divides by zero"


def test_a_negative_mass_is_told():
    fault = only_fault(changed("mass = 2", "mass = -2"))
    assert (fault.row, fault.key, fault.found) == ("[[link]] 1 'trunk'", "mass", "mass -2 is negative")


def test_a_mass_without_inertia_is_told():
    fault = only_fault(changed("inertia = { box = [0.1, 0.2, 0.3] }\n", ""))
    assert (fault.key, fault.found) == ("inertia", "is missing")


def test_a_mass_without_centre_is_told():
    assert only_fault(changed("com = [0, 0, 0.1]\n", "")).key == "com"


def test_inertia_that_breaks_the_triangle_inequality_is_read_with_a_warning_of_its_moments():
    text = changed("xx = 0.002, yy = 0.002, zz = 0.001", "xx = 0.002, yy = 0.002, zz = 0.005")
    told = (
        "mine: link right_thigh, key inertia: principal moments (0.002, 0.002, 0.005) break the triangle "
        "inequality: 0.005 > 0.002 + 0.002"
    )
    with pytest.warns(RobotRemark, match=re.escape(told)):
        assert robot_from_text(text, "mine").link("right_thigh").inertia.zz == 0.005


def test_the_triangle_inequality_holds_for_principal_moments_not_for_the_diagonal():
    """Turned by 45 degrees about x, moments (1, 1, 3) have the harmless diagonal (1, 2, 2)."""
    text = changed("xx = 0.002, yy = 0.002, zz = 0.001", "xx = 1, yy = 2, zz = 2, yz = 1")
    with pytest.warns(RobotRemark, match=re.escape("principal moments (1, 1, 3) break the triangle")):
        robot_from_text(text)


def test_inertia_of_a_plate_lies_on_the_edge_and_is_sound():
    text = changed("xx = 0.002, yy = 0.002, zz = 0.001", "xx = 0.1, yy = 0.2, zz = 0.3")
    assert parse_robot(text).link("right_thigh").inertia.zz == 0.3


def test_inertia_that_is_not_positive_is_a_remark():
    text = changed("xx = 0.002, yy = 0.002, zz = 0.001", "xx = 1, yy = 1, zz = 1, xy = 2")
    with pytest.warns(RobotRemark, match=re.escape("are not all >= 0: no body has them")):
        robot_from_text(text)


def test_inertia_given_twice_or_half_is_told():
    both = only_fault(changed("{ box = [0.1, 0.2, 0.3] }", "{ box = [0.1, 0.2, 0.3], xx = 1 }"))
    assert both.found == "is both a box and components"
    assert only_fault(changed("{ box = [0.1, 0.2, 0.3] }", "{}")).found == "is empty"
    assert only_fault(changed(", zz = 0.001", "")).found == "zz missing"


def test_a_box_with_a_negative_edge_is_told():
    fault = only_fault(changed("box = [0.1, 0.2, 0.3]", "box = [0.1, -0.2, 0.3]"))
    assert (fault.key, fault.fix) == ("inertia.box", "Write three positive lengths, as [lx, ly, lz]")


def test_a_fault_in_a_box_tells_which_box():
    text = changed(
        THIGH, THIGH + "\nboxes = [{ center = [0, 0, 0], size = [1, 1, 1] }, { center = [0, 0, 0] }]"
    )
    fault = only_fault(text)
    assert (fault.key, fault.found) == ("boxes[1].size", "is missing")


def test_limits_in_the_wrong_order_are_told():
    fault = only_fault(changed("upper = 2", "upper = -2"))
    assert (fault.row, fault.key, fault.found) == (HIP, "lower", "-1 is above upper -2")


@pytest.mark.parametrize("key", ["velocity", "effort"])
@pytest.mark.parametrize("value", ["0", "-1.5"])
def test_a_speed_or_torque_that_is_not_positive_is_told(key, value):
    fault = only_fault(changed("upper = 2", f"upper = 2\n{key} = {value}"))
    assert (fault.row, fault.key) == (HIP, key)
    assert fault.found.endswith("is not positive")


def test_an_unknown_joint_type_is_told_with_the_valid_ones():
    fault = only_fault(
        changed('child = "right_thigh"\ntype = "revolute"', 'child = "right_thigh"\ntype = "hinge"')
    )
    assert (fault.key, fault.found) == ("type", "found 'hinge'")
    assert fault.fix == 'Expected "revolute", "prismatic" or "helical"'


def test_a_helical_joint_without_pitch_is_told():
    fault = only_fault(
        changed('child = "right_thigh"\ntype = "revolute"', 'child = "right_thigh"\ntype = "helical"')
    )
    assert (fault.row, fault.key, fault.found) == (HIP, "pitch", "is missing or 0")


def test_a_pitch_on_a_revolute_joint_is_told():
    fault = only_fault(changed("upper = 2", "upper = 2\npitch = 0.01"))
    assert fault.found == "0.01 on a revolute joint"


def corners(text: str) -> str:
    before, after = MINI.index("corners = "), MINI.index("[[posture]]")
    return f"{MINI[:before]}corners = {text}\n{MINI[after:]}"


def test_a_sole_of_two_corners_is_told():
    assert only_fault(corners("[[0, 0, 0], [1, 0, 0]]")).found == "2 given"


def test_a_clockwise_sole_is_told_to_be_reversed():
    fault = only_fault(corners("[[0, 0, 0], [0, 1, 0], [1, 1, 0], [1, 0, 0]]"))
    assert (fault.found, fault.fix) == ("run clockwise seen from above", "Reverse their order")


@pytest.mark.parametrize(
    "text",
    [
        "[[0, 0, 0], [2, 0, 0], [0.5, 0.5, 0], [0, 2, 0]]",
        "[[0, 0, 0], [1, 0, 0], [2, 0, 0]]",
        "[[0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 1, 0]]",
        "[[1, 0, 0], [-0.8, 0.6, 0], [0.3, -0.95, 0], [0.3, 0.95, 0], [-0.8, -0.6, 0]]",
        "[[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 1, 0]]",
        "[[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 2, 0]]",
    ],
    ids=["dented", "flat", "crossed", "star", "repeated", "on an edge"],
)
def test_a_sole_that_is_not_convex_is_told(text):
    assert only_fault(corners(text)).found == "are not convex"


def test_a_bent_sole_is_told():
    fault = only_fault(corners("[[0, 0, 0], [1, 0, 0], [1, 1, 0.01], [0, 1, 0]]"))
    assert fault.found == "do not lie in one plane"
