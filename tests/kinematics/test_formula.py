"""One definition a quantity: programs compute what formulas do over records, behind the same checks."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.compiler import native
from screwkin.compiler.run import run
from screwkin.dynamics import quantities
from screwkin.errors import InputError, ShapeError
from screwkin.kinematics import body
from screwkin.kinematics.formula import Quantity
from tests.kinematics.machines import random_state, random_tree

PATHS = ["python", "numpy", *(["C"] if native.compiler() else [])]
WHOLE = (body.link_poses, body.center_of_mass, body.com_jacobian, quantities.mass_matrix)
MOVING = (quantities.momentum, quantities.inverse_dynamics, quantities.ground_wrench, quantities.balance)


def inputs_of(quantity: Quantity, subject, *choices, optional=(), seed: int = 0, batch=(7,)):
    """Inputs of a quantity's program: a random state, and numbers for whatever else it asks for."""
    rng = np.random.default_rng(seed)
    state = random_state(getattr(subject, "robot", subject), seed, batch)
    groups = quantity.program(subject, *choices, optional=optional).inputs
    found = {g.name: rng.uniform(-1, 1, (*batch, *g.shape)) for g in groups}
    return found | {"T_world_base": state.T_world_base, "q": state.q}


def by_records(quantity: Quantity, subject, *choices, optional=(), inputs):
    """The formula itself, on records whose components are arrays."""
    definition = quantity.definition
    given = definition.inputs(subject, optional)
    names = [
        a.name
        for own in definition.arguments(getattr(subject, "robot", subject), given).values()
        for a in own
    ]
    found = definition.by_formula(
        subject, given, definition.chosen(choices), [inputs[name] for name in names]
    )
    return found if isinstance(found, dict) else {definition.name: found}


def assert_alike(quantity: Quantity, subject, *choices, path: str, optional=(), seed: int = 0) -> None:
    inputs = inputs_of(quantity, subject, *choices, optional=optional, seed=seed)
    expected = by_records(quantity, subject, *choices, optional=optional, inputs=inputs)
    found = run(quantity.program(subject, *choices, optional=optional), inputs, path=path)
    assert found.keys() == expected.keys()
    for name, values in expected.items():
        size = 1 + np.abs(values).max(initial=0.0)
        np.testing.assert_allclose(found[name], values, atol=1e-12 * size, err_msg=name)


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("quantity", [*WHOLE, *MOVING], ids=lambda quantity: quantity.__name__)
def test_the_program_of_a_random_tree_is_the_formula(quantity: Quantity, path: str) -> None:
    for seed in range(1 if path == "C" else 3):  # compiling takes a second
        robot = random_tree(seed)
        for optional in {(), tuple(sorted(quantity.definition.optional))}:
            assert_alike(quantity, robot, path=path, seed=seed, optional=optional)


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("robot", ["bioloid", "poppy12"])
def test_frames_and_the_mechanism_of_bundled_robots(robot: str, path: str) -> None:
    robot = sk.load_robot(robot)
    mechanism = sk.closed_mechanism(robot)
    for frame in ("base", robot.link_names[3], robot.tip_names[0]):
        assert_alike(body.frame_pose, robot, frame, path=path)
        for optional in ((), ("point",)):
            assert_alike(body.jacobian, robot, frame, path=path, optional=optional)
    for optional in ((), ("point",)):
        assert_alike(sk.network_matrix, mechanism, path=path, optional=optional)
    assert_alike(sk.virtual_motion, mechanism, path=path)


def test_a_robot_without_joints_has_poses_and_no_columns_of_joints() -> None:
    robot = sk.load_robot("bioloid")
    alone = replace(robot, links=robot.links[:1], joints=(), limbs=(), soles=(), postures=())
    state = sk.State(np.eye(4), np.zeros(0))
    np.testing.assert_array_equal(sk.link_poses(alone, state), np.eye(4)[None])
    assert sk.jacobian(alone, state, "base").shape == (6, 6)
    assert sk.mass_matrix(alone, state).shape == (6, 6)


