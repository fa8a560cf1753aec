"""A mirrored limb is the physical reflection of its source: positions, masses, soles, threads and limits."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st

from screwkin.algebra.se3 import as_array
from screwkin.model.mirror import is_sided, swapped
from screwkin.model.robot import Joint
from screwkin.model.table import parse_robot
from tests.model.tables import MINI, changed, displacements, faults_of, matrix_of

M3, M = np.diag([1.0, -1.0, 1.0]), np.diag([1.0, -1.0, 1.0, 1.0])

AXES = st.one_of(
    st.sampled_from(
        [(1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0.6, 0, -0.8), (0.6, 0.8, 0), (0, 0.6, 0.8)]
    ),
    st.tuples(*[st.integers(-9, 9)] * 3).filter(any).map(lambda v: tuple(c / math.hypot(*v) for c in v)),
)
NUMBERS = st.integers(-20, 20).map(lambda i: i / 10)
POINTS = st.tuples(NUMBERS, NUMBERS, NUMBERS)
JOINTS = st.tuples(st.sampled_from(["revolute", "prismatic", "helical"]), AXES, POINTS, POINTS, POINTS)


def limb_table(joints: list[Any]) -> str:
    """A right arm of the given joints on a trunk, and its mirror image."""
    rows = [
        '[robot]\nname = "random"\nbase_link = "trunk"\nbase = "fixed"\n[[link]]\nname = "trunk"\nmass = 0'
    ]
    for i, (kind, s, s0, com, rpy) in enumerate(joints):
        moments = [abs(c) + 0.5 for c in com]
        edges = dict(zip(("xx", "yy", "zz"), (sum(moments) - m for m in moments), strict=True))
        told = ", ".join(f"{k} = {v}" for k, v in (edges | {"xy": 0.03, "xz": -0.02, "yz": 0.05}).items())
        rows.append(
            f'[[link]]\nname = "right_{i}"\nmass = {i + 1}\ncom = {list(com)}\ninertia = {{ {told} }}\n'
            f"frame = {{ xyz = {list(s0)}, rpy = {list(rpy)} }}\n"
            f"boxes = [{{ center = {list(com)}, size = [1, 2, 3] }}]\n"
            f'[[joint]]\nname = "right_joint_{i}"\nparent = "{f"right_{i - 1}" if i else "trunk"}"\n'
            f'child = "right_{i}"\ntype = "{kind}"\ns = {list(s)}\ns0 = {list(s0)}\n'
            "lower = -0.5\nupper = 2.0\n" + ("pitch = 0.3" if kind == "helical" else "")
        )
    frame = "frame = { xyz = [1, 2, 3], rpy = [1, 2, 0.5] }"
    tip = f'link = "right_{len(joints) - 1}"\ntip = "right_hand"\n{frame}'
    rows.append(f'[[limb]]\nname = "right_arm"\nkind = "arm"\n{tip}')
    rows.append('[[limb]]\nname = "left_arm"\nmirror = "y"\nof = "right_arm"')
    return "\n".join(rows)


def mirrored_position(joint: Joint, q: float) -> float:
    """The rule of the tables, in its own words: which joints of the source turn the other way."""
    x, y, z = (float(c) for c in joint.screw.s)
    keeps_axis_and_turns_around = (x == z == 0) if joint.type == "prismatic" else y == 0
    return -q if keeps_axis_and_turns_around else q


@given(st.lists(JOINTS, min_size=1, max_size=4), st.lists(NUMBERS, min_size=4, max_size=4))
def test_a_mirrored_limb_moves_as_the_reflection_of_its_source(joints, positions):
    robot = parse_robot(limb_table(joints))
    q: dict[str, float] = {}
    for i, position in enumerate(positions[: len(joints)]):
        source = robot.joint(f"right_joint_{i}")
        q[source.name], q[f"left_joint_{i}"] = position, mirrored_position(source, position)
    D = displacements(robot, q)
    for i in range(len(joints)):
        right, left = robot.link(f"right_{i}"), robot.link(f"left_{i}")
        scale = np.abs(D[right.name]).max()
        close = {"rtol": 0, "atol": 1e-13 * max(1.0, float(scale)) * 10}
        np.testing.assert_allclose(D[left.name], M @ D[right.name] @ M, **close)
        T_left, T_right = (D[link.name] @ as_array(link.frame) for link in (left, right))
        np.testing.assert_allclose(T_left, M @ T_right @ M, **close)
        np.testing.assert_allclose(as_array(left.com), M3 @ as_array(right.com), **close)
        np.testing.assert_allclose(matrix_of(left.inertia), M3 @ matrix_of(right.inertia) @ M3, **close)
        np.testing.assert_allclose(
            as_array(left.boxes[0].center), M3 @ as_array(right.boxes[0].center), **close
        )
        np.testing.assert_array_equal(as_array(left.boxes[0].size), as_array(right.boxes[0].size))
        assert left.mass == right.mass
    right_tip, left_tip = robot.limb("right_arm"), robot.limb("left_arm")
    T_right, T_left = (D[limb.link] @ as_array(limb.frame) for limb in (right_tip, left_tip))
    np.testing.assert_allclose(T_left, M @ T_right @ M, rtol=0, atol=1e-11)
    assert (left_tip.tip, left_tip.kind) == ("left_hand", "arm")


@given(JOINTS, NUMBERS)
def test_a_position_is_within_the_limits_exactly_when_its_mirror_image_is(joint, q):
    robot = parse_robot(limb_table([joint]))
    right, left = robot.joints
    image = mirrored_position(right, q)
    assert (right.lower <= q <= right.upper) == (left.lower <= image <= left.upper)


@pytest.mark.parametrize(
    ("kind", "s", "axis", "limits"),
    [
        ("revolute", (1, 0, 0), (1, 0, 0), (-2.0, 0.5)),
        ("revolute", (0.6, 0, 0.8), (0.6, 0, 0.8), (-2.0, 0.5)),
        ("revolute", (0, 1, 0), (0, 1, 0), (-0.5, 2.0)),
        ("revolute", (0.6, 0.8, 0), (-0.6, 0.8, 0), (-0.5, 2.0)),
        ("prismatic", (0.6, 0, 0.8), (0.6, 0, 0.8), (-0.5, 2.0)),
        ("prismatic", (0, 1, 0), (0, 1, 0), (-2.0, 0.5)),
        ("prismatic", (0, 0.6, 0.8), (0, -0.6, 0.8), (-0.5, 2.0)),
    ],
)
def test_axes_and_limits_follow_the_rule_of_the_tables(kind, s, axis, limits):
    left = parse_robot(limb_table([(kind, s, (0.1, 0.2, 0.3), (0, 0, 0), (0, 0, 0))])).joint("left_joint_0")
    np.testing.assert_array_equal(as_array(left.screw.s), axis)
    np.testing.assert_array_equal(as_array(left.screw.s0), (0.1, -0.2, 0.3))
    assert (left.lower, left.upper) == limits


def test_the_symbolic_twin_of_a_mirrored_limb_turns_the_same_way_as_the_numeric_one():
    """The tilt is a symbol there, so only the numeric table knows that the axis lies in the plane."""
    tilted = changed("s = [0, 1, 0]", 's = ["cos(tilt)", "sin(tilt)", 0]')
    text = changed("thigh = 0.1", "thigh = 0.1\ntilt = 0", tilted)
    numeric, twin = (parse_robot(text, symbolic=symbolic).joint("left_hip") for symbolic in (False, True))
    at_value = [float(sympy.sympify(c).subs(sympy.Symbol("tilt", real=True), 0)) for c in twin.screw.s]
    assert at_value == as_array(numeric.screw.s).tolist() == [1, 0, 0]
    assert (twin.lower, twin.upper) == (numeric.lower, numeric.upper) == (-2, 1)


def test_a_mirrored_thread_has_the_other_hand():
    robot = parse_robot(limb_table([("helical", (0, 1, 0), (0, 1, 0), (0, 0, 0), (0, 0, 0))]))
    assert [joint.screw.pitch for joint in robot.joints] == [0.3, -0.3]


def test_limits_at_zero_stay_plain_zeros():
    text = changed('lower = "-20*deg"', "lower = 0")
    assert math.copysign(1, parse_robot(text).joint("left_knee").upper) == 1


def test_a_mirrored_sole_is_counter_clockwise_and_has_the_reflected_corners():
    right, left = (as_array(sole.corners) for sole in parse_robot(MINI).soles)
    assert {tuple(corner) for corner in left} == {tuple(M3 @ corner) for corner in right}
    x, y = left[:, 0], left[:, 1]
    assert np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) > 0


def test_side_branches_are_mirrored_and_the_trunk_is_shared():
    text = MINI + (
        '\n[[link]]\nname = "right_toe"\nmass = 0\n'
        '[[joint]]\nname = "right_toe_hinge"\nparent = "right_thigh"\nchild = "right_toe"\n'
        'type = "revolute"\ns = [0, 1, 0]\ns0 = [0, 0, 0]\n'
    )
    robot = parse_robot(text)
    assert robot.joint_names[3:] == ("left_hip", "left_knee", "left_toe_hinge")
    assert robot.joint("left_toe_hinge").parent == "left_thigh"
    assert robot.joint("left_hip").parent == "trunk"


def test_two_limbs_on_one_branch_are_mirrored_once():
    second = '\n[[limb]]\nname = "{side}_claw"\n'
    text = (
        MINI
        + second.format(side="right")
        + ('kind = "arm"\nlink = "right_thigh"\ntip = "right_claw_tip"\nframe = { xyz = [0, -0.1, 0] }\n')
    )
    robot = parse_robot(text + second.format(side="left") + 'mirror = "y"\nof = "right_claw"\n')
    assert robot.joint_names == ("right_hip", "right_knee", "left_hip", "left_knee")
    assert robot.limb("left_claw").link == "left_thigh"
    assert as_array(robot.limb("left_claw").frame.p).tolist() == [0, 0.1, 0]


def test_a_mirrored_limb_may_be_declared_before_its_source():
    mirror = '[[limb]]\nname = "left_leg"\nmirror = "y"\nof = "right_leg"\n'
    robot = parse_robot(changed(mirror, "").replace("[[limb]]", f"{mirror}\n[[limb]]"))
    assert [limb.name for limb in robot.limbs] == ["left_leg", "right_leg"]
    assert robot.joint_names == ("right_hip", "right_knee", "left_hip", "left_knee")


def test_a_loop_within_a_limb_is_mirrored_with_it():
    text = MINI + (
        '\n[[closure]]\nname = "right_rod"\nlink_a = "right_shin"\n'
        "frame_a = { xyz = [0.1, -0.1, 0], rpy = [0.3, 0.2, 1] }\n"
        'link_b = "trunk"\nframe_b = { xyz = [0.1, -0.1, 0.2] }\n'
    )
    right, left = parse_robot(text).closures
    assert (left.name, left.link_a, left.link_b) == ("left_rod", "left_shin", "trunk")
    np.testing.assert_allclose(as_array(left.frame_a), M @ as_array(right.frame_a) @ M, atol=1e-16)
    np.testing.assert_allclose(as_array(left.frame_b), M @ as_array(right.frame_b) @ M, atol=1e-16)


@pytest.mark.parametrize(
    ("name", "other"),
    [
        ("right_knee", "left_knee"),
        ("left_knee", "right_knee"),
        ("knee_Right", "knee_Left"),
        ("RIGHT-arm", "LEFT-arm"),
        ("RightFoot", "LeftFoot"),
        ("upright", "upright"),
        ("lefty_frame", "lefty_frame"),
        ("torso", "torso"),
        ("R_knee", "L_knee"),
        ("l_hip_r", "r_hip_r"),
        ("left_l_bolt", "right_l_bolt"),
        ("hip_r", "hip_r"),
        ("Lever", "Lever"),
    ],
)
def test_right_and_left_are_swapped_as_words(name, other):
    assert swapped(name) == other
    assert swapped(other) == name
    assert is_sided(name) == (name != other)


@pytest.mark.parametrize("marks", [("R_", "L_"), ("L_", "R_"), ("r_", "l_")], ids=str)
def test_sides_may_be_letters_before_the_names(marks):
    """The same robot, with names of another manner."""
    own, other = marks
    robot = parse_robot(MINI.replace("right_", own).replace("left_", other))
    for name, renamed in zip(parse_robot(MINI).joint_names, robot.joint_names, strict=True):
        assert renamed == name.replace("right_", own).replace("left_", other)


FAILED = (
    ('of = "right_leg"', 'of = "right_lge"'),
    ('of = "right_leg"', ""),
    ('name = "left_leg"', 'name = "left_lge"'),
    ('name = "left_leg"', 'name = "leg"'),
    ('mirror = "y"', 'mirror = "x"'),
    ('mirror = "y"', ""),
)


@pytest.mark.parametrize(("old", "new"), FAILED)
def test_a_failed_mirror_is_one_fault_and_nothing_echoes_it(old, new):
    """Whatever else names what it was to bring: postures, soles, closures, frames, couplings and servos."""
    more = """
[[frame]]
name = "heel"
link = "left_shin"
pose = { xyz = [0, 0, 0] }

[servos]
ids = { right_hip = 1, right_knee = 2, left_hip = 3, left_knee = 4 }
"""
    assert parse_robot(MINI + more)
    assert len(faults_of(changed(old, new) + more)) == 1
