"""Equilibrium by Davies' cut-set law against free bodies, virtual power, energy and hand calculation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import screwkin as sk
from screwkin.errors import InputError, ShapeError, SingularError, UnknownNameError
from screwkin.mechanism.closure import close_loops
from screwkin.mechanism.least_values import least_values
from screwkin.model.table import load_robot
from tests.kinematics.machines import heavy_four_bar, random_loops, random_state, random_tree, seeds

HOLDING = "[[closure]]\nname = 'object'\nlink_a = 'right_hand_link'\nlink_b = 'left_hand_link'\n" + "".join(
    f"frame_{end} = {{ xyz = [0, 0, 'shoulder_z - upper_arm - forearm'] }}\n" for end in "ab"
)


def upright(robot):
    """Its home with y upwards."""
    home = sk.home(robot)
    T = np.eye(4)
    T[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    return sk.State(T, home.q)


def unbalanced(mechanism, state, forces, loads, weights=False):
    """Newton's laws, link by link, without any graph: the largest force or moment that is left."""
    robot, batch = mechanism.robot, forces.values.shape[:-1]
    total = {name: np.zeros((*batch, 6)) for name in (*robot.link_names, "floor")}
    for joint in robot.tree:
        total[joint.child] += forces.wrench(joint.name)
        total[joint.parent] -= forces.wrench(joint.name)
    for contact in forces.system.contacts:
        closure = next((c for c in robot.closures if c.name == contact), None)
        ends = ("floor", robot.frame(contact)[0]) if closure is None else (closure.link_b, closure.link_a)
        total[ends[0]] -= forces.wrench(contact)
        total[ends[1]] += forces.wrench(contact)
    for name, wrench in loads.items():
        total[robot.frame(name)[0]] += wrench
    if weights:
        T = sk.link_poses(robot, state)
        for k, link in enumerate(robot.links):
            com = np.array([*map(float, link.com)]) - np.array([*map(float, link.frame.p)])
            R = np.array([[*map(float, c)] for c in (link.frame.R.x, link.frame.R.y, link.frame.R.z)])
            p = T[..., k, :3, :3] @ (R @ com) + T[..., k, :3, 3]
            f = np.array([0, 0, -9.81 * float(link.mass)]) + 0 * p
            total[link.name] += np.concatenate([np.cross(p, f), f], axis=-1)
    ground = {"floor"} | ({robot.base_link} if robot.base == "fixed" else set())
    welded = [{c.link_a, c.link_b} for c in robot.closures if c.name not in forces.system.contacts]
    worst = 0.0
    for name in robot.link_names:
        group = {name}
        for _ in welded:
            group |= set().union(*[pair for pair in welded if pair & group] or [set()])
        if not group & ground:
            worst = max(worst, float(np.abs(sum(total[link] for link in group)).max()))
    return worst


def test_the_four_bar_carries_ten_newton_metres_by_hand():
    """The coupler is a bar with two pins: one force in all four, and its moment about O is the crank's."""
    mechanism = sk.closed_mechanism(load_robot("linkages/four-bar"))
    home = sk.home(mechanism.robot)
    forces = sk.static_forces(mechanism, home, {"rocker": 10})
    ratio = dict(zip(mechanism.secondary, sk.secondary_rates(mechanism, home, [1.0]), strict=True))["rocker"]
    assert forces["crank"] == pytest.approx(-10 * ratio, rel=1e-12)
    assert forces["crank"] == pytest.approx(-2.4088, abs=5e-5)
    A, B = (sk.frame_pose(mechanism.robot, home, "coupler") @ [x, 0, 0, 1] for x in (0.0, 0.18))
    along = (B - A)[:3] / 0.18
    C = np.array([0.2, 0, 0])
    size = 10 / np.cross(B[:3] - C, along)[2]
    for pin in ("crank", "crank_pin", "rocker_pin", "rocker"):
        np.testing.assert_allclose(np.abs(forces.force(pin)), np.abs(size * along), atol=1e-10)
    np.testing.assert_allclose(np.abs(forces.force("rocker")), [68.27, 37.96, 0], atol=5e-3)
    undecided = [name for name, decided in zip(forces.names, forces.decided, strict=True) if not decided]
    assert undecided[:3] == ["crank.fs", "crank.mu", "crank.mv"]


def test_a_torque_on_the_link_is_the_effort_at_its_pivot():
    mechanism = sk.closed_mechanism(load_robot("linkages/four-bar"))
    home = sk.home(mechanism.robot)
    by_effort = sk.static_forces(mechanism, home, {"rocker": 10})
    by_load = sk.static_forces(mechanism, home, {"rocker": [0, 0, 10, 0, 0, 0]})
    assert by_load["crank"] == pytest.approx(by_effort["crank"], rel=1e-12)


