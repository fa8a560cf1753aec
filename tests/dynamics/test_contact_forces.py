"""Forces of contacts: equilibrium, the least of all, internal forces, friction, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import screwkin as sk
from screwkin.dynamics.contact import ContactPatch, contact_points
from screwkin.errors import InputError, NoSolutionError, ShapeError, UnknownNameError
from tests.kinematics.machines import random_state, random_tree, serial_limb

WEIGHT = 16.677


@pytest.fixture(scope="module")
def robot():
    return sk.load_robot("bioloid")


@pytest.fixture(scope="module")
def walk(robot):
    return sk.walk(robot, sk.load_gait("walk"), steps=2)


def at_rest(robot):
    return sk.home(robot), np.zeros(len(robot.joints)), np.zeros(len(robot.joints))


def moving(robot, seed):
    """Any posture, anywhere, in any motion."""
    rng = np.random.default_rng(seed)
    home = sk.home(robot)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = turn * np.sign(np.linalg.det(turn)), rng.uniform(-5, 5, 3)
    state = sk.State(T, home.q + rng.uniform(-0.5, 0.5, len(home.q)))
    motion = rng.uniform(-2, 2, (2, len(home.q)))
    return state, *motion, *rng.uniform(-2, 2, (2, 6))


def about_world(robot, state, tips, wrenches):
    """Sum of wrenches at tips, about the world's origin."""
    total = np.zeros((*wrenches.shape[:-2], 6))
    for k, tip in enumerate(tips):
        p = sk.frame_pose(robot, state, tip)[..., :3, 3]
        m, f = wrenches[..., k, :3], wrenches[..., k, 3:]
        total = total + np.concatenate([m + np.cross(p, f), f], axis=-1)
    return total


def by_jacobians(robot, state, qd, qdd, base, rate, tips, wrenches):
    """Joint efforts of the open tree less what the contacts' wrenches do, by virtual power."""
    force = sk.inverse_dynamics(robot, state, qd, qdd, base, rate)
    for k, tip in enumerate(tips):
        force = force - sk.jacobian(robot, state, tip).T @ wrenches[k]
    return force


@given(
    seed=st.integers(0, 10_000),
    tips=st.sampled_from(
        [("right_foot",), ("left_foot", "right_foot"), ("right_foot", "left_foot", "left_hand")]
    ),
)
@settings(max_examples=25)
def test_contacts_supply_what_the_motion_needs_and_joints_the_rest(robot, seed, tips):
    state, qd, qdd, base, rate = moving(robot, seed)
    forces = sk.contact_forces(robot, state, qd, qdd, tips, None, base, rate)
    needed = sk.ground_wrench(robot, state, qd, qdd, base, rate)
    scale = 1 + np.abs(forces.wrenches).max()
    np.testing.assert_allclose(about_world(robot, state, tips, forces.wrenches), needed, atol=1e-10 * scale)
    left = by_jacobians(robot, state, qd, qdd, base, rate, tips, forces.wrenches)
    np.testing.assert_allclose(left[:6], 0, atol=1e-11 * scale)
    np.testing.assert_allclose(left[6:], forces.efforts, atol=1e-11 * scale)


@given(seed=st.integers(0, 10_000))
@settings(max_examples=15)
def test_the_forces_at_the_corners_are_the_least_of_all_that_carry(robot, seed):
    """By the pseudo-inverse of the map from all corners' forces to the total wrench."""
    state, qd, qdd, base, rate = moving(robot, seed)
    tips, weights = ("right_foot", "left_hand", "left_foot"), np.random.default_rng(seed).uniform(0.2, 2, 3)
    forces = sk.contact_forces(robot, state, qd, qdd, dict(zip(tips, weights, strict=True)), None, base, rate)
    total, maps = [], []
    for tip, weight in zip(tips, weights, strict=True):
        T = sk.frame_pose(robot, state, tip)
        points = [T[:3, :3] @ np.array([*p], float) for p in contact_points(robot, ContactPatch(tip))]
        scale = np.sqrt(weight / len(points))
        for point in points:
            arm = np.cross(point, np.eye(3)).T
            maps.append((tip, scale * np.vstack([arm, np.eye(3)])))
            total.append(scale * np.vstack([np.cross(point + T[:3, 3], np.eye(3)).T, np.eye(3)]))
    corner = np.linalg.pinv(np.hstack(total)) @ sk.ground_wrench(robot, state, qd, qdd, base, rate)
    for k, tip in enumerate(tips):
        own = [m @ corner[3 * i : 3 * i + 3] for i, (name, m) in enumerate(maps) if name == tip]
        np.testing.assert_allclose(forces.wrenches[k], sum(own), atol=1e-8 * (1 + np.abs(corner).max()))


