"""Screws: helical displacement, transport of twists and wrenches, reciprocity; every kind of pitch."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.linalg
from hypothesis import assume, given
from hypothesis import strategies as st

from screwkin.algebra import se3
from screwkin.algebra.screws import (
    AT_REST,
    INFINITE,
    Screw,
    Wrench,
    advance,
    at,
    carry,
    displacement,
    power,
    reciprocal_product,
    screw_from_twist,
    transport,
    transport_wrench,
    turn,
    wrench_at,
)
from screwkin.algebra.se3 import Pose, Twist, Vector, as_array, cross, dot
from screwkin.errors import InputError
from tests.strategies import (
    angles,
    assert_close,
    numbers,
    numbers_of,
    poses,
    screws,
    twists,
    unit_vectors,
    vectors,
    wrenches,
)

ORIGIN = se3.ZERO
turning_screws = screws.filter(lambda screw: not screw.is_translation)


def adjoint(pose: Pose) -> np.ndarray:
    """The 6 x 6 adjoint matrix for [omega; v], written out once more and independently."""
    T = as_array(pose)
    R, (x, y, z) = T[:3, :3], T[:3, 3]
    P = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.block([[R, np.zeros((3, 3))], [P @ R, R]])


# --- normalised screws ---


def test_a_revolute_screw_is_s_and_its_moment():
    """[s; s0 x s]: turning about z through (1, 0, 0) the origin moves along -y."""
    twist = Screw(se3.Z, Vector(1, 0, 0)).twist
    assert numbers_of(twist) == [0, 0, 1, 0, -1, 0]
    assert numbers_of(at(Vector(1, 0, 0), twist).v) == [0, 0, 0]


def test_pitch_advances_along_the_axis_and_infinite_pitch_only_translates():
    assert numbers_of(Screw(se3.X, ORIGIN, 0.25).twist) == [1, 0, 0, 0.25, 0, 0]
    prismatic = Screw(se3.X, Vector(5.0, 6.0, 7.0), INFINITE)
    assert prismatic.is_translation
    assert numbers_of(prismatic.twist) == [0, 0, 0, 1, 0, 0]
    assert not Screw(se3.X, ORIGIN).is_translation
    assert not Screw(se3.X, ORIGIN, 1e300).is_translation


@given(screws)
def test_the_moment_of_a_screw_does_not_depend_on_the_point_of_its_axis(screw):
    slid = Screw(screw.s, screw.s0 + screw.s * 2.7, screw.pitch)
    assert_close(slid.twist, screw.twist)


# --- displacement ---


@given(screws, angles)
def test_a_displacement_is_the_exponential_of_its_screw(screw, theta):
    T = displacement(screw, theta)
    (x, y, z), (a, b, c) = screw.twist.omega, screw.twist.v
    hat = np.array([[0, -z, y, a], [z, 0, -x, b], [-y, x, 0, c], [0, 0, 0, 0]], float)
    assert_close(T, scipy.linalg.expm(hat * theta), 2e-14)
    assert_close(T, se3.exp(screw.twist * theta), 2e-14)


@given(turning_screws, angles, numbers)
def test_helical_motion_slides_its_axis_along_itself(screw, theta, along):
    """Points of the axis move by pitch * theta along s, and in no other direction."""
    T = displacement(screw, theta)
    point = screw.s0 + screw.s * along
    assert_close(T @ point, point + screw.s * (screw.pitch * theta))
    assert_close(T.R @ screw.s, screw.s)


@given(unit_vectors, vectors, numbers)
def test_a_prismatic_displacement_translates_every_point_by_the_distance(s, point, distance):
    T = displacement(Screw(s, Vector(9.0, 9.0, 9.0), INFINITE), distance)
    assert_close(T @ point, point + s * distance)
    assert_close(T.R, np.eye(3), 0)


@given(screws, numbers, numbers)
def test_displacements_about_one_screw_add_and_commute(screw, a, b):
    assert_close(displacement(screw, a) @ displacement(screw, b), displacement(screw, a + b))
    assert_close(displacement(screw, -a), displacement(screw, a).inverse)


@given(screws)
def test_no_displacement_is_the_identity_and_structural_zero_keeps_its_structure(screw):
    assert_close(displacement(screw, 0.0), np.eye(4), 1e-15)
    assert all(type(x) is int for x in se3.leaves(displacement(Screw(se3.Y, Vector(0, 0, 1)), 0)))


@given(st.lists(st.tuples(screws, angles), min_size=1, max_size=5))
def test_advancing_from_axis_to_axis_is_the_product_of_displacements(chain):
    """Whatever axes are skew, parallel or aligned; as a pose, for points, axes and back."""
    step, product = AT_REST, se3.IDENTITY
    for screw, theta in chain:
        assert_close(carry(step, screw).twist, carry(product, screw).twist, 1e-13)
        step, product = advance(step, screw, theta), product @ displacement(screw, theta)
    assert_close(step @ se3.IDENTITY, product, 1e-13)
    assert_close(step.R, product.R, 1e-13)
    assert_close(step.inverse @ se3.IDENTITY, product.inverse, 1e-13)


def test_a_displacement_far_from_the_origin_loses_no_more_than_rounding():
    T = displacement(Screw(se3.Z, Vector(50.0, -50.0, 0.0)), 0.7)
    assert_close(T @ Vector(50.0, -50.0, 0.3), Vector(50.0, -50.0, 0.3), 1e-15)


@given(poses, screws, angles)
def test_displacing_about_a_carried_screw_is_conjugation(pose, screw, theta):
    """The root of successive screws: D(T screw) = T D(screw) T^-1."""
    assert_close(
        displacement(carry(pose, screw), theta), pose @ displacement(screw, theta) @ pose.inverse, 1e-13
    )


@given(poses, screws)
def test_carrying_a_screw_transports_its_twist(pose, screw):
    assert_close(carry(pose, screw).twist, transport(pose, screw.twist), 1e-13)


# --- transport ---


@given(poses, poses, twists, wrenches)
def test_transport_is_a_group_action_on_twists_and_wrenches(a, b, twist, wrench):
    assert_close(transport(a @ b, twist), transport(a, transport(b, twist)), 1e-13)
    assert_close(transport(se3.IDENTITY, twist), twist, 0)
    assert_close(transport(a.inverse, transport(a, twist)), twist, 1e-13)
    assert_close(transport_wrench(a @ b, wrench), transport_wrench(a, transport_wrench(b, wrench)), 1e-13)
    assert_close(transport_wrench(a.inverse, transport_wrench(a, wrench)), wrench, 1e-13)


@given(poses, twists, wrenches)
def test_transport_is_the_adjoint_and_for_wrenches_its_inverse_transpose(pose, twist, wrench):
    Ad = adjoint(pose)
    assert_close(transport(pose, twist), Ad @ as_array(twist))
    assert_close(transport_wrench(pose, wrench), np.linalg.inv(Ad).T @ as_array(wrench), 1e-13)


@given(poses, twists)
def test_transport_conjugates_the_exponential(pose, twist):
    assert_close(se3.exp(transport(pose, twist)), pose @ se3.exp(twist) @ pose.inverse, 1e-13)


@given(poses, twists, twists)
def test_transport_respects_the_bracket(pose, a, b):
    moved = se3.bracket(transport(pose, a), transport(pose, b))
    assert_close(moved, transport(pose, se3.bracket(a, b)), 1e-12)


@given(poses, twists, wrenches, twists, vectors)
def test_power_and_reciprocal_product_do_not_depend_on_the_frame_or_the_point(
    pose, twist, wrench, other, point
):
    assert_close(power(transport_wrench(pose, wrench), transport(pose, twist)), power(wrench, twist), 1e-12)
    assert_close(power(wrench_at(point, wrench), at(point, twist)), power(wrench, twist), 1e-12)
    product = reciprocal_product(twist, other)
    assert_close(reciprocal_product(transport(pose, twist), transport(pose, other)), product, 1e-12)
    assert_close(reciprocal_product(at(point, twist), at(point, other)), product, 1e-12)
    assert_close(reciprocal_product(other, twist), product)


@given(wrenches, twists)
def test_power_is_the_plain_product_of_the_arrays_when_both_are_told_alike(wrench, twist):
    """[m; f] @ [omega; v]: the orders of the two conventions belong together."""
    assert_close(power(wrench, twist), as_array(wrench) @ as_array(twist))


@given(twists, vectors, vectors)
def test_the_twist_at_a_point_is_how_the_body_moves_there(twist, p, q):
    assert_close(at(p, twist).v, twist.v + cross(twist.omega, p), 0)
    assert_close(at(q - p, at(p, twist)), at(q, twist))
    assert_close(at(p, twist), transport(Pose(se3.UNTURNED, -p), twist))
    small = 1e-7
    moved = se3.exp(twist * small) @ p
    assert_close((moved - p) * (1 / small), at(p, twist).v, 1e-4)


@given(wrenches, vectors, vectors)
def test_the_wrench_at_a_point_is_the_same_load(wrench, p, q):
    assert_close(wrench_at(q - p, wrench_at(p, wrench)), wrench_at(q, wrench))
    assert_close(wrench_at(p, wrench), transport_wrench(Pose(se3.UNTURNED, -p), wrench))


def test_a_force_has_no_moment_about_its_own_line():
    push = Wrench(cross(Vector(0.0, 2.0, 0.0), se3.Z), se3.Z)
    assert numbers_of(wrench_at(Vector(0.0, 2.0, 5.0), push).m) == [0, 0, 0]
    assert numbers_of(push.m) == [2, 0, 0]


@given(poses, twists)
def test_turning_the_axes_is_transport_without_translation(pose, twist):
    assert_close(turn(pose.R, twist), transport(Pose(pose.R, ORIGIN), twist), 0)


# --- reciprocity ---


@given(unit_vectors, vectors, numbers, vectors)
def test_a_force_through_a_revolute_axis_or_parallel_to_it_does_no_work_on_it(s, s0, along, force):
    hinge = Screw(s, s0).twist
    point = s0 + s * along
    through = Wrench(cross(point, force), force)
    assert power(through, hinge) == pytest.approx(0, abs=1e-13)
    parallel = Wrench(cross(Vector(3.0, 1.0, 2.0), s), s)
    assert power(parallel, hinge) == pytest.approx(0, abs=1e-13)


@given(screws, screws)
def test_the_reciprocal_product_of_two_lines_is_sum_of_pitches_times_cosine_less_distance_times_sine(a, b):
    """Ball's formula (h1 + h2) cos(alpha) - d sin(alpha), with d sin(alpha) = (p2 - p1) . (s1 x s2)."""
    assume(not a.is_translation)
    if b.is_translation:
        expected = dot(a.s, b.s)
    else:
        expected = (a.pitch + b.pitch) * dot(a.s, b.s) - dot(b.s0 - a.s0, cross(a.s, b.s))
    assert reciprocal_product(a.twist, b.twist) == pytest.approx(expected, abs=1e-13)


