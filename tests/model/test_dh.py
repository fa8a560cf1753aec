"""DH tables, both conventions, against plain matrix products, textbook arms, and their screws."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
import sympy

from screwkin.algebra.screws import INFINITE, Screw
from screwkin.algebra.se3 import IDENTITY, Pose, Vector, X, Y, Z, as_array, leaves, vector_from_array
from screwkin.errors import InputError, ShapeError, UnknownNameError
from screwkin.kinematics.positions import chain_jacobian, successive_displacement
from screwkin.model.dh import DHRow, DHTable, dh_fk, dh_frames, dh_jacobian, screws_from_dh
from screwkin.model.dh_derive import dh_from_screws, fixed_rows
from screwkin.model.library import robot_names
from screwkin.model.table import load_robot
from tests.model.chains import (
    fk_by_matrices,
    limb_table,
    lines,
    next_axis,
    random_axis,
    random_chain,
    random_pose,
)

CONVENTIONS = ("standard", "modified")
RIGHT = math.pi / 2


def random_table(rng: np.random.Generator, convention: str, joints: int = 6) -> DHTable:
    """Rows of any numbers, right angles and zeros among them."""
    rows = []
    for i in range(joints):
        alpha, offset = rng.choice([0.0, RIGHT, -RIGHT, math.pi, *rng.uniform(-3, 3, 4)], 2)
        a, d = rng.choice([0.0, 1.0, *rng.uniform(-1, 1, 4)], 2)
        kind = "prismatic" if rng.random() < 0.3 else "revolute"
        rows.append(DHRow(f"q{i}", float(alpha), float(a), float(d), float(offset), kind))
    return DHTable(convention, tuple(rows), random_pose(rng), random_pose(rng))


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_forward_kinematics_is_the_product_of_the_four_elementary_transforms_of_every_row(convention):
    rng = np.random.default_rng(1)
    for _ in range(50):
        table = random_table(rng, convention)
        q = rng.uniform(-3, 3, (20, 6))
        np.testing.assert_allclose(
            as_array(dh_fk(table, list(q.T))), fk_by_matrices(table, q), rtol=0, atol=2e-14
        )


def test_a_modified_table_gives_the_textbook_wrist_point_of_the_puma_arm():
    """Craig, Introduction to Robotics, eq. 3.14: position of frame 6."""
    a2, a3, d3, d4 = 0.4318, 0.0203, 0.1501, 0.4331
    numbers = [(0, 0, 0), (-RIGHT, 0, 0), (0, a2, d3), (-RIGHT, a3, d4), (RIGHT, 0, 0), (-RIGHT, 0, 0)]
    rows = tuple(DHRow(f"q{i + 1}", alpha, a, d, 0.0) for i, (alpha, a, d) in enumerate(numbers))
    rng = np.random.default_rng(2)
    q = rng.uniform(-3, 3, (6, 100))
    p = as_array(dh_fk(DHTable("modified", rows), list(q)))[:, :3, 3]
    (c1, c2), (s1, s2) = np.cos(q[:2]), np.sin(q[:2])
    c23, s23 = np.cos(q[1] + q[2]), np.sin(q[1] + q[2])
    reach = a2 * c2 + a3 * c23 - d4 * s23
    expected = [c1 * reach - d3 * s1, s1 * reach + d3 * c1, -a3 * s23 - a2 * s2 - d4 * c23]
    np.testing.assert_allclose(p, np.transpose(expected), rtol=0, atol=1e-15)


def test_a_standard_table_with_a_sliding_joint_gives_the_textbook_tip_of_the_stanford_arm():
    """Spong, Robot Dynamics and Control, example 3.4: position of the tip."""
    d2, d6 = 0.154, 0.263
    numbers = [(-RIGHT, 0), (RIGHT, d2), (0, 0), (-RIGHT, 0), (RIGHT, 0), (0, d6)]
    rows = tuple(
        DHRow(f"q{i + 1}", alpha, 0.0, d, 0.0, "prismatic" if i == 2 else "revolute")
        for i, (alpha, d) in enumerate(numbers)
    )
    q = np.random.default_rng(3).uniform(-3, 3, (6, 100))
    p = as_array(dh_fk(DHTable("standard", rows), list(q)))[:, :3, 3]
    (c1, c2, _, c4, c5, _), (s1, s2, _, s4, s5, _), d3 = np.cos(q), np.sin(q), q[2]
    expected = [
        c1 * s2 * d3 - s1 * d2 + d6 * (c1 * c2 * c4 * s5 + c1 * c5 * s2 - s1 * s4 * s5),
        s1 * s2 * d3 + c1 * d2 + d6 * (c1 * s4 * s5 + c2 * c4 * s1 * s5 + c5 * s1 * s2),
        c2 * d3 + d6 * (c2 * c5 - c4 * s2 * s5),
    ]
    np.testing.assert_allclose(p, np.transpose(expected), rtol=0, atol=2e-15)


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_the_jacobian_is_the_derivative_of_the_forward_kinematics(convention):
    rng, step = np.random.default_rng(4), 1e-6
    for _ in range(20):
        table, q = random_table(rng, convention), rng.uniform(-2, 2, 6)
        J = as_array(dh_jacobian(table, dh_frames(table, list(q))))
        T = fk_by_matrices(table, q)
        for i, column in enumerate(J):
            e = step * np.eye(6)[i]
            rate = (fk_by_matrices(table, q + e) - fk_by_matrices(table, q - e)) / (2 * step)
            spatial = rate @ np.linalg.inv(T)
            turned = [spatial[2, 1], spatial[0, 2], spatial[1, 0], *spatial[:3, 3]]
            np.testing.assert_allclose(column, turned, rtol=0, atol=1e-8)


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_a_table_moves_its_tip_as_its_screws_do(convention):
    rng = np.random.default_rng(5)
    for _ in range(50):
        table, q = random_table(rng, convention), list(rng.uniform(-3, 3, (6, 10)))
        screws, tool = screws_from_dh(table)
        moved = as_array(successive_displacement(screws, q, A_ref_k=tool))
        np.testing.assert_allclose(moved, as_array(dh_fk(table, q)), rtol=0, atol=3e-14)


def test_a_thousand_random_chains_keep_their_lines_from_screws_to_tables_and_back():
    """Seven positions of successive axes, sliding joints, both conventions; d grows with 1 / sin(alpha)."""
    rng, seen = np.random.default_rng(6), set()
    for _ in range(1000):
        screws, tool, positions = random_chain(rng, int(rng.integers(1, 8)))
        seen |= set(pairwise(positions))
        for convention in CONVENTIONS:
            table = dh_from_screws(screws, tool, convention)
            back, tip = screws_from_dh(table)
            assert [s.is_translation for s in back] == [s.is_translation for s in screws]
            size = max(1.0, *(abs(row.d) for row in table.rows), *(abs(c) for c in table.tool.p))
            np.testing.assert_allclose(lines(back), lines(screws), rtol=0, atol=1e-13 * size)
            np.testing.assert_allclose(as_array(tip), as_array(tool), rtol=0, atol=1e-13 * size)
    assert len(seen) == 49


def test_the_derived_tables_of_random_chains_move_their_tips_as_the_screws_do():
    rng = np.random.default_rng(7)
    for _ in range(100):
        screws, tool, _ = random_chain(rng, 6)
        q = rng.uniform(-3, 3, (20, 6))
        expected = as_array(successive_displacement(screws, list(q.T), A_ref_k=tool))
        for convention in CONVENTIONS:
            table = dh_from_screws(screws, tool, convention)
            size = max(1.0, *(abs(row.d) for row in table.rows))
            np.testing.assert_allclose(fk_by_matrices(table, q), expected, rtol=0, atol=1e-13 * size)


@pytest.mark.parametrize("name", [name for name in robot_names() if load_robot(name).limbs])
def test_every_bundled_limb_keeps_its_lines_and_motion(name):
    robot, rng = load_robot(name), np.random.default_rng(8)
    for limb in robot.limbs:
        joints = [robot.joints[i] for i in robot.path_to(limb.link)]
        screws = [joint.screw for joint in joints]
        q = rng.uniform(-3, 3, (1000, len(screws)))
        moved = as_array(successive_displacement(screws, list(q.T), A_ref_k=limb.frame))
        J = np.array([as_array(column, (1000,)) for column in chain_jacobian(screws, list(q.T))])
        for convention in CONVENTIONS:
            table = limb_table(robot, limb.name, convention)
            back, tip = screws_from_dh(table)
            assert table.joint_names == tuple(joint.name for joint in joints)
            assert (table.name, table.tip) == (limb.name, limb.tip)
            np.testing.assert_allclose(lines(back), lines(screws), rtol=0, atol=1e-15)
            np.testing.assert_allclose(as_array(tip), as_array(limb.frame), rtol=0, atol=1e-15)
            np.testing.assert_allclose(fk_by_matrices(table, q), moved, rtol=0, atol=1e-14)
            columns = dh_jacobian(table, dh_frames(table, list(q.T)))
            np.testing.assert_allclose([as_array(c, (1000,)) for c in columns], J, rtol=0, atol=1e-14)


def pair(position: str, seed: int, base: Pose = IDENTITY) -> tuple[DHTable, list[Screw]]:
    """Table of two joints in a position, behind a first one in general position."""
    rng = np.random.default_rng(seed)
    first = (random_axis(rng), rng.uniform(-1, 1, 3))
    second = next_axis(rng, *first, "skew")
    third = next_axis(rng, *second, position)
    screws = [Screw(vector_from_array(s), vector_from_array(p)) for s, p in (first, second, third)]
    return dh_from_screws(screws), screws


@pytest.mark.parametrize("seed", range(20))
def test_special_positions_of_axes_have_their_rules(seed):
    """Rows of a modified table: alpha and a lead to the joint's axis, d of the row before goes along it."""
    table, _ = pair("skew", seed)
    assert table.rows[2].a > 0
    table, screws = pair("intersecting", seed)
    assert table.rows[2].a == 0
    frames = dh_frames(table, [0, 0, 0])
    across = np.cross(as_array(screws[1].s), as_array(screws[2].s))
    np.testing.assert_allclose(as_array(frames[2].R.x), across / np.linalg.norm(across), atol=1e-12)
    table, _ = pair("parallel", seed)
    assert table.rows[1].d == 0
    assert table.rows[2].a > 0
    assert table.rows[2].alpha == 0
    table, _ = pair("antiparallel", seed)
    assert table.rows[1].d == 0
    assert table.rows[2].alpha == math.pi
    table, _ = pair("coincident", seed)
    row = table.rows[2]
    assert (row.a, row.alpha, table.rows[1].offset, table.rows[1].d) == (0, 0, 0, 0)