def test_both_feet_of_the_standing_bioloid_carry_16_677_N(robot):
    state, *rest = at_rest(robot)
    forces = sk.contact_forces(robot, state, *rest)
    assert forces.tips == ("right_foot", "left_foot")
    assert forces.wrenches[:, 5].sum() == pytest.approx(WEIGHT, abs=1e-12)
    np.testing.assert_allclose(forces.wrenches[:, 3:5], 0, atol=1e-12)
    np.testing.assert_allclose(forces["left_foot"][5], WEIGHT / 2, rtol=1e-12)
    with pytest.raises(UnknownNameError, match="valid: right_foot, left_foot"):
        forces["right_hand"]


@given(seed=st.integers(0, 10_000))
@settings(max_examples=15)
def test_a_wrench_that_is_imposed_on_one_of_two_feet_is_met_and_the_other_foot_balances(robot, seed):
    """Six internal freedoms: the wishes for both feet decide, and what contradicts the motion is shared."""
    state, qd, qdd, base, rate = moving(robot, seed)
    wish = np.random.default_rng(seed).uniform(-3, 3, 6)
    tips = ("right_foot", "left_foot")
    total = sk.ground_wrench(robot, state, qd, qdd, base, rate)
    p = [sk.frame_pose(robot, state, tip)[:3, 3] for tip in tips]
    rest = total - np.r_[wish[:3] + np.cross(p[0], wish[3:]), wish[3:]]
    other = np.r_[rest[:3] - np.cross(p[1], rest[3:]), rest[3:]]
    internal = {"right_foot": wish, "left_foot": other}
    forces = sk.contact_forces(robot, state, qd, qdd, tips, internal, base, rate)
    np.testing.assert_allclose(forces.wrenches, [wish, other], atol=1e-10 * (1 + np.abs(other).max()))


def test_squeezing_feet_together_changes_no_sum(robot):
    state, *rest = at_rest(robot)
    squeeze = {"right_foot": [0, 0, 0, 0, 2.0, 0], "left_foot": [0, 0, 0, 0, -2.0, 0]}
    plain, squeezed = (
        sk.contact_forces(robot, state, *rest),
        sk.contact_forces(robot, state, *rest, None, squeeze),
    )
    more = squeezed.wrenches - plain.wrenches
    np.testing.assert_allclose(about_world(robot, state, plain.tips, more), 0, atol=1e-12)
    np.testing.assert_allclose(more[:, 4], [2, -2], atol=1e-12)
    assert np.abs(squeezed.efforts - plain.efforts).max() > 0.1


def test_a_foot_in_the_air_bears_nothing_and_a_batch_is_its_samples(robot, walk):
    contacts = dict(zip(walk.feet, walk.contact.T, strict=True))
    state = sk.State(walk.T_world_base, walk.q)
    motion = (walk.base_twist, walk.base_acceleration)
    forces = sk.contact_forces(robot, state, walk.qd, walk.qdd, contacts, None, *motion)
    for k, tip in enumerate(forces.tips):
        assert not forces.wrenches[~walk.contact[:, k], k].any()
        assert forces[tip][walk.contact[:, k], 5].min() > -WEIGHT
    needed = sk.ground_wrench(robot, state, walk.qd, walk.qdd, *motion)
    np.testing.assert_allclose(about_world(robot, state, forces.tips, forces.wrenches), needed, atol=1e-11)
    alone = walk.contact.sum(axis=1) == 1
    assert alone.any()
    for i in np.flatnonzero(alone)[::20]:
        tip = walk.feet[int(np.argmax(walk.contact[i]))]
        p = walk.T_world_tip[tip][i, :3, 3]
        exact = np.r_[needed[i, :3] - np.cross(p, needed[i, 3:]), needed[i, 3:]]
        np.testing.assert_allclose(forces[tip][i], exact, atol=1e-11)
        one = sk.State(walk.T_world_base[i], walk.q[i])
        motion_i = walk.base_twist[i], walk.base_acceleration[i]
        here = sk.contact_forces(robot, one, walk.qd[i], walk.qdd[i], [tip], None, *motion_i)
        np.testing.assert_allclose(here.efforts, forces.efforts[i], atol=1e-11)


def handy():
    """Three joints and a hand that stands on four points."""
    robot = serial_limb(random_tree(1, 3))
    square = ((0.1, 0.1, 0), (0.1, -0.1, 0), (-0.1, -0.1, 0), (-0.1, 0.1, 0.02))
    return robot, ContactPatch("hand", square)


