"""Links that bend: the textbook's cantilever, a table's rows, and their mirror images."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.compliance.cartesian import cartesian_stiffness
from screwkin.compliance.stiffness import static_deflection
from screwkin.errors import RobotRemark, TableError
from screwkin.model.records import same_content
from screwkin.model.robot import robot_text

E, G, A, I_Y, I_Z, J, LENGTH, MASS = 2.1e11, 8e10, 2e-4, 1e-9, 4e-9, 2e-9, 0.5, 2.0
BEAM = """
[robot]
name = "beam"
base_link = "wall"
base = "fixed"
[[link]]
name = "wall"
mass = 0
[[link]]
name = "bar"
mass = 2
com = [0.35, 0, 0]
inertia = { box = [0.5, 0.01, 0.02] }
spring = { SPRING }
[[joint]]
name = "slide"
parent = "wall"
child = "bar"
type = "prismatic"
s = [1, 0, 0]
s0 = [0.1, 0, 0]
[[limb]]
name = "right_beam"
kind = "arm"
link = "bar"
tip = "right_end"
frame = { xyz = [0.6, 0, 0] }
"""
SECTION = (
    "root = [0.1, 0, 0], end = [0.6, 0, 0], E = 2.1e11, G = 8e10, A = 2e-4, I = [1e-9, 4e-9], J = 2e-9, "
    "about = [0, 1, 0]"
)
AT_REST = sk.State(np.eye(4), np.zeros(1))


def beam(spring: str = SECTION) -> sk.Robot:
    """Along x from 0.1 to 0.6 m, clamped but for a slide along itself."""
    return sk.robot_from_text(BEAM.replace("SPRING", spring))


def at_end(m, f) -> list[float]:
    """A wrench at the free end, about the world's origin."""
    return [*(np.array(m) + np.cross([0.6, 0, 0], f)), *f]


@pytest.mark.parametrize(
    ("m", "f", "turn", "shift"),
    [
        ((0, 0, 0), (0, 0, 1), (0, -(LENGTH**2) / (2 * E * I_Y), 0), (0, 0, LENGTH**3 / (3 * E * I_Y))),
        ((0, 0, 0), (0, 1, 0), (0, 0, LENGTH**2 / (2 * E * I_Z)), (0, LENGTH**3 / (3 * E * I_Z), 0)),
        ((0, 0, 0), (1, 0, 0), (0, 0, 0), (LENGTH / (E * A) + 1 / 1e7, 0, 0)),
        ((1, 0, 0), (0, 0, 0), (LENGTH / (G * J), 0, 0), (0, 0, 0)),
        ((0, 1, 0), (0, 0, 0), (0, LENGTH / (E * I_Y), 0), (0, 0, -(LENGTH**2) / (2 * E * I_Y))),
        ((0, 0, 1), (0, 0, 0), (0, 0, LENGTH / (E * I_Z)), (0, LENGTH**2 / (2 * E * I_Z), 0)),
    ],
)
def test_a_cantilever_bends_as_the_textbook_says(m, f, turn, shift):
    """f L^3 / 3EI, f L^2 / 2EI, m L / EI, m L / GJ, f L / EA; so little that it stays linear."""
    little = 1e-4
    load = little * np.array(at_end(m, f))
    bent = static_deflection(beam(), AT_REST, "base", 1e7, gravity=0, loads={"right_end": load})
    expected = little * np.array([*turn, *shift])
    np.testing.assert_allclose(bent.of("right_end"), expected, rtol=1e-9, atol=1e-16)
    np.testing.assert_allclose(bent.wrenches[0], -load, rtol=0, atol=1e-12)  # the clamp is at the origin


def test_a_beam_sags_under_its_own_weight_as_the_textbook_says():
    """w L^4 / 8EI and w L^3 / 6EI."""
    g = 1e-3
    sagged = static_deflection(beam(), AT_REST, "base", 1e7, gravity=g).of("right_end")
    weight = MASS * g
    np.testing.assert_allclose(sagged[5], -weight * LENGTH**3 / (8 * E * I_Y), rtol=1e-8)
    np.testing.assert_allclose(sagged[1], weight * LENGTH**2 / (6 * E * I_Y), rtol=1e-8)


def test_the_stiffness_of_its_end_is_the_inverse_of_the_textbooks_compliance():
    K = cartesian_stiffness(beam(), AT_REST, "base", "right_end", 1e7, gravity=0)
    np.testing.assert_allclose(K[5, 5], 12 * E * I_Y / LENGTH**3, rtol=1e-9)
    np.testing.assert_allclose(K[1, 5], 6 * E * I_Y / LENGTH**2, rtol=1e-9)
    np.testing.assert_allclose(K[1, 1], 4 * E * I_Y / LENGTH, rtol=1e-9)
    np.testing.assert_allclose(K[3, 3], 1 / (LENGTH / (E * A) + 1e-7), rtol=1e-9)


