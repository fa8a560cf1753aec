"""Inverse kinematics in JAX: arrays of its kind, transformations, and implicit derivatives."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import screwkin as sk
from screwkin.model.state import State

pytestmark = pytest.mark.usefixtures("x64")
ROBOT = sk.load_robot("bioloid")
HOME = sk.home(ROBOT)
LEG = sk.frame_pose(ROBOT, State(np.eye(4), HOME.q), "left_foot")
HAND = sk.frame_pose(ROBOT, HOME, "right_hand")[:3, 3]
STEP = 1e-6


def raised(z):
    """The left leg's joints with the foot raised by z."""
    T = jnp.asarray(LEG)
    return sk.limb_ik(ROBOT, "left_leg", T + z * jnp.zeros((4, 4)).at[2, 3].set(1.0)).best


def moved(x):
    """Joints of the whole body with the base raised by x[0] and the right hand by x[1]."""
    up = jnp.zeros((4, 4)).at[2, 3].set(1.0)
    targets = {
        "base": jnp.asarray(HOME.T_world_base) + x[0] * up,
        "left_foot": sk.frame_pose(ROBOT, HOME, "left_foot"),
        "right_hand": jnp.asarray(HAND) + x[1] * jnp.array([0.0, 0.0, 1.0]),
    }
    return sk.solve_pose(ROBOT, targets).state.q


def test_jax_arrays_give_jax_arrays_equal_to_numpy_s() -> None:
    found, expected = sk.limb_ik(ROBOT, "left_leg", jnp.asarray(LEG)), sk.limb_ik(ROBOT, "left_leg", LEG)
    for name in ("q", "valid", "in_limits", "residual", "iterations", "best", "status"):
        assert isinstance(getattr(found, name), jax.Array), name
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
    solution = sk.solve_pose(ROBOT, {"right_hand": jnp.asarray(HAND)})
    assert isinstance(solution.state.q, jax.Array)
    assert isinstance(solution.status, jax.Array)
    assert solution.ok


@pytest.mark.parametrize(("function", "x"), [(raised, 0.005), (moved, np.array([-0.004, 0.003]))])
def test_derivatives_are_those_of_differences_in_both_modes(function, x) -> None:
    x = jnp.asarray(x)
    units = jnp.eye(x.size).reshape(x.size, *x.shape) * STEP
    central = jnp.stack([(function(x + u) - function(x - u)) / (2 * STEP) for u in units], axis=-1)
    for transform in (jax.jacfwd, jax.jacrev, lambda f: jax.jit(jax.jacfwd(f))):
        slope = transform(function)(x)
        np.testing.assert_allclose(slope.reshape(central.shape), central, atol=2e-6)


def test_second_derivatives_are_those_of_first_ones() -> None:
    slope = jax.jacfwd(raised)
    central = (slope(0.005 + 1e-5) - slope(0.005 - 1e-5)) / 2e-5
    np.testing.assert_allclose(jax.jacfwd(slope)(0.005), central, rtol=1e-5, atol=1e-5)


def test_vmap_and_jit_solve_what_a_batch_solves() -> None:
    z = jnp.linspace(0.0, 0.02, 5)
    expected = jnp.stack([raised(x) for x in z])
    np.testing.assert_allclose(jax.vmap(raised)(z), expected, atol=1e-12)
    np.testing.assert_allclose(jax.jit(jax.vmap(raised))(z), expected, atol=1e-12)
    solved = jax.jit(lambda T: sk.limb_ik(ROBOT, "left_leg", T))(LEG)
    assert solved.method == "closed"
    np.testing.assert_allclose(solved.best, expected[0], atol=1e-12)
    whole = jax.jit(lambda p: sk.solve_pose(ROBOT, {"right_hand": p}))(HAND)
    assert whole.limbs == ("right_arm",)
    assert whole.status.shape == (1,)


def test_joints_of_other_limbs_follow_the_guess() -> None:
    def held(q):
        return sk.solve_pose(ROBOT, {"right_hand": HAND}, State(HOME.T_world_base, q)).state.q

    slope = jax.jacfwd(held)(jnp.asarray(HOME.q))
    arm = list(ROBOT.path_to(ROBOT.limb("right_arm").link))
    expected = np.eye(len(HOME.q))
    expected[arm] = 0.0
    np.testing.assert_allclose(slope, expected, atol=1e-12)


def test_numeric_methods_may_be_traced_too() -> None:
    found = jax.jit(lambda T: sk.limb_ik(ROBOT, "left_leg", T, "newton").best)(LEG)
    np.testing.assert_allclose(found, raised(0.0), atol=1e-9)