def test_two_translations_are_always_reciprocal_and_a_screw_is_to_itself_without_pitch():
    x, y = Screw(se3.X, ORIGIN, INFINITE).twist, Screw(se3.Y, ORIGIN, INFINITE).twist
    assert reciprocal_product(x, y) == 0 == reciprocal_product(x, x)
    hinge = Screw(se3.Z, Vector(1.0, 2.0, 3.0)).twist
    assert reciprocal_product(hinge, hinge) == 0
    nut = Screw(se3.Z, ORIGIN, 0.5).twist
    assert reciprocal_product(nut, nut) == 1.0


# --- screw of a twist ---


@given(turning_screws, st.floats(0.01, 10.0))
def test_a_turning_twist_gives_back_its_axis_pitch_and_rate(screw, rate):
    found, magnitude = screw_from_twist(screw.twist * rate)
    assert magnitude == pytest.approx(rate)
    assert found.pitch == pytest.approx(screw.pitch, abs=1e-13)
    assert_close(found.s, screw.s)
    assert_close(cross(found.s0 - screw.s0, screw.s), [0, 0, 0], 1e-13)
    assert dot(found.s0, found.s) == pytest.approx(0, abs=1e-13)  # the point nearest to the origin
    assert_close(found.twist * magnitude, screw.twist * rate, 1e-13)


