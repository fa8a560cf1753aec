"""Formulas on a tape: what programs compute is what the formulas themselves compute over arrays."""

from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest

import screwkin as sk
from screwkin.compiler import native
from screwkin.compiler.program import Recorder
from screwkin.compiler.records import Tape
from screwkin.compiler.run import run
from screwkin.dynamics import body
from screwkin.kinematics.formula import Formula, Values
from screwkin.mechanism import davies
from tests.kinematics.machines import random_state, random_tree

PATHS = ["python", "numpy", *(["C"] if native.compiler() else [])]
WHOLE = ("link_poses", "center_of_mass", "com_jacobian", "momentum", "mass_matrix")
MOVING = ("inverse_dynamics", "ground_wrench", "balance")


def told(formula: Formula, *about, seed: int = 0, batch: tuple[int, ...] = (7,)):
    """Inputs of a formula of a robot: a random state, and numbers for whatever else it asks for."""
    rng = np.random.default_rng(seed)
    state = random_state(about[0], seed, batch)
    found = {g.name: rng.uniform(-1, 1, (*batch, *g.shape)) for g in formula.program(*about).inputs}
    return found | {"T_world_base": state.T_world_base, "q": state.q}


def assert_alike(formula: Formula, *about, path: str, seed: int = 0) -> None:
    inputs = told(formula, *about, seed=seed)
    expected = formula.values(*about, told=inputs)
    found = run(formula.program(*about), inputs, path=path)
    assert found.keys() == expected.keys()
    for name, values in expected.items():
        size = 1 + np.abs(values).max(initial=0.0)
        np.testing.assert_allclose(found[name], values, atol=1e-12 * size, err_msg=name)


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("name", [*WHOLE, *MOVING])
def test_the_body_of_a_random_tree(name: str, path: str) -> None:
    for seed in range(1 if path == "C" else 3):  # compiling takes a second
        assert_alike(getattr(body, name), random_tree(seed), path=path, seed=seed)


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("robot", ["bioloid", "poppy12"])
def test_frames_and_the_mechanism_of_bundled_robots(robot: str, path: str) -> None:
    robot = sk.load_robot(robot)
    mechanism = sk.closed_mechanism(robot)
    choice = robot, mechanism.primary, mechanism.secondary
    for frame in ("base", robot.link_names[3], robot.tip_names[0]):
        assert_alike(body.frame_pose, robot, frame, path=path)
        for own in (True, False):
            assert_alike(body.jacobian, robot, frame, own, path=path)
    for at_base in (True, False):
        assert_alike(davies.coupling_screws, *choice, at_base, path=path)
    feet = tuple(limb.tip for limb in robot.limbs if limb.kind == "leg")
    assert_alike(davies.primary_rates, *choice, ("waist", *feet), path=path)


def test_a_robot_without_joints_has_poses_and_no_columns_of_joints() -> None:
    robot = sk.load_robot("bioloid")
    alone = robot.__class__(
        **{**vars(robot), "links": robot.links[:1], "joints": (), "limbs": (), "soles": (), "postures": ()}
    )
    state = sk.State(np.eye(4), np.zeros(0))
    np.testing.assert_array_equal(sk.link_poses(alone, state), np.eye(4)[None])
    assert sk.jacobian(alone, state, "base").shape == (6, 6)
    assert sk.mass_matrix(alone, state).shape == (6, 6)


def test_batches_of_several_axes_broadcast_on_either_path() -> None:
    robot = sk.load_robot("poppy12")
    inputs = told(body.momentum, robot, batch=(3, 1)) | {"qd": np.ones((5, 12)), "base_twist": np.ones(6)}
    found = run(body.momentum.program(robot), inputs)
    expected = body.momentum.values(robot, told=inputs)
    assert found["momentum"].shape == expected["momentum"].shape == (3, 5, 6)
    np.testing.assert_allclose(found["momentum"], expected["momentum"], atol=1e-12)


def test_a_formula_is_recorded_once_it_pays_and_computes_over_arrays_before() -> None:
    told: list[type] = []

    @Formula
    def twice(tape: Tape, robot: sk.Robot, factor: int) -> None:
        told.append(type(tape))
        tape.title("twice", "Twice the positions.")
        tape.output("x", [factor * x for x in tape.input("q", len(robot.joints))])

    def ask(robot: sk.Robot, count: int, factor: int) -> None:
        q = np.full((count, len(robot.joints)), 0.25)
        np.testing.assert_array_equal(twice(robot, factor, told={"q": q})["x"], factor * q)

    first, second = random_tree(1), random_tree(2)
    for _ in range(2 * 8):
        ask(first, 1, 2)
    assert told == [Values] * (8 - 1) + [Recorder]
    ask(second, 8 * 1000, 2)
    ask(second, 1, 2)
    assert told[8:] == [Recorder], "a large batch is worth a program, which small ones then use"
    ask(second, 1, 3)
    assert told[8 + 1 :] == [Values], "another choice is another program"


def test_a_search_over_robots_keeps_neither_robots_nor_programs() -> None:
    for calls, count in ((1, 1), (2, 2 * 1000), (8 + 1, 1)):
        robot = random_tree(3)
        for _ in range(calls):
            sk.link_poses(robot, random_state(robot, 3, (count,)))
        gone = weakref.ref(robot)
        programs = [weakref.ref(body.link_poses.program(robot))]
        del robot
        gc.collect()
        assert gone() is None
        assert programs[0]() is None


def test_a_search_over_robots_makes_no_programs(monkeypatch) -> None:
    monkeypatch.setattr("screwkin.kinematics.formula.Recorder", None)
    for seed in range(3):
        robot = random_tree(seed)
        for _ in range(3):
            sk.mass_matrix(robot, random_state(robot, seed, (1000,)))
    with pytest.raises(TypeError):
        sk.mass_matrix(robot, random_state(robot, seed, (8 * 1000,)))


def test_equal_programs_share_a_name_on_disk_and_others_do_not() -> None:
    robot, again = sk.load_robot("bioloid"), sk.load_robot("poppy12")
    fresh = Formula(body.link_poses._tell)
    assert fresh.program(robot) is not body.link_poses.program(robot)
    assert fresh.program(robot).digest == body.link_poses.program(robot).digest
    assert fresh.program(again).digest != fresh.program(robot).digest