def test_a_table_with_a_spring_reads_back_number_for_number():
    robot = beam()
    text = robot_text(replace(robot, text=""))
    again = sk.robot_from_text(text)
    assert same_content(again, robot)
    assert "stiffness = [[" in text
    assert np.shape(robot.link("bar").spring.stiffness) == (6, 6)


def test_the_image_of_a_limb_bends_as_its_mirror_image():
    rows = BEAM.replace("SPRING", "root = [0.1, -0.1, 0], end = [0.5, -0.3, 0.1], stiffness = MATRIX")
    rng = np.random.default_rng(0)
    R = rng.normal(size=(6, 6))
    K = (R @ R.T + np.eye(6)) * 500
    rows = rows.replace("MATRIX", str(((K + K.T) / 2).tolist())).replace('"bar"', '"right_bar"')
    rows = (
        rows.replace('"slide"', '"right_slide"')
        + '[[limb]]\nname = "left_beam"\nmirror = "y"\nof = "right_beam"\n'
    )
    robot = sk.robot_from_text(rows)
    force = np.array([1.0, 2.0, -3.0])
    mirrored = force * [1, -1, 1]
    state = sk.State(np.eye(4), np.zeros(2))
    loads = {"right_end": force, "left_end": mirrored}
    bent = static_deflection(robot, state, "base", 400.0, loads=loads)
    right, left = bent.of("right_end"), bent.of("left_end")
    np.testing.assert_allclose(left, right * [-1, 1, -1, 1, -1, 1], rtol=0, atol=1e-12)
    assert np.abs(right).max() > 0.01


PLACES = "root = [0.1, 0, 0], end = [0.6, 0, 0]"
UNEVEN = [[float(10 * (i == j) + (i == 0 and j == 1)) for j in range(6)] for i in range(6)]
SLACK = [[float(10 * (i == j)) if i else 0.0 for j in range(6)] for i in range(6)]
LIMP = [[float(10 * (i == j) + 20 * (i + j == 1)) for j in range(6)] for i in range(6)]


@pytest.mark.parametrize(
    ("spring", "message"),
    [
        (PLACES, "E, G, A, I missing"),
        (f"{PLACES}, E = 1e9, G = 1e9, I = 1e-9", "A missing"),
        (f"{PLACES}, E = 1e9, stiffness = {UNEVEN}", "has stiffness and E"),
        (f"{PLACES}, stiffness = {UNEVEN}", "is not symmetric: 1 and 0 in rows 1 and 2"),
        (f"{PLACES}, stiffness = {SLACK}", "no positive finite number in each place of its diagonal"),
        (f"{PLACES}, stiffness = {LIMP}", "is not positive definite"),
        (f"{PLACES}, stiffness = [[1, 2], [3, 4]]", "has rows of 2, 2"),
        (f"{PLACES}, E = -1e9, G = 1e9, A = 1, I = 1", "-1e\\+09 is not positive"),
        (f"{PLACES}, E = 1e9, G = 1e9, A = 1e-4, I = [1e-9, 2e-9]", "about: is missing"),
        (f"{PLACES}, E = 1, G = 1, A = 1, I = [1, 2], about = [1, 0, 0]", "lies along the beam"),
        ("root = [0, 0, 0], end = [0, 0, 0], E = 1, G = 1, A = 1, I = 1", "spring.end: is the root too"),
        ("root = [0.1, 0, 0], E = 1, G = 1, A = 1, I = 1", "spring.end: is missing"),
        (f"{PLACES}, K = 1", "spring.K: is unknown"),
    ],
)
def test_a_spring_that_is_none_is_refused_with_what_would_be_right(spring, message):
    with pytest.raises(TableError, match=message):
        beam(spring)


def test_urdf_and_simulators_say_that_they_know_rigid_links_only():
    from screwkin.model.urdf import urdf_from_robot
    from screwkin.sim.bodies import bodies_of

    with pytest.warns(RobotRemark, match="rigid links only, and so do simulators; bar would bend"):
        urdf_from_robot(beam())
    assert "links that bend are rigid: bar" in bodies_of(beam())[1]


def test_the_base_link_has_no_spring():
    rows = BEAM.replace("mass = 0", f"mass = 0\nspring = {{ {SECTION} }}", 1).replace("SPRING", SECTION)
    with pytest.raises(TableError, match=r"spring: is of the base link\. Give springs to the links"):
        sk.robot_from_text(rows)
    robot = beam()
    with pytest.raises(TableError, match="base link"):
        replace(robot, links=(replace(robot.links[0], spring=robot.links[1].spring), robot.links[1]))