def test_the_weights_of_the_four_bar_load_the_crank():
    robot = heavy_four_bar()
    mechanism = sk.closed_mechanism(robot)
    state = upright(robot)
    forces = sk.static_forces(mechanism, state, weights=True)
    assert forces["crank"] == pytest.approx(0.0895, abs=5e-5)
    assert unbalanced(mechanism, state, forces, {}, weights=True) < 1e-12
    step = 1e-4
    heights = []
    for turn in (-step, step):
        closed = close_loops(mechanism, state, {"crank": state.q[0] + turn}).state
        heights.append(sk.center_of_mass(robot, closed)[2])
    slope = 1.1 * 9.81 * (heights[1] - heights[0]) / (2 * step)
    assert forces["crank"] == pytest.approx(slope, rel=1e-7)


@given(seed=seeds, loops=st.integers(1, 4), draw=st.integers(0, 10**6))
@settings(max_examples=5, deadline=None)
def test_every_link_of_a_random_mechanism_is_in_equilibrium(seed, loops, draw):
    """Loads and weights anywhere: Newton's laws on each link, virtual power on every motion."""
    robot = random_loops(seed, loops)
    mechanism, home = sk.closed_mechanism(robot), sk.home(robot)
    assume(mechanism.mobility == 0 or least_values(mechanism, home.T_world_base, home.q).min() > 1e-3)
    rng = np.random.default_rng(draw)
    loads = {name: rng.uniform(-5, 5, 6) for name in rng.choice(robot.link_names, 3, replace=False)}
    forces = sk.static_forces(mechanism, home, loads, weights=True, active=robot.joint_names)
    scale = max(1.0, np.abs(forces.wrenches).max())
    assert unbalanced(mechanism, home, forces, loads, weights=True) < 1e-10 * scale

    N = sk.network_matrix(mechanism, home)
    motions = np.linalg.svd(N)[2][np.linalg.matrix_rank(N, tol=1e-9) :]
    efforts = np.array([forces[name] for name in robot.joint_names])
    for rates in motions[:, [mechanism.position[name] for name in robot.joint_names]]:
        h = 1e-6
        around = sk.State(np.eye(4), home.q + h * np.array([-1.0, 0.0, 1.0])[:, None] * rates)
        T, com = sk.link_poses(robot, around), sk.center_of_mass(robot, around)
        power = efforts @ rates - 9.81 * robot.mass * (com[2, 2] - com[0, 2]) / (2 * h)
        for name, wrench in loads.items():
            k = robot.link_names.index(name)
            v, p = (T[2, k, :3, 3] - T[0, k, :3, 3]) / (2 * h), T[1, k, :3, 3]
            turning = (T[2, k] - T[0, k])[:3, :3] @ T[1, k, :3, :3].T / (2 * h)
            w = np.array([turning[2, 1], turning[0, 2], turning[1, 0]])
            power += (wrench[:3] - np.cross(p, wrench[3:])) @ w + wrench[3:] @ v
        assert abs(power) < 1e-6 * scale


@given(seed=seeds)
@settings(max_examples=5, deadline=None)
def test_open_arms_need_the_efforts_of_inverse_dynamics_at_rest(seed):
    robot = random_tree(seed, 7, True, "fixed")
    state = random_state(robot, seed, (3,))
    zero = np.zeros((3, 7))
    wanted = sk.inverse_dynamics(robot, state, zero, zero, np.zeros(6), np.zeros(6))
    forces = sk.static_forces(sk.closed_mechanism(robot), state, weights=True)
    found = np.stack([forces[name] for name in robot.joint_names], axis=-1)
    np.testing.assert_allclose(found, wanted[..., -7:], atol=1e-10)
    assert forces.decided.all()


def test_both_feet_carry_the_robot_with_six_internal_freedoms():
    from screwkin.mechanism.action_choice import action_choice

    robot = load_robot("bioloid")
    mechanism, home = sk.closed_mechanism(robot), sk.home(robot)
    choice = action_choice(mechanism)
    assert choice.degree == 6
    assert choice.primary == tuple(f"left_foot.{c}" for c in ("mx", "my", "mz", "fx", "fy", "fz"))
    forces = sk.static_forces(mechanism, home, weights=True)
    both = forces.force("right_foot") + forces.force("left_foot")
    np.testing.assert_allclose(both, [0, 0, 16.677], atol=1e-12)
    np.testing.assert_allclose(forces.force("right_foot")[2], forces.force("left_foot")[2])
    assert unbalanced(mechanism, home, forces, {}, weights=True) < 1e-12
    shifted = sk.static_forces(mechanism, home, imposed={"left_foot.fz": 4, "left_foot.fy": 1}, weights=True)
    np.testing.assert_allclose(shifted.force("right_foot")[1:], [-1, 12.677], atol=1e-12)
    single = sk.static_forces(mechanism, home, weights=True, contacts=["right_foot"])
    assert single.decided.all()
    np.testing.assert_allclose(single.force("right_foot"), [0, 0, 16.677], atol=1e-12)


