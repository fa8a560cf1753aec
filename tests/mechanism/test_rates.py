"""Secondary rates: against each limb's own Jacobian, in batches, at singular samples, and under JAX."""

from __future__ import annotations

import numpy as np
import pytest

import screwkin as sk
from screwkin.errors import InputError, ShapeError
from screwkin.kinematics.status import Status
from screwkin.mechanism.rates import block_name, solve_rates
from screwkin.model.table import load_robot
from tests.kinematics.machines import planar_arm, spherical_wrist


@pytest.fixture(scope="module")
def bioloid():
    return load_robot("bioloid")


@pytest.fixture(scope="module")
def mechanism(bioloid):
    return sk.closed_mechanism(bioloid)


def states(robot, count=6, seed=0):
    rng = np.random.default_rng(seed)
    home = sk.home(robot)
    q = home.q + rng.uniform(-0.2, 0.2, (count, len(home.q)))
    return sk.State(np.tile(home.T_world_base, (count, 1, 1)), q)


def motion(seed=0):
    rng = np.random.default_rng(seed)
    twists = {name: rng.uniform(-0.2, 0.2, 6) for name in ("right_foot", "left_foot")}
    twists |= {name: rng.uniform(-0.2, 0.2, 3) for name in ("right_hand", "left_hand")}
    return rng.uniform(-0.2, 0.2, 6), twists


def test_davies_rates_are_those_of_each_limbs_inverse_jacobian(bioloid, mechanism):
    """An independent path: J of the limb alone, told at its tip, solves for the tip's motion on the waist."""
    state = states(bioloid)
    base, tips = motion()
    rates = sk.secondary_rates(mechanism, state, sk.virtual_motion(mechanism, state, base, tips))
    qd = np.stack([rates[:, mechanism.secondary.index(n)] for n in bioloid.joint_names], axis=-1)
    for limb in bioloid.limbs:
        J = sk.jacobian(bioloid, state, limb.tip)
        T = sk.frame_pose(bioloid, state, limb.tip)
        arm = T[:, :3, 3] - state.T_world_base[:, :3, 3]
        carried = np.concatenate([np.tile(base[:3], (6, 1)), base[3:] + np.cross(base[:3], arm)], axis=1)
        moved = carried + np.einsum("tij,tj->ti", J[..., 6:], qd)
        if limb.kind == "leg":
            np.testing.assert_allclose(moved, np.tile(tips[limb.tip], (6, 1)), atol=1e-12)
        else:
            np.testing.assert_allclose(moved[:, 3:], np.tile(tips[limb.tip], (6, 1)), atol=1e-12)


def test_rates_are_linear_in_the_motion_and_zero_at_rest(bioloid, mechanism):
    state = states(bioloid)
    base, tips = motion()
    once = sk.virtual_motion(mechanism, state, base, tips)
    assert not sk.secondary_rates(mechanism, state, 0 * once).any()
    single, double = (sk.secondary_rates(mechanism, state, k * once) for k in (1, 2))
    np.testing.assert_allclose(double, 2 * single, atol=1e-13)


def test_the_order_of_the_batch_does_not_enter(bioloid, mechanism):
    state = states(bioloid)
    base, tips = motion()
    primary = sk.virtual_motion(mechanism, state, base, tips)
    rates = sk.secondary_rates(mechanism, state, primary)
    one = sk.State(state.T_world_base[3], state.q[3])
    np.testing.assert_allclose(rates[3], sk.secondary_rates(mechanism, one, primary[3]), atol=1e-12)


def test_one_state_serves_a_batch_of_motions(bioloid, mechanism):
    primary = np.random.default_rng(0).uniform(-1, 1, (4, 2, 24))
    rates, status = sk.secondary_rates(mechanism, sk.home(bioloid), primary, on_singular="status")
    assert rates.shape == (4, 2, 24)
    assert status.shape == (4, 2)
    single = sk.secondary_rates(mechanism, sk.home(bioloid), primary[2, 1])
    np.testing.assert_allclose(rates[2, 1], single, atol=1e-12)


def test_limbs_are_independent_blocks_when_the_waist_is_imposed(mechanism):
    assert [block_name(mechanism, circuits) for circuits, _ in mechanism.blocks] == [
        "right_leg", "left_leg", "right_arm", "left_arm",
    ]  # fmt: skip
    assert all(len(inside) == 6 for _, inside in mechanism.blocks)


def test_a_waist_that_follows_joins_the_limbs_that_carry_it(bioloid, mechanism):
    primary = (set(mechanism.primary) - {"waist.pz", "waist.px"}) | {"right_knee", "right_hip_pitch"}
    joined = sk.closed_mechanism(bioloid, primary=primary)
    names = [block_name(joined, circuits) for circuits, _ in joined.blocks]
    assert names == ["right_leg + left_leg + right_arm + left_arm"]


