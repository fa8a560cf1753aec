"""Bound and prepared functions give what plain calls give, and say what they need."""

from __future__ import annotations

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import screwkin as sk
from screwkin.algebra.se3 import Pose
from screwkin.errors import InputError, ShapeError, UnknownNameError
from screwkin.export import bind, quantities
from screwkin.kinematics.formula import formula
from screwkin.kinematics.kinds import Joints
from screwkin.model.robot import Robot
from tests.kinematics.machines import random_state

ROBOT = sk.load_robot("bioloid")


def moving(batch: tuple[int, ...], seed: int = 0):
    """A state, a base twist and twists of the tips."""
    rng, home = np.random.default_rng(seed), sk.home(ROBOT)
    q = home.q + 0.1 * rng.uniform(-1, 1, (*batch, len(home.q)))
    state = sk.State(np.broadcast_to(home.T_world_base, (*batch, 4, 4)).copy(), q)
    tips = {limb.tip: rng.normal(size=(*batch, 6 if limb.kind == "leg" else 3)) for limb in ROBOT.limbs}
    return state, rng.normal(size=(*batch, 6)), tips


@pytest.fixture(scope="module")
def bound():
    return sk.bind(ROBOT, "tip_poses", "joint_rates", ("frame_pose", "left_foot"))


@pytest.mark.parametrize("batch", [(), (1,), (7,), (3, 5), (300,), (0,)])
def test_a_bound_function_gives_what_plain_calls_give(bound, batch: tuple[int, ...]) -> None:
    state, base, tips = moving(batch)
    found = bound(state, base_twist=base, tip_twists=tips)
    np.testing.assert_allclose(found.tip_poses, sk.tip_poses(ROBOT, state), atol=1e-14)
    np.testing.assert_allclose(
        found.frame_pose_left_foot, sk.frame_pose(ROBOT, state, "left_foot"), atol=1e-14
    )
    mechanism = sk.closed_mechanism(ROBOT)
    primary = sk.virtual_motion(mechanism, state, base, tips)
    secondary = sk.secondary_rates(mechanism, state, primary)
    joints = [mechanism.secondary.index(name) for name in ROBOT.joint_names]
    assert found.joint_rates.shape == (*batch, 18)
    np.testing.assert_allclose(found.joint_rates, secondary[..., joints], rtol=1e-10, atol=1e-10)


def test_a_call_in_place_reads_its_arrays_anew(bound) -> None:
    state, base, tips = moving((5,))
    call, results = bound.in_place(state, base_twist=base, tip_twists=tips)
    for seed in (1, 2):
        other, twist, moved = moving((5,), seed)
        state.q[:], base[:] = other.q, twist
        for tip, values in moved.items():
            tips[tip][:] = values
        call()
        expected = bound(other, base_twist=twist, tip_twists=moved)
        for got, wanted in zip(results, expected, strict=True):
            np.testing.assert_allclose(got, wanted, atol=1e-13)
    with pytest.raises(InputError, match="C-contiguous"):
        bound.in_place(
            sk.State(state.T_world_base, state.q[::-1].T.T[:, ::-1]), base_twist=base, tip_twists=tips
        )


def test_what_a_bound_function_lacks_is_named(bound) -> None:
    state, base, tips = moving(())
    with pytest.raises(InputError, match="missing: tip_twists"):
        bound(state, base_twist=base)
    with pytest.raises(InputError, match="not an argument: gravity"):
        bound(state, base_twist=base, tip_twists=tips, gravity=1.6)
    with pytest.raises(ShapeError, match=r"state\.q holds NaN"):
        bound(sk.State(state.T_world_base, state.q * np.nan), base_twist=base, tip_twists=tips)
    with pytest.raises(UnknownNameError, match="unknown quantity 'tips'"):
        sk.bind(ROBOT, "tips")
    with pytest.raises(InputError, match="nothing to bind"):
        sk.bind(ROBOT)
    with pytest.raises(InputError, match="choices"):
        sk.bind(ROBOT, "frame_pose")


def test_one_quantity_is_an_array_and_optional_arguments_may_be_arrays() -> None:
    state, base, _ = moving((4,))
    momentum = sk.bind(ROBOT, "momentum", optional=("base_twist",))
    rates = np.ones((4, 18))
    expected = sk.momentum(ROBOT, state, rates, base)
    np.testing.assert_allclose(momentum(state, qd=rates, base_twist=base), expected, atol=1e-14)


@pytest.mark.usefixtures("x64")
def test_jax_arrays_give_jax_arrays(bound) -> None:
    state, base, tips = moving((3,))
    inputs = jax.tree.map(jnp.asarray, (state.T_world_base, state.q, base, tips))

    @jax.jit
    def rates(T, q, base, tips):
        return bound(sk.State(T, q), base_twist=base, tip_twists=tips).joint_rates

    expected = bound(state, base_twist=base, tip_twists=tips).joint_rates
    np.testing.assert_allclose(rates(*inputs), expected, atol=1e-12)


def test_prepared_functions_give_what_they_gave() -> None:
    robot = replace(ROBOT)
    states = [random_state(robot, 1, batch) for batch in ((), (9,), (400,))]
    asked = [
        lambda state: sk.frame_pose(robot, state, "left_foot"),
        lambda state: sk.center_of_mass(robot, state),
    ]
    before = [ask(state) for ask in asked for state in states]
    sk.prepare(robot, "frame_pose", "center_of_mass")
    after = [ask(state) for ask in asked for state in states]
    for a, b in zip(before, after, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-13)
    with pytest.raises(UnknownNameError, match="nonsense"):
        sk.prepare(robot, "nonsense")


def test_a_new_quantity_is_its_definition_and_one_row(monkeypatch) -> None:
    @formula
    def base_height(robot: Robot, T_world_base: Pose, q: Joints) -> list:
        """Height of the base."""
        return [T_world_base.p.z]

    rows = {**quantities.QUANTITIES, "base_height": base_height}
    monkeypatch.setattr(quantities, "QUANTITIES", rows)
    state, *_ = moving((6,))
    np.testing.assert_array_equal(base_height(ROBOT, state)[:, 0], state.T_world_base[:, 2, 3])
    np.testing.assert_array_equal(sk.bind(ROBOT, "base_height")(state), base_height(ROBOT, state))
    (program,) = quantities.programs(ROBOT, "base_height")
    assert program.name == "bioloid_base_height"


def test_without_names_all_is_prepared_but_forward_dynamics(monkeypatch) -> None:
    asked, whole = [], bind.prepare
    monkeypatch.setattr(bind, "prepare", lambda robot, *names: asked.extend(names))
    whole(ROBOT)
    assert set(asked) == {*quantities.QUANTITIES, *quantities.ALGORITHMS} - {"forward_dynamics"}
