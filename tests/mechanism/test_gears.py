"""Gears, belts and differentials: exact over whole turns, rolling without slip, torques by hand."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import screwkin as sk

teeth = st.integers(9, 60)
MODULE = 0.002


def table(*joints: tuple[str, str, str, tuple[float, float, float], float, str], closure: str = "") -> str:
    """Rows (joint, parent, child, s, x of s0, leader and ratio) on a ground, all through y = z = 0."""
    links = dict.fromkeys(["ground", *(child for _, _, child, *_ in joints)])
    text = '[robot]\nname = "gears"\nbase_link = "ground"\nbase = "fixed"\n'
    text += "".join(f'[[link]]\nname = "{link}"\nmass = 0\n' for link in links)
    for name, parent, child, s, x, mimic in joints:
        text += f'[[joint]]\nname = "{name}"\nparent = "{parent}"\nchild = "{child}"\ntype = "revolute"\n'
        text += f"s = {list(s)}\ns0 = [{x}, 0, 0]\n{mimic}\n"
    return text + closure


def follows(leader: str, ratio: float) -> str:
    return f'mimic = {{ joint = "{leader}", ratio = {ratio!r} }}'


Z = (0, 0, 1)
HELD = """
[[closure]]
name = "housing"
link_a = "ring"
frame_a = { xyz = [0, 0, 0] }
link_b = "ground"
frame_b = { xyz = [0, 0, 0] }
"""


@cache
def planetary(sun: int, planet: int, held: bool = False) -> sk.Robot:
    """Sun, planet and ring as their carrier sees them: an ordinary gear train, whose first wheel leads."""
    ring = sun + 2 * planet
    return sk.robot_from_text(
        table(
            ("carrier", "ground", "arm", Z, 0.0, ""),
            ("sun_on_arm", "arm", "sun", Z, 0.0, ""),
            (
                "planet_on_arm",
                "arm",
                "planet",
                Z,
                MODULE * (sun + planet) / 2,
                follows("sun_on_arm", -sun / planet),
            ),
            ("ring_on_arm", "arm", "ring", Z, 0.0, follows("planet_on_arm", planet / ring)),
            closure=HELD if held else "",
        )
    )


def turns(*links: str) -> list[sk.VirtualChain]:
    """How far links have turned on the ground: chains of one rotation."""
    return [sk.VirtualChain(f"{link}_turn", ("rz",), link) for link in links]


@given(sun=teeth, planet=teeth)
@settings(max_examples=3, deadline=None)
def test_a_planetary_gear_has_the_ratio_of_willis_over_whole_turns(sun, planet):
    """The ring is held by a chain: one turn of the sun turns the arm by sun / (sun + ring) of it."""
    robot, ring = planetary(sun, planet), sun + 2 * planet
    mechanism = sk.closed_mechanism(robot, ["sun_turn.rz", "ring_turn.rz"], turns("sun", "ring"))
    assert mechanism.mobility == 2
    state = sk.State(np.eye(4), np.zeros(2))
    arm, sun_rate = sk.secondary_rates(mechanism, state, [1.0, 0.0])
    assert arm == pytest.approx(sun / (sun + ring), rel=1e-13)
    assert arm + sun_rate == pytest.approx(1, rel=1e-13)
    for angle in np.linspace(0, 2 * np.pi, 13)[1:]:
        closed = sk.close_loops(mechanism, state, {"sun_turn.rz": angle, "ring_turn.rz": 0.0})
        assert not closed.status
        state = closed.state
    assert state.q[0] == pytest.approx(2 * np.pi * sun / (sun + ring), abs=1e-11)
    assert state.q.sum() == pytest.approx(2 * np.pi, abs=1e-11)


@given(sun=teeth, planet=teeth, rates=st.tuples(st.floats(-3, 3), st.floats(-3, 3)))
@settings(max_examples=3, deadline=None)
def test_wheels_roll_on_one_another_without_slip(sun, planet, rates):
    """At the pitch points both wheels move alike: each meshes by a screw through the pitch point."""
    robot = planetary(sun, planet)
    state = sk.State(np.eye(4), np.array([0.4, -0.9]))
    along = sk.frame_pose(robot, state, "arm")[:3, :3] @ [1, 0, 0]

    def velocity(link: str, radius: float) -> np.ndarray:
        twist = sk.jacobian(robot, state, link)[:, 6:] @ rates
        lever = MODULE * radius * along - sk.frame_pose(robot, state, link)[:3, 3]
        return np.array(twist[3:] + np.cross(twist[:3], lever))

    scale = MODULE * 200
    for wheels, radius in ((("sun", "planet"), sun / 2), (("planet", "ring"), sun / 2 + planet)):
        a, b = (velocity(link, radius) for link in wheels)
        np.testing.assert_allclose(a, b, atol=1e-13 * scale * 100)


@given(sun=teeth, planet=teeth, torque=st.floats(0.1, 5))
@settings(max_examples=3, deadline=None)
def test_torques_in_a_planetary_gear_are_those_by_hand(sun, planet, torque):
    """A torque on the sun: T / r_sun on the teeth at both sides of the planet, twice that on its pin."""
    robot, ring = planetary(sun, planet, held=True), sun + 2 * planet
    mechanism = sk.closed_mechanism(robot)
    assert mechanism.mobility == 1
    state = sk.State(np.eye(4), np.zeros(2))
    forces = sk.static_forces(
        mechanism, state, {"sun": [0, 0, torque, 0, 0, 0]}, active=["carrier"], contacts=["housing"]
    )
    tooth = torque / (MODULE * sun / 2)
    on_arm = 2 * tooth * MODULE * (sun + planet) / 2
    on_ring = tooth * MODULE * ring / 2
    assert forces["carrier"] == pytest.approx(-on_arm, rel=1e-12)
    assert on_arm == pytest.approx(torque * (1 + ring / sun), rel=1e-12)
    assert abs(forces["housing.mz"]) == pytest.approx(on_ring, rel=1e-12)
    assert abs(forces["ring_on_arm"]) == pytest.approx(on_ring, rel=1e-12)
    assert forces["planet_on_arm"] == pytest.approx(0, abs=1e-12 * on_ring)


@pytest.mark.parametrize("ratio", [-20 / 31, -3.0, 0.25, 12 / 5])
def test_a_gear_pair_or_a_belt_transmits_exactly(ratio):
    """Negative: gears; positive: a belt. The wheel carries its load, the pinion the ratio of it."""
    robot = sk.robot_from_text(
        table(
            ("pinion", "ground", "a", Z, 0.0, ""), ("wheel", "ground", "b", Z, 0.1, follows("pinion", ratio))
        )
    )
    shaft = np.eye(4)
    shaft[0, 3] = 0.1
    turn = sk.VirtualChain("b_turn", ("rz",), "b", start_frame=shaft)
    mechanism = sk.closed_mechanism(robot, ["pinion"], [turn])
    assert (mechanism.mobility, mechanism.kutzbach) == (1, -4)
    state = sk.State(np.eye(4), np.linspace(0, 2 * np.pi, 25)[:, None])
    np.testing.assert_allclose(sk.secondary_rates(mechanism, state, np.ones(1))[:, 0], ratio, rtol=1e-14)
    D = sk.frame_pose(robot, state, "b")
    np.testing.assert_allclose(D[:, 0, 0], np.cos(ratio * state.q[:, 0]), atol=1e-14)
    plain = sk.closed_mechanism(robot)
    forces = sk.static_forces(plain, sk.State(np.eye(4), np.zeros(1)), {"b": [0, 0, 1.0, 0, 0, 0]})
    assert forces["pinion"] == pytest.approx(-ratio)
    assert forces["wheel"] == pytest.approx(-1)


def test_a_differential_shares_turns_and_halves_torque():
    """Bevel wheels in a case: seen from it, one output turns as the other turns back."""
    robot = sk.robot_from_text(
        table(
            ("case", "ground", "box", Z, 0.0, ""),
            ("left", "box", "l", Z, 0.0, ""),
            ("right", "box", "r", Z, 0.0, follows("left", -1.0)),
        )
    )
    mechanism = sk.closed_mechanism(robot, ["l_turn.rz", "r_turn.rz"], turns("l", "r"))
    state = sk.State(np.eye(4), np.array([0.3, 0.2]))
    rates = sk.secondary_rates(mechanism, state, np.array([[2.0, 4.0], [5.0, -5.0], [1.0, 1.0]]))
    np.testing.assert_allclose(rates[:, 0], [3, 0, 1], atol=1e-14)
    loads = {link: [0, 0, 1.5, 0, 0, 0] for link in ("l", "r")}
    forces = sk.static_forces(sk.closed_mechanism(robot), state, loads, active=["case"])
    assert forces["case"] == pytest.approx(-3.0)
    assert abs(forces["right"]) == pytest.approx(1.5)
