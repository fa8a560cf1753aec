"""A sound table is read as it stands: order, defaults, structure, frames, inertias, closures, postures."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from screwkin.algebra.se3 import Vector, as_array, leaves
from screwkin.model.robot import Closure, Posture
from screwkin.model.table import load_robot, parse_robot
from tests.model.tables import FOURBAR, MINI, changed, matrix_of


def test_rows_come_out_in_table_order_and_mirrored_ones_after_their_limb():
    robot = parse_robot(MINI)
    assert robot.link_names == ("trunk", "right_thigh", "right_shin", "left_thigh", "left_shin")
    assert robot.joint_names == ("right_hip", "right_knee", "left_hip", "left_knee")
    assert [limb.name for limb in robot.limbs] == ["right_leg", "left_leg"]
    assert robot.tip_names == ("right_foot", "left_foot")
    assert [sole.limb for sole in robot.soles] == ["right_leg", "left_leg"]
    assert robot.base_link == "trunk"
    assert robot.mass == 3.0


def test_the_text_and_the_path_are_kept_exactly(tmp_path):
    path = tmp_path / "mini.toml"
    text = MINI.replace("\n", "\r\n") + "# ende ä\n"
    path.write_bytes(text.encode())
    robot = load_robot(path)
    assert robot.text == text
    assert robot.path == str(path)
    assert load_robot(str(path)).joint_names == robot.joint_names


def test_a_byte_order_mark_before_the_text_is_no_fault(tmp_path):
    path = tmp_path / "mini.toml"
    path.write_bytes(MINI.encode("utf-8-sig"))
    assert load_robot(path).name == "mini"


def test_parsing_is_deterministic():
    first, second = parse_robot(MINI), parse_robot(MINI)
    assert repr(first) == repr(second)


def test_exact_zeros_and_ones_are_structure_and_other_numbers_are_floats():
    hip = parse_robot(MINI).joint("right_hip").screw
    assert [type(c) for c in leaves(hip)] == [int, int, int, int, float, int, int]
    tilted = parse_robot(changed("s = [0, 1, 0]", 's = ["1 - 1", "cos(0)", "0*thigh"]'))
    assert leaves(tilted.joint("right_hip").screw.s) == [0, 1, 0]
    assert {type(c) for c in leaves(tilted.joint("right_hip").screw.s)} == {int}


def test_a_link_frame_is_at_its_joint_parallel_to_the_base_unless_given():
    robot = parse_robot(
        changed("mass = 2", 'mass = 2\nframe = { xyz = [1, 2, 3], rpy = ["30*deg", 0.2, -2.0] }')
    )
    np.testing.assert_array_equal(as_array(robot.link("right_shin").frame)[:3, :3], np.eye(3))
    np.testing.assert_array_equal(as_array(robot.link("right_shin").frame.p), [0, -0.05, -0.1])
    T = as_array(robot.link("trunk").frame)
    np.testing.assert_allclose(T[:3, :3], Rotation.from_euler("xyz", [math.pi / 6, 0.2, -2.0]).as_matrix())
    np.testing.assert_array_equal(T[:3, 3], [1, 2, 3])
    assert leaves(parse_robot(MINI).link("trunk").frame.p) == [0, 0, 0]


def test_a_box_inertia_is_that_of_a_solid_box():
    """Integrating (r.r 1 - r r^T) over a grid of equal point masses, by midpoints, which is O(1/n^2) off."""
    robot = parse_robot(MINI)
    n = 60
    grid = (np.arange(n) + 0.5) / n - 0.5
    points = np.stack(np.meshgrid(0.1 * grid, 0.2 * grid, 0.3 * grid), axis=-1).reshape(-1, 3)
    second = points.T @ points * (2 / n**3)
    expected = np.trace(second) * np.eye(3) - second
    np.testing.assert_allclose(matrix_of(robot.link("trunk").inertia), expected, rtol=1e-3, atol=1e-12)


def test_a_massless_link_needs_neither_com_nor_inertia():
    shin = parse_robot(MINI).link("right_shin")
    assert shin.mass == 0
    assert leaves(shin.com) == leaves(shin.frame.p)
    assert not matrix_of(shin.inertia).any()


def test_inertia_without_mass_is_allowed():
    text = changed(
        'name = "right_shin"\nmass = 0', 'name = "right_shin"\nmass = 0\ninertia = { xx = 1, yy = 1, zz = 1 }'
    )
    assert parse_robot(text).link("right_shin").inertia.xx == 1


def test_limits_left_out_are_none():
    joint = parse_robot(FOURBAR).joint("input")
    assert (joint.lower, joint.upper, joint.velocity, joint.effort) == (-math.inf,) + (math.inf,) * 3


def test_a_mechanism_without_limbs_keeps_its_closure():
    robot = parse_robot(FOURBAR)
    (closure,) = robot.closures
    assert isinstance(closure, Closure)
    assert (closure.link_a, closure.link_b) == ("coupler", "ground")
    np.testing.assert_allclose(
        as_array(closure.frame_a), [[0, -1, 0, 2], [1, 0, 0, 1], [0, 0, 1, 0], [0, 0, 0, 1]], atol=1e-15
    )
    assert robot.base == "fixed"
    assert robot.limbs == robot.soles == robot.postures == ()


def test_a_virtual_chain_is_the_whole_one_unless_the_limb_lists_its_own():
    whole = ("px", "py", "pz", "rx", "ry", "rz")
    assert [limb.chain for limb in parse_robot(MINI).limbs] == [whole, whole]
    text = changed('tip = "right_foot"', 'tip = "right_foot"\nchain = ["px", "pz", "ry"]')
    assert [limb.chain for limb in parse_robot(text).limbs] == [("px", "pz", "ry")] * 2


def test_joint_kinds_become_pitches():
    helical = changed(
        'child = "right_thigh"\ntype = "revolute"', 'child = "right_thigh"\ntype = "helical"\npitch = "2*mm"'
    )
    assert parse_robot(helical).joint("right_hip").screw.pitch == pytest.approx(0.002)
    prismatic = changed(
        'child = "right_thigh"\ntype = "revolute"', 'child = "right_thigh"\ntype = "prismatic"'
    )
    assert parse_robot(prismatic).joint("right_hip").screw.is_translation
    assert parse_robot(MINI).joint("right_hip").screw.pitch == 0


def test_postures_are_evaluated_and_joints_left_out_stand_at_zero():
    text = changed("q = { right_hip = 0.5, left_hip = 0.5 }", 'q = { left_knee = "atan(thigh)" }')
    assert parse_robot(text).posture("home") == Posture("home", 0.2, (0.0, 0.0, 0.0, math.atan(0.1)))


def test_servos_are_kept_as_they_are():
    text = MINI + '\n[servos]\nmodel = "ax-12"\nzero = { right_knee = 0.25 }\nstiffness = 30\n'
    assert parse_robot(text).servos == {"model": "ax-12", "zero": {"right_knee": 0.25}, "stiffness": 30}


def test_parameters_are_kept_with_their_values():
    assert dict(parse_robot(MINI).parameters) == {"thigh": 0.1}


def test_a_table_may_declare_links_and_joints_in_any_order():
    head, *rows = MINI.split("\n[[")
    shuffled = "\n[[".join([head, *reversed(rows)])
    robot = parse_robot(shuffled)
    assert set(robot.link_names) == set(parse_robot(MINI).link_names)
    assert leaves(robot.joint("left_knee").screw.s0) == leaves(parse_robot(MINI).joint("left_knee").screw.s0)


def test_points_of_the_sole_are_vectors_in_order():
    sole = parse_robot(MINI).soles[0]
    assert all(isinstance(corner, Vector) for corner in sole.corners)
    np.testing.assert_allclose(as_array(sole.corners)[0], [0.1, -0.09, -0.2])
