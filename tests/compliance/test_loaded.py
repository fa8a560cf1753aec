"""Loads, links that bend and several supports: energy by positions alone, laws for random robots."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import screwkin as sk
from screwkin.compliance.cartesian import cartesian_compliance, cartesian_stiffness
from screwkin.compliance.elastic import elastic
from screwkin.compliance.stiffness import static_deflection
from screwkin.errors import SingularError
from screwkin.model.records import Frame
from tests.compliance.elastic_robots import Case, coordinates, energy, random_case, standing
from tests.compliance.test_stiffness import gradient

few = st.integers(0, 5)


def law(examples: int):
    """A few random robots, the same at every run; a failing one is not made smaller, which takes long."""
    phases = (Phase.explicit, Phase.generate)
    return settings(max_examples=examples, deadline=None, derandomize=True, phases=phases)


def settled(case: Case, **changes):
    deflection = static_deflection(*case.arguments, **{**case.options, **changes})
    deflection.raise_on_failure()
    return deflection


def displaced(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Rotation vector and translation from one pose to another."""
    turn = Rotation.from_matrix(after[:3, :3] @ before[:3, :3].T).as_rotvec()
    return np.concatenate([turn, after[:3, 3] - before[:3, 3]])


@pytest.mark.parametrize("seed", range(4))
def test_equilibrium_is_where_the_energy_of_springs_weight_and_forces_is_stationary(seed):
    case = random_case(seed)
    deflection = settled(case)
    x = coordinates(deflection)
    assert np.abs(deflection.theta).max() > 1e-3
    assert np.abs(deflection.links).max() > 1e-5
    slope = gradient(lambda y: energy(case, y, case.support), x, 1e-4)
    np.testing.assert_allclose(slope, 0, rtol=0, atol=2e-7)


@pytest.mark.parametrize("seed", range(4))
def test_with_two_supports_it_is_stationary_along_all_that_leaves_both_where_they_are(seed):
    """The wrench of the second one is the rate of energy by which it would move off; the ground bears all."""
    case = random_case(seed, supports=2, branching=False)
    deflection = settled(case)
    x, (root, held) = coordinates(deflection), case.support
    model, n = elastic(case.robot).robot, len(case.robot.joints)
    commanded = sk.frame_pose(case.robot, case.state, held)

    def off(y):
        q = np.concatenate([case.state.q, np.zeros(len(y) - n)]) + y
        return displaced(commanded, sk.frame_pose(model, sk.State(standing(case, y, root), q), held))

    np.testing.assert_allclose(off(x), 0, rtol=0, atol=1e-11)
    rate = gradient(lambda y: energy(case, y, root), x, 1e-4)
    J = np.array([(off(x + e) - off(x - e)) / 2e-5 for e in np.eye(len(x)) * 1e-5]).T
    np.testing.assert_allclose(rate, J.T @ deflection.wrenches[1], rtol=0, atol=1e-5)
    assert np.abs(deflection.wrenches[1]).max() > 0.05


@law(5)
@given(seed=few, supports=st.integers(1, 2), moments=st.booleans())
def test_the_ground_bears_weight_and_loads(seed, supports, moments):
    """Forces, and moments about the world's origin, of a robot cut free."""
    case = random_case(seed, supports, moments, branching=False)
    deflection = settled(case)
    model, n = elastic(case.robot).robot, len(case.robot.joints)
    x = coordinates(deflection)
    state = sk.State(deflection.state.T_world_base, np.concatenate([case.state.q, np.zeros(len(x) - n)]) + x)
    total = np.zeros(6)

    def add(p, wrench):
        total[:3] += wrench[:3] + np.cross(p, wrench[3:])
        total[3:] += wrench[3:]

    for name, wrench in zip(deflection.supports, deflection.wrenches, strict=True):
        add(sk.frame_pose(model, state, name)[:3, 3], wrench)
    add(sk.center_of_mass(model, state), np.array([0, 0, 0, 0, 0, -9.81 * model.mass]))
    for name, load in case.loads.items():
        if name in case.robot.joint_names:
            continue
        moment = np.zeros(3)
        if len(load) == 6:
            moment = load[:3] - np.cross(sk.frame_pose(case.robot, case.state, name)[:3, 3], load[3:])
        add(sk.frame_pose(model, state, name)[:3, 3], np.concatenate([moment, load[-3:]]))
    np.testing.assert_allclose(total, 0, rtol=0, atol=1e-10)


@law(4)
@given(seed=few, supports=st.integers(1, 2), moments=st.booleans())
def test_compliance_is_how_the_loaded_robot_moves_under_a_little_more(seed, supports, moments):
    """Differences of equilibria; the stiffness is its inverse; symmetric and definite without moments."""
    case = random_case(seed, supports, moments, branching=False)
    frame = "link_3" if "link_3" not in case.support else "link_4"
    settled(case)
    C = cartesian_compliance(*case.arguments[:3], frame, case.stiffness, **case.options)
    place = Frame("probe", frame, case.robot.link(frame).frame)
    probe = replace(case.robot, frames=(*case.robot.frames, place))
    pushes = np.concatenate([np.zeros((1, 6)), np.eye(6), -np.eye(6)]) * 1e-3
    origin, *poses = probed(probe, case, pushes)
    more, less = ([displaced(origin, pose) for pose in part] for part in (poses[:6], poses[6:]))
    columns = (np.array(more) - np.array(less)).T / 2e-3
    np.testing.assert_allclose(C, columns, rtol=0, atol=1e-6 * np.abs(C).max())
    if not moments:
        np.testing.assert_allclose(C, C.T, rtol=0, atol=1e-12)
        assert np.linalg.eigvalsh(C).min() > -1e-15
    if np.linalg.matrix_rank(C, tol=1e-9) < 6:
        with pytest.raises(SingularError, match="rigid in some direction"):
            cartesian_stiffness(*case.arguments[:3], frame, case.stiffness, **case.options)
        return
    K = cartesian_stiffness(*case.arguments[:3], frame, case.stiffness, **case.options)
    np.testing.assert_allclose(K @ C, np.eye(6), rtol=0, atol=1e-9)