def test_a_twist_that_does_not_turn_has_infinite_pitch():
    screw, speed = screw_from_twist(Twist(ORIGIN, Vector(0.0, 3.0, -4.0)))
    assert (screw.pitch, speed) == (INFINITE, 5.0)
    assert_close(screw.twist * speed, [0, 0, 0, 0, 3, -4])
    assert screw_from_twist(Twist(Vector(0.0, 0.0, 0.0), se3.X))[0].is_translation


def test_a_zero_twist_has_no_axis():
    with pytest.raises(InputError, match="zero twist has no screw axis"):
        screw_from_twist(se3.NO_TWIST)


def test_a_batch_of_twists_gives_a_batch_of_screws():
    rng = np.random.default_rng(3)
    array = rng.normal(size=(40, 6))
    screw, rate = screw_from_twist(se3.twist_from_array(array))
    np.testing.assert_allclose(as_array(screw.twist * rate), array, atol=1e-13)
    np.testing.assert_allclose(rate, np.linalg.norm(array[:, :3], axis=1))


# --- wrenches ---


@given(wrenches, wrenches, numbers)
def test_wrenches_form_a_vector_space(a, b, factor):
    x, y = as_array(a), as_array(b)
    assert_close(a + b, x + y)
    assert_close(a - b, x - y)
    assert_close(-a, -x)
    assert_close(a * factor, x * factor)
    assert_close(factor * a, x * factor)


def test_a_full_turn_of_a_nut_advances_it_by_one_lead():
    lead = 0.002
    T = displacement(Screw(se3.Z, Vector(0.1, 0.2, 0.0), lead / (2 * math.pi)), 2 * math.pi)
    assert_close(T, Pose(se3.UNTURNED, Vector(0, 0, lead)), 1e-15)