def test_two_hands_hold_an_object_with_a_chosen_squeeze():
    text = load_robot("bioloid24").text.replace("[[posture]]", f"{HOLDING}\n[[posture]]", 1)
    robot = sk.robot_from_text(text, name="holding")
    mechanism, home = sk.closed_mechanism(robot), sk.home(robot)
    load = {"right_hand": np.array([0, 0, -2.0])}
    squeeze = np.linspace(-8, -1, 5)
    forces = sk.static_forces(mechanism, home, load, {"object.fy": squeeze}, weights=True)
    np.testing.assert_allclose(forces.force("object")[:, 1], squeeze, atol=1e-12)
    p = sk.frame_pose(robot, home, "right_hand")[:3, 3]
    as_wrench = {"right_hand": np.r_[np.cross(p, load["right_hand"]), load["right_hand"]]}
    assert unbalanced(mechanism, home, forces, as_wrench, weights=True) < 1e-9
    feet = forces.force("right_foot") + forces.force("left_foot")
    np.testing.assert_allclose(feet, np.tile([0, 0, 9.81 * robot.mass + 2], (5, 1)), atol=1e-10)


def test_a_helical_joint_turns_torque_into_thrust():
    from dataclasses import replace

    robot = random_tree(0, 1, False, "fixed")
    screw = replace(robot.joints[0].screw, pitch=0.005)
    screw = replace(screw, s=type(screw.s)(0, 0, 1))
    jack = replace(robot, joints=(replace(robot.joints[0], type="helical", screw=screw),))
    forces = sk.static_forces(
        sk.closed_mechanism(jack), sk.State(np.eye(4), [0.3]), {"link_1": [0, 0, -100.0]}
    )
    assert forces["joint_1"] == pytest.approx(0.5)  # 100 N times 5 mm/rad
    np.testing.assert_allclose(forces.force("joint_1"), [0, 0, 100], atol=1e-12)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        ({"loads": {"nose": 1}}, UnknownNameError, "unknown link, tip, frame or joint 'nose'"),
        (
            {"loads": {"coupler": [1, 2]}},
            ShapeError,
            r"loads\['coupler'\] has shape \(2,\); give a force of thr",
        ),
        ({"loads": {"coupler": 3}}, ShapeError, r"loads\['coupler'\] has shape \(\)"),
        ({"loads": {"coupler": [1, np.nan, 0]}}, ShapeError, "NaN or infinity"),
        (
            {"imposed": {"crank": 1, "rocker": 2}},
            InputError,
            "cannot be imposed: the other actions would have r",
        ),
        ({"imposed": {"pin.fs": 1}}, UnknownNameError, "unknown action 'pin.fs'"),
        (
            {"loads": {"coupler": [0, 1, 0]}, "active": []},
            SingularError,
            "nothing holds the motion of crank, ",
        ),
    ],
)
def test_what_cannot_be_answered_is_refused_with_the_reason(call, error, message):
    mechanism = sk.closed_mechanism(load_robot("linkages/four-bar"))
    with pytest.raises(error, match=message):
        sk.static_forces(mechanism, sk.home(mechanism.robot), **call)


def test_a_robot_in_the_air_is_refused():
    robot = load_robot("bioloid")
    with pytest.raises(
        InputError, match=r"floating base and nothing supports it; name tips on the floor .* right_foot"
    ):
        sk.static_forces(sk.closed_mechanism(robot), sk.home(robot), weights=True, contacts=[])


@pytest.mark.slow
def test_jax_states_have_jax_forces_with_derivatives():
    import jax

    with jax.enable_x64(True) if hasattr(jax, "enable_x64") else jax.experimental.enable_x64():
        import jax.numpy as jnp

        robot = heavy_four_bar()
        mechanism, state = sk.closed_mechanism(robot), upright(robot)
        wanted = sk.static_forces(mechanism, state, weights=True)

        def crank(q):
            here = sk.State(jnp.asarray(state.T_world_base), q)
            return sk.static_forces(mechanism, here, weights=True)["crank"]

        value, slope = jax.jit(jax.value_and_grad(crank))(jnp.asarray(state.q))
        assert isinstance(value, jax.Array)
        np.testing.assert_allclose(value, wanted["crank"], rtol=1e-10)
        assert np.isfinite(slope).all()


def test_a_held_closure_transmits_what_its_pin_does():
    """A closure held as a coupling or welded away: the same forces everywhere else."""
    mechanism = sk.closed_mechanism(load_robot("linkages/four-bar"))
    home = sk.home(mechanism.robot)
    welded = sk.static_forces(mechanism, home, {"rocker": 10})
    held = sk.static_forces(mechanism, home, {"rocker": 10}, contacts=["loop"])
    assert len(held.names) == len(welded.names) + 6
    assert held["crank"] == pytest.approx(welded["crank"], rel=1e-12)
    np.testing.assert_allclose(held.force("loop"), -held.force("rocker_pin"), atol=1e-10)