def probed(robot, case, pushes):
    """Poses of the probe with further loads (B, 6) [m about its origin; f] on it."""
    p = sk.frame_pose(robot, case.state, "probe")[:3, 3]
    wrenches = np.concatenate([pushes[:, :3] + np.cross(p, pushes[:, 3:]), pushes[:, 3:]], axis=1)
    loads = {**case.loads, "probe": wrenches}
    deflection = static_deflection(
        robot, case.state, case.support, case.stiffness, loads=loads, springs=case.springs
    )
    x, n = coordinates(deflection), len(robot.joints)
    q = np.concatenate([case.state.q, np.zeros(x.shape[1] - n)]) + x
    return sk.frame_pose(elastic(robot).robot, sk.State(deflection.state.T_world_base, q), "probe")


@law(4)
@given(seed=few, supports=st.integers(1, 2))
def test_what_a_force_here_does_there_it_does_here_from_there(seed, supports):
    """Maxwell and Betti: without weight, displacements by little forces are reciprocal."""
    case = replace(random_case(seed, supports, branching=False), springs={})
    a, b = [name for name in case.robot.link_names[1:] if name not in case.support][:2]
    rng = np.random.default_rng(seed)
    f, g = rng.normal(size=(2, 3)) * 1e-4

    def moved(load_on, force, seen):
        d = static_deflection(*case.arguments, gravity=0, loads={load_on: force})
        x, n = coordinates(d), len(case.robot.joints)
        q = np.concatenate([case.state.q, np.zeros(len(x) - n)])
        model = elastic(case.robot).robot
        before = sk.frame_pose(model, sk.State(case.state.T_world_base, q), seen)
        after = sk.frame_pose(model, sk.State(d.state.T_world_base, q + x), seen)
        return after[:3, 3] - before[:3, 3]

    there, here = g @ moved(a, f, b), f @ moved(b, g, a)
    assert abs(there) > 1e-16
    assert there == pytest.approx(here, rel=2e-5)


@law(3)
@given(seed=few, supports=st.integers(1, 2), heading=st.floats(-3, 3))
def test_nothing_changes_when_the_world_is_walked_about_or_an_axis_point_slides(seed, supports, heading):
    case = random_case(seed, supports, moments=True, branching=False)
    before = settled(case)
    turn = np.eye(4)
    turn[:3, :3], turn[:3, 3] = Rotation.from_rotvec([0, 0, heading]).as_matrix(), [3, -2, 1]
    R, p = turn[:3, :3], turn[:3, 3]

    def carried(load):
        if np.ndim(load) == 0 or len(load) == 3:
            return load if np.ndim(load) == 0 else R @ load
        return np.concatenate([R @ load[:3] + np.cross(p, R @ load[3:]), R @ load[3:]])

    joints = tuple(
        replace(j, screw=replace(j.screw, s0=j.screw.s0 + j.screw.s * 0.7)) for j in case.robot.joints
    )
    away = replace(
        case,
        robot=replace(case.robot, joints=joints),
        state=sk.State(turn @ case.state.T_world_base, case.state.q),
        loads={name: carried(load) for name, load in case.loads.items()},
    )
    after = settled(away)
    np.testing.assert_allclose(after.theta, before.theta, rtol=0, atol=1e-11)
    np.testing.assert_allclose(after.links, before.links, rtol=0, atol=1e-11)
    turned = np.kron(np.eye(2), R)
    np.testing.assert_allclose(after.wrenches, before.wrenches @ turned.T, rtol=0, atol=1e-8)


@law(4)
@given(seed=few, supports=st.integers(1, 2))
def test_a_sample_alone_is_the_sample_in_any_batch(seed, supports):
    case = random_case(seed, supports, branching=False)
    rng = np.random.default_rng(seed)
    q = case.state.q + rng.uniform(-0.2, 0.2, (9, len(case.state.q)))
    name, other = case.robot.joint_names[0], next(iter(case.loads))
    k = rng.uniform(200, 800, 9)
    force = rng.normal(size=(9, 3)) * 4

    def of(rows):
        return static_deflection(
            case.robot,
            sk.State(case.state.T_world_base, q[rows]),
            case.support,
            {**case.stiffness, name: k[rows]},
            loads={**case.loads, other: force[rows]},
            springs=case.springs,
        )

    whole = of(slice(None))
    for rows in (np.array([0]), np.array([8]), slice(2, 7)):
        some = of(rows)
        for what in ("converged", "stable", "iterations"):
            np.testing.assert_array_equal(getattr(some, what), getattr(whole, what)[rows])
        for what in ("theta", "links", "change"):
            np.testing.assert_allclose(getattr(some, what), getattr(whole, what)[rows], rtol=0, atol=1e-11)
        np.testing.assert_allclose(some.wrenches, whole.wrenches[rows], rtol=0, atol=1e-8)
    assert whole.converged.all()
