"""Every way to get a table wrong ends in one error that says where, what and what to do."""

from __future__ import annotations

import pytest

from screwkin.errors import TableError
from screwkin.model.table import load_robot, parse_robot
from tests.model.tables import FOURBAR, MINI, changed, faults_of, only_fault

HIP, KNEE = "[[joint]] 1 'right_hip'", "[[joint]] 2 'right_knee'"
THIGH = 'name = "right_thigh"\nmass = 0.5'


def test_the_small_table_itself_is_sound():
    assert parse_robot(MINI).name == "mini"
    assert parse_robot(FOURBAR).name == "four-bar"


def test_an_unknown_key_is_told_with_the_nearest_and_all_valid_ones():
    fault = only_fault(changed(THIGH, THIGH + "\nmas = 3"))
    assert (fault.row, fault.key, fault.found) == ("[[link]] 2 'right_thigh'", "mas", "is unknown")
    assert fault.fix == "Did you mean 'mass'? Keys: name, mass, com, inertia, frame, boxes"


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


def test_inertia_that_breaks_the_triangle_inequality_is_told_with_its_moments():
    fault = only_fault(changed("xx = 0.002, yy = 0.002, zz = 0.001", "xx = 0.002, yy = 0.002, zz = 0.005"))
    assert (fault.row, fault.key) == ("[[link]] 2 'right_thigh'", "inertia")
    assert (
        "principal moments (0.002, 0.002, 0.005) break the triangle inequality: 0.005 > 0.002 + 0.002"
        in fault.found
    )


def test_the_triangle_inequality_holds_for_principal_moments_not_for_the_diagonal():
    """Turned by 45 degrees about x, moments (1, 1, 3) have the harmless diagonal (1, 2, 2)."""
    fault = only_fault(changed("xx = 0.002, yy = 0.002, zz = 0.001", "xx = 1, yy = 2, zz = 2, yz = 1"))
    assert "principal moments (1, 1, 3) break the triangle inequality" in fault.found


def test_inertia_of_a_plate_lies_on_the_edge_and_is_sound():
    text = changed("xx = 0.002, yy = 0.002, zz = 0.001", "xx = 0.1, yy = 0.2, zz = 0.3")
    assert parse_robot(text).link("right_thigh").inertia.zz == 0.3


def test_inertia_that_is_not_positive_is_told():
    fault = only_fault(changed("xx = 0.002, yy = 0.002, zz = 0.001", "xx = 1, yy = 1, zz = 1, xy = 2"))
    assert "are not all >= 0" in fault.found


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
    assert (fault.key, fault.found) == ("tip", "tip 'right_shin' bears the name of a link")


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


def test_a_table_without_robot_or_links_is_told():
    keys = {fault.key for fault in faults_of("")}
    assert {"robot", "link"} <= keys


def test_rows_of_the_wrong_kind_are_told():
    for text in (
        "robot = 3",
        "parameters = 3\n" + MINI,
        "joint = 3\nlink = [1, 2]",
        "robot = [1]\nservos = 1",
    ):
        assert faults_of(text.replace("[parameters]\nthigh = 0.1", ""))


def test_broken_toml_is_told_with_its_line():
    fault = only_fault(changed("base = ", "base == "))
    assert fault.row.startswith("line 5")


def test_a_key_written_twice_is_told_with_its_line():
    assert only_fault(changed("mass = 2\n", "mass = 2\nmass = 3\n")).row.startswith("line 13")


@pytest.mark.parametrize("text", ["x = " + "[" * 5000, "x = " + "9" * 5000, "\0", "x = 1 y = 2"])
def test_hostile_toml_is_told_without_a_traceback(text):
    assert only_fault(text).fix.startswith("Mend the TOML")


def test_a_file_that_is_not_utf8_is_told_with_its_line(tmp_path):
    path = tmp_path / "latin.toml"
    path.write_bytes('[robot]\nname = "ä"\n'.encode("latin-1"))
    with pytest.raises(TableError, match=r"latin\.toml: line 2: byte 0xe4 is not UTF-8"):
        load_robot(path)


def test_a_folder_is_told(tmp_path):
    with pytest.raises(TableError, match="is a folder"):
        load_robot(tmp_path)


def test_a_file_that_cannot_be_read_is_told(tmp_path):
    path = tmp_path / "loop.toml"
    path.symlink_to(path)
    with pytest.raises(Exception, match=r"loop\.toml") as caught:
        load_robot(path)
    assert caught.value.exit_code == 2


def test_all_faults_of_all_kinds_are_told_at_once():
    text = MINI
    for old, new in [
        ("mass = 2", "mass = -2\ncolour = 3"),
        ("thigh = 0.1", 'thigh = 0.1\nwidth = "width"'),
        ("s = [0, 1, 0]", "s = [0, 2, 0]"),
        ("xx = 0.002", "xx = 0.2"),
        ('kind = "leg"', 'kind = "arm"'),
        ("right_hip = 0.5", "right_hop = 0.5"),
        ("upper = 1.5", "upper = -1.5"),
    ]:
        text = changed(old, new, text)
    places = {(fault.row, fault.key) for fault in faults_of(text)}
    assert places == {
        ("[parameters]", "width"),
        ("[[link]] 1 'trunk'", "mass"),
        ("[[link]] 1 'trunk'", "colour"),
        ("[[link]] 2 'right_thigh'", "inertia"),
        (HIP, "s"),
        (KNEE, "lower"),
        ("[[sole]] 1 'right_leg'", "limb"),
        ("[[posture]] 1 'home'", "q.right_hop"),
    }


def test_a_wrong_number_in_a_row_does_not_hide_or_invent_connections():
    """The row of the hip is faulty, yet the thigh still hangs by it and the posture may still name it."""
    assert only_fault(changed("s0 = [0, -0.05, 0]", 's0 = "here"')).key == "s0"