def test_equal_lines_told_by_other_points_give_the_same_table():
    rng = np.random.default_rng(9)
    for _ in range(50):
        screws, tool, _ = random_chain(rng, 6)
        slid = [Screw(x.s, x.s0 + x.s * float(rng.uniform(-1, 1)), x.pitch) for x in screws]
        for a, b in zip(dh_from_screws(screws, tool).rows, dh_from_screws(slid, tool).rows, strict=True):
            numbers = [(r.alpha, r.a, r.d, r.offset) for r in (a, b)]
            np.testing.assert_allclose(numbers[0], numbers[1], rtol=0, atol=1e-11)


def test_a_table_in_right_angles_gives_screws_in_whole_numbers():
    rows = (DHRow("q1", RIGHT, 0.0, 0.0, RIGHT), DHRow("q2", -RIGHT, 1.0, 2.0, math.pi))
    for convention in CONVENTIONS:
        screws, tool = screws_from_dh(DHTable(convention, rows))
        assert all(x in (-1, 0, 1) for screw in screws for x in screw.s)
        assert all(float(x) == round(x) for x in leaves(tool))


def test_a_chain_without_joints_is_its_tool():
    tool = random_pose(np.random.default_rng(10))
    for convention in CONVENTIONS:
        table = dh_from_screws([], tool, convention)
        np.testing.assert_allclose(as_array(dh_fk(table, [])), as_array(tool), rtol=0, atol=1e-15)


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_a_constant_transform_is_at_most_two_rows(convention):
    rng = np.random.default_rng(11)
    turned = dh_fk(DHTable("standard", (DHRow("q", 0, 0, 0.3, 1.0),)), [0])
    for pose in [IDENTITY, turned, Pose(IDENTITY.R, Vector(1, 2, 3)), *(random_pose(rng) for _ in range(50))]:
        rows = tuple(fixed_rows(pose, "fixed", convention))
        assert len(rows) <= (0 if pose is IDENTITY else 2)
        again = fk_by_matrices(DHTable(convention, rows), np.zeros(len(rows)))
        np.testing.assert_allclose(again, as_array(pose), rtol=0, atol=2e-14)


