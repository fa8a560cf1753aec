"""Robots with coupled joints against Pinocchio: kinematics, dynamics, by NumPy, JAX and symbols."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path

import numpy as np
import pytest

import screwkin as sk
from screwkin.algebra.se3 import as_array, map_scalars
from screwkin.kinematics.positions import link_displacements
from screwkin.model.urdf import urdf_from_robot
from screwkin.model.urdf_in import load_urdf, parse_urdf
from tests.model.urdf_texts import GRIP
from tests.oracles.coupled import Oracle, coupled_tree, tangled_tree


@pytest.mark.parametrize("seed", range(1, 4))
def test_random_trees_with_coupled_joints_agree_with_pinocchios_mimic_joints(seed):
    rng = np.random.default_rng(seed)
    text = coupled_tree(rng)
    robot = parse_urdf(text).robot
    assert robot.coupled
    Oracle(text, robot, mimic=True).check(rng)
    Oracle(urdf_from_robot(robot), robot, mimic=True).check(rng)


@pytest.mark.parametrize("seed", range(1, 4))
def test_joints_that_follow_any_other_agree_with_free_joints_and_the_chain_rule(seed):
    rng = np.random.default_rng(seed)
    text = tangled_tree(rng)
    robot = parse_urdf(text).robot
    assert robot.coupled
    Oracle(text, robot, mimic=False).check(rng)


def test_fingers_of_two_kinds_of_joints_close_against_each_other():
    """Pinocchio takes the file as this library writes it: one kind of joint for leader and follower."""
    robot = parse_urdf(GRIP).robot
    assert [(joint.name, joint.leader, joint.ratio, joint.offset) for joint in robot.coupled] == [
        ("f2", "f1", -1, 0)
    ]
    rng = np.random.default_rng(0)
    Oracle(GRIP, robot, mimic=False).check(rng)
    Oracle(urdf_from_robot(robot), robot, mimic=True).check(rng)


def test_jax_and_symbols_couple_joints_as_numpy_does():
    import jax
    import sympy

    rng = np.random.default_rng(1)
    robot = parse_urdf(tangled_tree(rng, 4)).robot
    assert robot.coupled
    q, qd = rng.uniform(-1, 1, (2, len(robot.joints)))
    state = sk.State(np.eye(4), q)
    with jax.enable_x64(True):
        traced = jax.jit(lambda q: sk.inverse_dynamics(robot, sk.State(np.eye(4), q), qd, qd))(q)
    np.testing.assert_allclose(traced, sk.inverse_dynamics(robot, state, qd, qd), atol=1e-11)
    symbols = sympy.symbols([f"q{i}" for i in range(len(q))], real=True)
    numbers = dict(zip(symbols, q, strict=True))
    last = link_displacements(robot, list(symbols))[-1]
    pose = map_scalars(lambda x: float(sympy.sympify(x).subs(numbers)), last @ robot.links[-1].frame)
    np.testing.assert_allclose(as_array(pose), sk.link_poses(robot, state)[-1], atol=1e-12)


def robots_with_couplings() -> list[Path]:
    """Files with coupled joints among the public robots that are here: of the package, else of a folder."""
    found = importlib.util.find_spec("example_robot_data")
    folder = (
        os.environ.get("SCREWKIN_ROBOTS", "") if found is None else str(Path(str(found.origin)).parents[4])
    )
    files = Path(folder).rglob("*.urdf") if folder else ()
    return sorted(path for path in files if "<mimic" in path.read_text(errors="replace"))


@pytest.mark.robots
def test_public_robots_with_coupled_joints_agree_with_pinocchio():
    """By its mimic joints where Pinocchio takes them, else by the chain rule."""
    files = robots_with_couplings()
    if not files:
        pytest.skip("no public robots: install example-robot-data, or name their folder in SCREWKIN_ROBOTS")
    rng, mimics = np.random.default_rng(5), 0
    for path in files:
        text, robot = path.read_text(errors="replace"), load_urdf(path).robot
        Oracle(text, robot, mimic=False).check(rng)
        try:
            oracle = Oracle(text, robot, mimic=True)
        except ValueError:
            continue  # a leader behind its follower, or of another kind
        oracle.check(rng)
        mimics += bool(robot.coupled)
    assert mimics