def test_compiled_forces_are_those_of_the_plain_call():
    robot, patch = handy()
    state, motion = random_state(robot, 2, (7,)), np.random.default_rng(3).uniform(-1, 1, (7, 18))
    qd, qdd, base, rate = motion[:, :3], motion[:, 3:6], motion[:, 6:12], motion[:, 12:]
    plain = sk.contact_forces(robot, state, qd, qdd, [patch], None, base, rate)
    every = {"qd": qd, "qdd": qdd, "base_twist": base, "base_acceleration": rate}
    bound = sk.bind(robot, ("contact_distribution", (patch,)), optional=("base_twist", "base_acceleration"))
    found = bound(state, weights=np.ones((7, 1)), **every)
    np.testing.assert_allclose(found.wrenches, plain.wrenches, atol=1e-11)
    np.testing.assert_allclose(found.efforts, plain.efforts, atol=1e-11)


def test_within_friction_nothing_changes_where_limits_hold(robot):
    state, *rest = at_rest(robot)
    plain, limited = (
        sk.contact_forces(robot, state, *rest),
        sk.contact_forces(robot, state, *rest, friction=0.5),
    )
    np.testing.assert_array_equal(plain.wrenches, limited.wrenches)


@given(seed=st.integers(0, 10_000), friction=st.sampled_from([0.3, 0.8]))
@settings(max_examples=12)
def test_forces_within_friction_are_the_nearest_ones_by_another_solver(robot, seed, friction):
    """Feet that are wished to slide apart: the program against SLSQP, and its limits by hand."""
    from scipy.optimize import minimize

    rng = np.random.default_rng(seed)
    state, *rest = at_rest(robot)
    apart = np.r_[0.3 * rng.normal(size=3), 6 * rng.normal(size=2), 2 * rng.normal()]
    wish = {"right_foot": apart, "left_foot": -apart}
    tips = ("right_foot", "left_foot")
    forces = sk.contact_forces(robot, state, *rest, tips, wish, friction=friction)
    needed = sk.ground_wrench(robot, state, *rest)
    np.testing.assert_allclose(about_world(robot, state, tips, forces.wrenches), needed, atol=1e-9)
    free = sk.contact_forces(robot, state, *rest, tips, wish)
    places, start = [], []
    for k, tip in enumerate(tips):
        own = np.array([[*p] for p in contact_points(robot, ContactPatch(tip))], float)
        own = own @ sk.frame_pose(robot, state, tip)[:3, :3].T
        grasp = np.hstack([np.vstack([np.cross(p, np.eye(3)).T, np.eye(3)]) for p in own])
        start.append((np.linalg.pinv(grasp) @ free.wrenches[k]).reshape(-1, 3))
        places.append(grasp)
    near = np.vstack(start)
    angles = 2 * np.pi * np.arange(8) / 8
    limit = friction * np.cos(np.pi / 8)

    def inside(x):
        f = x.reshape(-1, 3)
        return np.concatenate([limit * f[:, 2] - np.cos(a) * f[:, 0] - np.sin(a) * f[:, 1] for a in angles])

    def total(x):
        wrenches = np.array([G @ part for G, part in zip(places, x.reshape(2, -1), strict=True)])
        return about_world(robot, state, tips, wrenches) - needed

    solved = minimize(
        lambda x: ((x - near.ravel()) ** 2).sum() / 2, near.ravel(), jac=lambda x: x - near.ravel(),
        constraints=[{"type": "ineq", "fun": inside}, {"type": "eq", "fun": total}],
        method="SLSQP", options={"ftol": 1e-12, "maxiter": 500},
    )  # fmt: skip
    assert solved.success
    theirs = np.array([G @ part for G, part in zip(places, solved.x.reshape(2, -1), strict=True)])
    np.testing.assert_allclose(forces.wrenches, theirs, atol=2e-5)


def test_a_push_beyond_friction_or_beyond_the_sole_has_no_answer(robot):
    state, *rest = at_rest(robot)
    push = np.array([0, 0, 0, 1.5, 0, 0])  # m/s^2, forward
    forces = sk.contact_forces(robot, state, *rest, base_acceleration=push, friction=0.6)
    assert forces.wrenches[:, 3].sum() == pytest.approx(robot.mass * 1.5)
    with pytest.raises(NoSolutionError, match="no forces within friction at right_foot, left_foot"):
        sk.contact_forces(robot, state, *rest, base_acceleration=push, friction=0.15)
    both = np.array([push, 3 * push])  # tips over, whatever the friction
    with pytest.raises(NoSolutionError, match="sample 1: no forces within friction"):
        sk.contact_forces(robot, state, *rest, base_acceleration=both, friction=10.0)