def test_one_formula_serves_floats_batches_and_symbols():
    table = limb_table(load_robot("poppy12"), "left_leg", "standard")
    q = np.random.default_rng(12).uniform(-2, 2, (5, 6))
    symbols = sympy.symbols("q1:7", real=True)
    symbolic = sympy.lambdify(symbols, sympy.Matrix(as_array(dh_fk(table, symbols)).tolist()))
    batch = as_array(dh_fk(table, list(q.T)))
    for values, expected in zip(q, batch, strict=True):
        np.testing.assert_allclose(as_array(dh_fk(table, values.tolist())), expected, rtol=0, atol=1e-15)
        np.testing.assert_allclose(symbolic(*values), expected, rtol=0, atol=1e-15)


def test_joints_that_no_table_can_describe_are_refused_by_name():
    good = Screw(Z, Vector(0, 0, 0))
    with pytest.raises(InputError, match=r"joint 'lead' is helical \(pitch 0.01 m/rad\)"):
        dh_from_screws([good, Screw(X, Vector(0, 0, 0), 0.01)], names=["turn", "lead"])
    with pytest.raises(InputError, match="joint 'q1': holds nan"):
        dh_from_screws([Screw(X, Vector(0, math.nan, 0))])
    with pytest.raises(InputError, match=r"joint 'q2': axis \(0, 1, 1\) has norm 1.414213562, expected 1"):
        dh_from_screws([good, Screw(Vector(0, 1, 1), Vector(0, 0, 0))])
    with pytest.raises(InputError, match="joint 'q1': y is no number"):
        dh_from_screws([Screw(X, Vector(0, sympy.Symbol("y"), 0))])
    with pytest.raises(InputError, match="tool: holds inf"):
        dh_from_screws([good], Pose(IDENTITY.R, Vector(0, 0, math.inf)))
    with pytest.raises(InputError, match="1 screws, but 2 names"):
        dh_from_screws([good], names=["a", "b"])
    with pytest.raises(UnknownNameError, match="unknown convention 'craig'; valid: standard, modified"):
        dh_from_screws([good], convention="craig")


def test_positions_must_be_as_many_as_joints():
    table = dh_from_screws([Screw(Z, Vector(0, 0, 0)), Screw(Y, Vector(0, 0, 1), INFINITE)])
    with pytest.raises(ShapeError, match="has 2 joints, but q holds 3 values"):
        dh_fk(table, [0, 0, 0])