def test_batches_of_several_axes_broadcast_on_either_path() -> None:
    robot = sk.load_robot("poppy12")
    optional = ("base_twist",)
    inputs = inputs_of(sk.momentum, robot, batch=(3, 1), optional=optional)
    inputs |= {"qd": np.ones((5, 12)), "base_twist": np.ones(6)}
    found = run(sk.momentum.program(robot, optional=optional), inputs)
    expected = by_records(sk.momentum, robot, optional=optional, inputs=inputs)
    assert found["momentum"].shape == expected["momentum"].shape == (3, 5, 6)
    np.testing.assert_allclose(found["momentum"], expected["momentum"], atol=1e-12)


@pytest.mark.parametrize("way", ["arrays", "python", "C"])
def test_what_is_wrong_with_an_input_is_said_on_every_path(way: str) -> None:
    """The guard inside the program objects; the message comes from reading the arrays again."""
    robot = replace(sk.load_robot("poppy12"))
    home, bent = sk.home(robot), np.eye(4)
    bent[0, 1] = 1e-3
    batch = (3,) if way == "arrays" else ()
    if way == "C":
        sk.prepare(robot, "center_of_mass")
    T, q = (np.broadcast_to(x, (*batch, *x.shape)) for x in (home.T_world_base, home.q))
    for value in (np.nan, np.inf, -np.inf):
        with pytest.raises(ShapeError, match=r"state\.q holds NaN or infinity"):
            sk.center_of_mass(robot, sk.State(T, q + np.r_[np.zeros(11), value]))
    with pytest.raises(ShapeError, match="not a rigid pose"):
        sk.center_of_mass(robot, sk.State(T @ bent, q))
    with pytest.raises(ShapeError, match="expected"):
        sk.center_of_mass(robot, sk.State(T, q[..., :5]))


@pytest.mark.parametrize("dtype", [np.float16, np.float32])
def test_floats_with_few_digits_are_refused(dtype: type) -> None:
    robot = sk.load_robot("poppy12")
    with pytest.raises(ShapeError, match="astype"):
        sk.link_poses(robot, sk.State(np.eye(4), np.zeros(12, dtype)))


def test_arguments_are_bound_as_python_binds_them() -> None:
    robot = sk.load_robot("poppy12")
    state = sk.home(robot)
    J = sk.jacobian(robot, state, "left_foot", np.zeros(3))
    np.testing.assert_array_equal(
        J, sk.jacobian(robot=robot, frame="left_foot", state=state, point=[0, 0, 0])
    )
    for args, options in (
        ((robot, state), {}),
        ((robot, state, "left_foot"), {"frame": "right_foot"}),
        ((robot, state, "left_foot", None, "base", 1), {}),
        ((robot, state, "left_foot"), {"links": 3}),
    ):
        with pytest.raises(TypeError):
            sk.jacobian(*args, **options)


def test_wrong_kinds_are_refused_in_words() -> None:
    robot = sk.load_robot("poppy12")
    with pytest.raises(InputError, match=r"robot is the str .*poppy12.*, expected Robot; give load_robot"):
        sk.link_poses("poppy12", sk.home(robot))
    with pytest.raises(InputError, match=r"state is .*ndarray, expected State; give State\("):
        sk.link_poses(robot, np.zeros(12))
    with pytest.raises(InputError, match="mechanism is the int 42"):
        sk.network_matrix(42, sk.home(robot))


def test_a_search_over_robots_keeps_neither_robots_nor_programs() -> None:
    for calls, count in ((1, 1), (2, 2000)):
        robot = replace(random_tree(3))
        for _ in range(calls):
            sk.link_poses(robot, random_state(robot, 3, (count,)))
        gone = weakref.ref(robot)
        programs = [weakref.ref(body.link_poses.program(robot))]
        del robot
        gc.collect()
        assert gone() is None
        assert programs[0]() is None


def test_equal_programs_share_a_name_on_disk_and_others_do_not() -> None:
    robot, other = sk.load_robot("bioloid"), sk.load_robot("poppy12")
    twin = replace(robot)
    program = body.link_poses.program(robot)
    assert body.link_poses.program(twin) is not program
    assert body.link_poses.program(twin).digest == program.digest
    assert body.link_poses.program(other).digest != program.digest
