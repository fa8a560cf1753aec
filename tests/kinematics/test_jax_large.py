"""Large batches of JAX arrays: programs inside XLA, the numbers of NumPy, gradients of the formulas."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import screwkin as sk
from screwkin.compiler import native

pytestmark = pytest.mark.usefixtures("x64")

ROBOT = sk.load_robot("poppy12")
MECHANISM = sk.closed_mechanism(ROBOT)


def given(count: int):
    rng = np.random.default_rng(0)
    T = np.tile(np.eye(4), (count, 1, 1))
    T[:, :3, :3] = Rotation.random(count, rng=rng).as_matrix()
    T[:, :3, 3] = rng.uniform(-1, 1, (count, 3))
    return T, rng.uniform(-1, 1, (count, 12)), rng.uniform(-1, 1, (count, 12)), rng.uniform(-1, 1, (count, 6))


@pytest.mark.parametrize(
    "ask",
    [
        lambda state, qd, twist: sk.frame_pose(ROBOT, state, "left_foot"),
        lambda state, qd, twist: sk.jacobian(ROBOT, state, "left_foot", point=twist[..., :3]),
        lambda state, qd, twist: sk.momentum(ROBOT, state, qd),
        lambda state, qd, twist: sk.network_matrix(MECHANISM, state),
    ],
)
def test_the_numbers_are_those_of_numpy(ask) -> None:
    T, q, qd, twist = given(1000 + 5)
    expected = ask(sk.State(T, q), qd, twist)
    found = jax.jit(lambda T, q, qd, twist: ask(sk.State(T, q), qd, twist))(T, q, qd, twist)
    assert isinstance(found, jax.Array)
    np.testing.assert_allclose(found, expected, atol=1e-12)
    eager = ask(sk.State(jnp.asarray(T), jnp.asarray(q)), jnp.asarray(qd), jnp.asarray(twist))
    np.testing.assert_allclose(eager, expected, atol=1e-12)


@pytest.mark.skipif(native.compiler() is None, reason="no C compiler here")
def test_machine_code_runs_inside_compiled_functions_whatever_the_batch() -> None:
    def text(count: int) -> str:
        T, q, *_ = given(count)
        f = jax.jit(lambda T, q: sk.center_of_mass(ROBOT, sk.State(T, q)))
        return str(f.lower(T, q).as_text())

    assert all("screwkin." in text(count) for count in (1, 999, 1000))


def test_a_function_of_one_sample_over_vmap_is_the_batch() -> None:
    T, q, *_ = given(50)

    def poses(T, q):
        return sk.link_poses(ROBOT, sk.State(T, q))

    over, whole = jax.jit(jax.vmap(poses)), jax.jit(poses)
    np.testing.assert_array_equal(over(T, q), whole(T, q))
    assert over.lower(T, q).as_text().count("custom_call @screwkin.") == 1


def test_gradients_of_a_large_batch_are_those_of_its_samples() -> None:
    T, q, *_ = given(1000)
    weights = np.array([0.3, -0.5, 0.8])

    def height(q, T):
        return (sk.center_of_mass(ROBOT, sk.State(T, q)) ** 2 @ weights).sum()

    found = jax.jit(jax.grad(height))(q, T)
    np.testing.assert_allclose(found[:9], jax.jit(jax.grad(height))(q[:9], T[:9]), atol=1e-12)


def test_gradients_pass_through_vmap_of_a_large_batch() -> None:
    T, q, *_ = given(1000)
    q = np.stack([q, -q])

    def squares(q):
        return (jax.vmap(lambda q: sk.center_of_mass(ROBOT, sk.State(T, q)))(q) ** 2).sum()

    found = jax.grad(squares)(jnp.asarray(q))
    one = jax.grad(lambda q: (sk.center_of_mass(ROBOT, sk.State(T[:9], q)) ** 2).sum())
    for k in range(2):
        np.testing.assert_allclose(found[k, :9], one(jnp.asarray(q[k, :9])), atol=1e-12)