def test_hands_hold_by_one_point_or_by_a_grip(robot):
    state, *rest = at_rest(robot)
    grip = ContactPatch("right_hand", ((0.01, 0, 0), (-0.01, 0, 0), (0, 0.01, 0), (0, 0, 0.01)))
    hanging = sk.contact_forces(robot, state, *rest, [grip])
    p = sk.frame_pose(robot, state, "right_hand")[:3, 3]
    com = sk.center_of_mass(robot, state)
    np.testing.assert_allclose(hanging["right_hand"][3:], [0, 0, WEIGHT], atol=1e-11)
    np.testing.assert_allclose(hanging["right_hand"][:3], np.cross(com - p, [0, 0, WEIGHT]), atol=1e-11)
    with pytest.raises(NoSolutionError, match="right_hand, left_hand touch in points that are in line"):
        sk.contact_forces(robot, state, *rest, ["right_hand", "left_hand"])
    with pytest.raises(InputError, match="has a moment, which a contact in one point cannot bear"):
        sk.contact_forces(robot, state, *rest, ["right_foot", "right_hand"], {"right_hand": np.ones(6)})
    pulled = sk.contact_forces(
        robot, state, *rest, ["right_foot", "left_foot", "right_hand"], {"right_hand": [0, 0, 0, 1, 2, 3]}
    )
    assert not pulled["right_hand"][:3].any()


def test_what_is_wrong_is_refused_by_name(robot):
    state, *rest = at_rest(robot)
    for contacts, message in (
        ("right_foot", "give a list of tips"),
        ([], "no contacts; name the tips"),
        (["right_foot", ContactPatch("right_foot", ((0, 0, 0),))], "names a tip twice"),
        ({"right_foot": -1.0}, "a weight of right_foot is negative or NaN"),
        ([ContactPatch("right_foot", ((0, 0, 0), (0.1, 0, 0)))], "at least three that are not in line"),
        ([ContactPatch("right_foot", ((0, 0, 0), (0.1, 0, 0), (0.2, 0, 0)))], "at least three that are not"),
        ([ContactPatch("right_foot", normal=(0, 0, 2.0))], "give a unit vector"),
        ([ContactPatch("right_foot", friction=-1.0)], "give a positive number"),
        ([3], "a contact is the int 3"),
    ):
        with pytest.raises(InputError, match=message):
            sk.contact_forces(robot, state, *rest, contacts)
    with pytest.raises(UnknownNameError, match="unknown tip 'right_fot'"):
        sk.contact_forces(robot, state, *rest, ["right_fot"])
    with pytest.raises(UnknownNameError, match="unknown tip in contact 'left_foot'"):
        sk.contact_forces(robot, state, *rest, ["right_foot"], {"left_foot": np.zeros(6)})
    with pytest.raises(ShapeError, match=r"internal\['right_foot'\] has shape \(3,\)"):
        sk.contact_forces(robot, state, *rest, ["right_foot"], {"right_foot": np.zeros(3)})
    with pytest.raises(NoSolutionError, match="sample 1: nothing is in contact"):
        sk.contact_forces(robot, state, *rest, {"right_foot": np.array([1.0, 0.0])})
    fixed = replace(robot, base="fixed")
    with pytest.raises(InputError, match="fixed base, which takes what contacts leave"):
        sk.contact_forces(fixed, state, *rest)
    soleless = replace(robot, soles=())
    with pytest.raises(InputError, match="no contacts; name the tips"):
        sk.contact_forces(soleless, state, *rest)


def test_traced_arrays_give_traced_forces():
    import jax

    robot, patch = handy()
    state, rest = random_state(robot, 2), np.zeros(3)
    plain = sk.contact_forces(robot, state, rest, rest, [patch])
    with jax.enable_x64(True):
        T, q = jax.numpy.asarray(state.T_world_base), jax.numpy.asarray(state.q)

        def traced(q):
            return sk.contact_forces(robot, sk.State(T, q), rest, rest, [patch]).wrenches

        np.testing.assert_allclose(np.asarray(jax.jit(traced)(q)), plain.wrenches, atol=1e-11)
        with pytest.raises(NoSolutionError, match="nothing is in contact"):
            sk.contact_forces(robot, sk.State(T, q), rest, rest, {patch: 0.0})
        rough = replace(patch, friction=0.5)
        with pytest.raises(InputError, match="friction of NumPy arrays"):
            sk.contact_forces(robot, sk.State(T, q), rest, rest, [rough])