def test_a_singular_limb_is_solved_as_well_as_it_can_and_spares_the_others(bioloid, mechanism):
    state = states(bioloid)
    state.q[2, bioloid.joint_names.index("right_knee")] = 0.0
    base, tips = motion()
    primary = sk.virtual_motion(mechanism, state, base, tips)
    N = sk.network_matrix(mechanism, state)
    solution = solve_rates(mechanism, state.T_world_base, state.q, primary)
    np.testing.assert_array_equal(np.argwhere(solution.singular), [[2, 0]])
    full = np.empty((6, 48))
    full[:, mechanism.primary_columns], full[:, mechanism.secondary_columns] = primary, solution.values
    error = np.abs(np.einsum("tij,tj->ti", N, full))
    assert error[2, :6].max() > 1e-3, "the wanted motion is impossible there"
    assert np.delete(error, 2, axis=0).max() < 1e-12
    assert error[2, 6:].max() < 1e-12
    assert np.abs(solution.values).max() < 100, "least squares stay bounded"


@pytest.mark.parametrize("robot", [planar_arm(), spherical_wrist()], ids=["arm", "wrist"])
def test_under_jax_the_rates_are_the_same_and_have_derivatives(x64, robot):
    import jax
    import jax.numpy as jnp

    mechanism, home = sk.closed_mechanism(robot), sk.home(robot)
    primary, step = np.linspace(0.1, 0.4, 3), np.array([0.3, -0.2, 0.5])

    def rates(q):
        state = sk.State(jnp.asarray(home.T_world_base), q)
        return sk.secondary_rates(mechanism, state, jnp.asarray(primary), on_singular="status")

    def along(q, dq):
        return jax.jvp(lambda x: rates(x)[0], (q,), (dq,))[1], rates(q)

    slope, (found, status) = jax.jit(along)(jnp.asarray(home.q), jnp.asarray(step))
    assert int(status) == Status.CONVERGED
    np.testing.assert_allclose(found, sk.secondary_rates(mechanism, home, primary), atol=1e-12)
    ends = [
        sk.secondary_rates(mechanism, sk.State(home.T_world_base, home.q + h * step), primary)
        for h in (1e-6, -1e-6)
    ]
    np.testing.assert_allclose(slope, (ends[0] - ends[1]) / 2e-6, atol=1e-7)


def test_an_overconstrained_loop_has_the_same_rates_under_jax(x64):
    """Three secondary joints, six equations: a pseudo-inverse, batched under strict promotion."""
    import jax
    import jax.numpy as jnp

    mechanism = sk.closed_mechanism(load_robot("linkages/four-bar"))
    home = sk.home(mechanism.robot)
    batch = sk.State(jnp.asarray(np.tile(home.T_world_base, (2, 1, 1))), jnp.asarray(np.tile(home.q, (2, 1))))
    primary = jnp.asarray([[0.5], [1.5]])
    found, status = jax.jit(lambda s: sk.secondary_rates(mechanism, sk.State(*s), primary, "status"))(
        (batch.T_world_base, batch.q)
    )
    np.testing.assert_array_equal(status, [0, 0])
    np.testing.assert_allclose(found, sk.secondary_rates(mechanism, home, np.array(primary)), atol=1e-12)


def test_wrong_shapes_and_words_are_refused(bioloid, mechanism):
    home = sk.home(bioloid)
    with pytest.raises(ShapeError, match=r"primary_rates has shape \(23,\), expected \(..., 24\)"):
        sk.secondary_rates(mechanism, home, np.zeros(23))
    with pytest.raises(InputError, match="on_singular is 'ignore'; valid: raise, status"):
        sk.secondary_rates(mechanism, home, np.zeros(24), on_singular="ignore")
    with pytest.raises(InputError, match=r"tip_twists has no left_foot, but left_foot\.px"):
        sk.virtual_motion(mechanism, home, np.zeros(6), {"right_foot": np.zeros(6)})
    _, tips = motion()
    with pytest.raises(
        InputError, match="the twist of right_foot has 3 components, but its rotations are primary"
    ):
        sk.virtual_motion(mechanism, home, np.zeros(6), {**tips, "right_foot": np.zeros(3)})
    driven = sk.closed_mechanism(load_robot("linkages/four-bar"))
    with pytest.raises(InputError, match=r"crank.*no virtual chain"):
        sk.virtual_motion(driven, sk.home(driven.robot), None, {})
