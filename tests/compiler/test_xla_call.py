"""Machine code inside jitted functions: the same numbers, batches, gradients, and what stands in for it."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import screwkin as sk
from screwkin.compiler import emit_jax, native, xla_call
from screwkin.compiler.run import run
from screwkin.kinematics import body

pytestmark = pytest.mark.usefixtures("x64")

compiled = pytest.mark.skipif(native.compiler() is None, reason="no C compiler here")


@pytest.fixture(scope="module")
def program():
    return body.center_of_mass.program(sk.load_robot("poppy12"))


def inputs_of(count, seed=0):
    T = np.tile(np.eye(4), (count, 1, 1))
    T[:, :3, 3] = np.random.default_rng(seed + 1).uniform(-1, 1, (count, 3))
    return jnp.asarray(T), jnp.asarray(np.random.default_rng(seed).uniform(-2, 2, (count, 12)))


def calls(f, *inputs):
    return "screwkin." in jax.jit(f).lower(*inputs).as_text()


@compiled
@pytest.mark.parametrize("count", [1, 15, 16, 17, 5000])
def test_batches_of_any_size_give_the_numbers_of_numpy(program, count):
    T, q = inputs_of(count)
    f = xla_call.xla_function(program)
    assert calls(f, T, q)
    (found,) = jax.jit(f)(T, q)
    told = {"T_world_base": np.asarray(T), "q": np.asarray(q)}
    np.testing.assert_allclose(found, run(program, told, path="numpy")["center_of_mass"], atol=1e-14)


@compiled
def test_batches_have_any_shape_and_broadcast(program):
    T, q = inputs_of(6)
    f = xla_call.xla_function(program)
    flat = f(T[:1], q)[0]
    assert f(T[0], q[0])[0].shape == (3,)
    np.testing.assert_allclose(f(T[0], q.reshape(2, 3, 12))[0].reshape(6, 3), flat, atol=0)


@compiled
def test_robots_of_one_text_share_their_handler():
    text, found = sk.load_robot("poppy12").text, []
    for _ in range(2):
        robot = sk.robot_from_text(text, name="twin")
        f = xla_call.xla_function(body.center_of_mass.program(robot))
        found.append(np.asarray(jax.jit(f)(*inputs_of(3))[0]))
    np.testing.assert_array_equal(*found)


@compiled
def test_vmap_adds_its_axis_to_the_batch(program):
    T, q = inputs_of(5)
    f = xla_call.xla_function(program)
    (alone,) = f(T[0], q)
    (mapped,) = jax.jit(jax.vmap(f, in_axes=(None, 1), out_axes=1))(T[0], q.T)
    np.testing.assert_allclose(mapped.T, alone, atol=0)
    np.testing.assert_allclose(jax.vmap(f)(T, q)[0], f(T, q)[0], atol=0)


@compiled
def test_gradients_of_batches_and_batches_of_gradients():
    """Of a short program: XLA takes seconds for the gradient of a long one."""
    robot = sk.load_robot("poppy12")
    shin = robot.joints[robot.path_to(robot.limb("left_leg").link)[4]].child
    program = body.frame_pose.program(robot, shin)
    T, q = inputs_of(4)
    f, plain = xla_call.xla_function(program), emit_jax.function(program)

    def height(T, q):
        return f(T, q)[0][..., 2, 3].sum()

    slope = jax.jit(jax.grad(height, argnums=1))(T, q)
    last = jax.jit(jax.grad(lambda q: plain(jnp.moveaxis(T, 0, -1), q)[0][2, 3].sum()))(q.T)
    np.testing.assert_allclose(slope, last.T, atol=1e-14)
    mapped = jax.jit(jax.vmap(jax.grad(height, argnums=1)))
    np.testing.assert_allclose(mapped(T, q), slope, atol=1e-14)
    h, joint = 1e-6, robot.path_to(shin)[1]
    step = jnp.zeros_like(q).at[:, joint].set(h)
    difference = (f(T, q + step)[0][:, 2, 3] - f(T, q - step)[0][:, 2, 3]) / (2 * h)
    assert np.abs(difference).min() > 1e-6
    np.testing.assert_allclose(slope[:, joint], difference, atol=1e-9)


@compiled
def test_other_types_are_computed_by_xla(program):
    T, q = inputs_of(4)
    f = xla_call.xla_function(program)
    single = (T.astype(np.float32), q.astype(np.float32))
    assert not calls(f, *single)
    np.testing.assert_allclose(f(*single)[0], f(T, q)[0], atol=1e-5)


def test_without_a_compiler_xla_computes(program, monkeypatch):
    monkeypatch.setattr(native, "compiler", lambda: None)
    T, q = inputs_of(4)
    f = xla_call.xla_function.__wrapped__(program)
    assert not calls(f, T, q)
    last = emit_jax.function(program)(jnp.moveaxis(T, 0, -1), q.T)[0]
    np.testing.assert_allclose(f(T, q)[0], last.T, atol=0)
