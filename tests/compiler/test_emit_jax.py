"""Programs as JAX functions: numbers, gradients, and no compilation for new numbers."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import screwkin as sk
from screwkin.compiler import emit_jax
from screwkin.compiler.run import run
from screwkin.ik import programs as limbs
from screwkin.kinematics import body
from screwkin.kinematics.serial_chain import SerialChain

pytestmark = pytest.mark.usefixtures("x64")


def last(array):
    """The batch last."""
    return jnp.asarray(np.moveaxis(np.asarray(array), 0, -1))


def test_a_kernel_gives_the_same_numbers_in_jax_and_is_traced_once():
    robot = sk.load_robot("poppy12")
    program = body.tip_poses.program(robot)
    traces = []
    kernel = emit_jax.function(program)

    @jax.jit
    def counted(*inputs):
        traces.append(1)
        return kernel(*inputs)

    rng = np.random.default_rng(0)
    for _ in range(3):
        inputs = {"T_world_base": np.tile(np.eye(4), (50, 1, 1)), "q": rng.uniform(-9, 9, (50, 12))}
        (found,) = counted(*(last(inputs[g.name]) for g in program.inputs))
        expected = run(program, inputs, path="numpy")["tip_poses"]
        np.testing.assert_allclose(np.moveaxis(np.asarray(found), -1, 0), expected, atol=1e-14)
    assert len(traces) == 1


def test_gradients_are_those_of_finite_differences():
    robot = sk.load_robot("poppy12")
    kernel = emit_jax.function(body.frame_pose.program(robot, "left_foot"))
    q, T = jnp.asarray(np.random.default_rng(1).uniform(-1, 1, (12, 3))), jnp.tile(jnp.eye(4)[..., None], 3)

    def height(q):
        return kernel(T, q)[0][2, 3].sum()

    slope, h = jax.jit(jax.grad(height))(q), 1e-6
    for joint in range(12):
        step = jnp.zeros_like(q).at[joint].set(h)
        difference = (kernel(T, q + step)[0][2, 3] - kernel(T, q - step)[0][2, 3]) / (2 * h)
        np.testing.assert_allclose(slope[joint], difference, atol=1e-9)


def test_a_sample_without_numbers_leaves_the_others_as_they_are_and_none_is_no_fault():
    program = body.center_of_mass.program(sk.load_robot("poppy12"))
    kernel = jax.jit(emit_jax.function(program))
    T, q = jnp.tile(jnp.eye(4)[..., None], 3), jnp.asarray(np.random.default_rng(1).uniform(-1, 1, (12, 3)))
    (sound,) = kernel(T, q)
    (found,) = kernel(T, q.at[:, 0].set(jnp.nan))
    assert np.isnan(found[:, 0]).any()
    np.testing.assert_allclose(found[:, 1:], sound[:, 1:], atol=0)
    assert emit_jax.function(program)(T[..., :0], q[:, :0])[0].shape == (3, 0)


def test_a_closed_form_is_differentiable_through_its_branch():
    robot = sk.load_robot("bioloid")
    chain = SerialChain.of(robot, "left_arm")
    kernel = emit_jax.function(limbs.limb_pose(chain, True).program)
    home = sk.home(robot)
    place = sk.frame_pose(robot, sk.State(np.eye(4), home.q), "left_hand")[:3, 3]
    base, guess = jnp.eye(4)[..., None], jnp.asarray(home.q[list(chain.joints)])[:, None]

    @jax.jit
    def elbow(z):
        return kernel(base, jnp.asarray(place).at[2].add(z[0])[:, None], guess)[0][2, 0]

    h, zero = 1e-6, jnp.full(1, 1e-3)
    slope = jax.jit(jax.grad(elbow))(zero)[0]
    assert abs(float(slope)) > 1.0
    assert float(slope) == pytest.approx(float(elbow(zero + h) - elbow(zero - h)) / (2 * h), rel=1e-6)


@pytest.mark.parametrize("far", [1.0, 30.0, 1e5])
def test_sines_and_angles_are_exact_to_rounding(far):
    x = jnp.asarray(np.random.default_rng(2).uniform(-far, far, 20000))
    s, c = emit_jax.turn_of(x)
    np.testing.assert_allclose(s, np.sin(x), atol=3e-16)
    np.testing.assert_allclose(c, np.cos(x), atol=3e-16)
    y, z = x[:10000], x[10000:]
    np.testing.assert_allclose(emit_jax.angle_of(y, z), np.arctan2(y, z), atol=9e-16)
    assert emit_jax.angle_of(jnp.zeros(1), jnp.zeros(1))[0] == 0
