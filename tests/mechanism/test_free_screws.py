"""What singular mechanisms leave free, against line geometry, reciprocity and hand calculation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import screwkin as sk
from screwkin.mechanism.closure import close_loops
from screwkin.model.table import load_robot

LEGS = [f"leg_{i}" for i in range(1, 7)]
TOP = (
    'limb = [{ name = "top", kind = "arm", tip = "plate", link = "platform", '
    'frame = { xyz = [0,0,"height"] } }]\n'
)


@pytest.fixture(scope="module")
def fichter():
    """The Stewart platform turned by 90 degrees, driven by its legs."""
    text = load_robot("linkages/stewart").text.replace("\n[robot]", f"\n{TOP}\n[robot]", 1)
    robot = sk.robot_from_text(text, name="stewart-top")
    guided, state = sk.closed_mechanism(robot), sk.home(robot)
    for angle in np.linspace(0, np.pi / 2, 10)[1:]:
        state = close_loops(guided, state, {"plate.rz": angle}).state
    return sk.closed_mechanism(robot, LEGS), state


def leg_lines(robot, state):
    """Six unit forces [m; f] along the legs: from where they stand to where they hold the platform."""
    T = dict(zip(robot.link_names, sk.link_poses(robot, state), strict=True))
    lines = []
    for name in LEGS:
        leg = robot.joint(name)
        foot, s = leg.screw.s0, leg.screw.s
        frame = robot.link(leg.parent).frame.inverse
        here = T[leg.parent]
        point = here[:3, :3] @ np.array([*map(float, frame @ foot)]) + here[:3, 3]
        along = here[:3, :3] @ np.array([*map(float, frame.R @ s)])
        lines.append(np.r_[np.cross(point, along), along])
    return np.array(lines)


def test_fichters_platform_is_free_to_screw_about_its_own_axis(fichter):
    mechanism, state = fichter
    (entry,) = sk.singularity_report(mechanism, state)
    lines = leg_lines(mechanism.robot, state)
    sigma, V = np.linalg.svd(lines)[1:]
    assert sigma[-1] < 1e-15
    pitch = V[-1][5] / V[-1][2]  # reciprocal to all six lines: omega and v along z
    np.testing.assert_allclose(V[-1] / V[-1][2], [0, 0, 1, 0, 0, pitch], atol=1e-12)
    free = entry.free
    assert free.body == "platform"
    np.testing.assert_allclose(free.motion.axis, [0, 0, 1], atol=1e-9)
    np.testing.assert_allclose(free.motion.point[:2], [0, 0], atol=1e-12)
    assert free.motion.pitch == pytest.approx(pitch, abs=1e-12)
    assert free.wrench.pitch == pytest.approx(-pitch, abs=1e-12)
    assert entry.cause.startswith("platform can move while the primary couplings rest, by screw motion")
    assert "free wrench: force along (0, 0, 1)" in entry.cause
    assert len(entry.cause) < 300


def test_the_legs_bear_the_free_wrench_in_two_ways_and_no_other_on_its_axis(fichter):
    """Statics says the same: with that pitch a load on the platform is held, with another one it is not."""
    mechanism, state = fichter
    free = sk.singularity_report(mechanism, state)[0].free
    axis, point = np.array(free.wrench.axis), np.array(free.wrench.point)

    def load(pitch):
        return {"platform": np.r_[np.cross(point, axis) + pitch * axis, axis]}

    forces = sk.static_forces(mechanism, state, load(free.wrench.pitch))
    assert forces.residual < 1e-9
    assert not any(forces.decided[forces.names.index(leg)] for leg in LEGS)
    with pytest.raises(sk.ScrewkinError, match="no actions balance the loads"):
        sk.static_forces(mechanism, state, load(free.wrench.pitch + 0.05))


def dead_centre():
    """The bundled four-bar driven by its rocker, crank and coupler in line."""
    robot = load_robot("linkages/four-bar")
    reach, rocker, ground = 0.06 + 0.18, 0.14, 0.2
    crank = np.arccos((ground**2 + reach**2 - rocker**2) / (2 * ground * reach))
    B = reach * np.array([np.cos(crank), np.sin(crank)])
    swing = np.arctan2(B[1], B[0] - ground)
    at = {"crank": crank, "crank_pin": 0.0, "rocker_pin": swing - crank, "rocker": swing}
    q = np.array([at[name] for name in robot.joint_names])
    return sk.closed_mechanism(robot, ["rocker"]), sk.State(np.eye(4), q), crank


def test_a_four_bar_at_its_dead_centre_bears_a_force_along_crank_and_coupler():
    mechanism, state, crank = dead_centre()
    (entry,) = sk.singularity_report(mechanism, state)
    wrench = entry.free.wrench
    np.testing.assert_allclose(wrench.axis, [np.cos(crank), np.sin(crank), 0], atol=1e-9)
    np.testing.assert_allclose(np.cross(wrench.point, wrench.axis), 0, atol=1e-9)  # through the crank's pivot
    assert (wrench.pitch, entry.free.motion.pitch) == (0, 0)
    assert entry.free.motion.text.startswith("rotation about the axis (0, 0, 1) through ")


def test_a_straight_leg_bears_its_load_without_its_knee():
    robot = load_robot("bioloid")
    home = sk.home(robot)
    q = home.q.copy()
    q[[robot.joint_names.index(f"right_{name}") for name in ("hip_pitch", "knee", "ankle_pitch")]] = 0
    entries = sk.singularity_report(sk.closed_mechanism(robot), sk.State(home.T_world_base, q))
    (leg,) = [entry for entry in entries if entry.near]
    np.testing.assert_allclose(leg.free.wrench.axis, [0, 0, 1], atol=1e-9)
    np.testing.assert_allclose(leg.free.wrench.point[:2], [0, -0.042165], atol=1e-9)
    assert leg.free.wrench.pitch == 0
    assert all(entry.free is None for entry in entries if not entry.near)


@given(seed=st.integers(0, 10**6))
@settings(max_examples=10, deadline=None)
def test_the_free_wrench_of_a_limb_does_no_work_on_its_joints(seed):
    """Random arms brought to a singularity by chance of their wrist: middle axis along the others' plane."""
    rng = np.random.default_rng(seed)
    robot = load_robot("bioloid24")
    mechanism, home = sk.closed_mechanism(robot), sk.home(robot)
    q = home.q + rng.uniform(-0.4, 0.4, len(home.q))
    q[robot.joint_names.index("right_wrist_roll")] = np.pi / 2
    state = sk.State(home.T_world_base, q)
    arm = next(entry for entry in sk.singularity_report(mechanism, state) if entry.limb == "right_arm")
    assert arm.near
    wrench = arm.free.wrench
    axis, point = np.array(wrench.axis), np.array(wrench.point)
    on_line = np.r_[np.cross(point, axis) + wrench.pitch * axis, axis]
    if np.isinf(wrench.pitch):
        on_line = np.r_[axis, np.zeros(3)]
    tip = home.T_world_base[:3, 3]
    J = sk.jacobian(robot, state, "right_hand")
    p = sk.frame_pose(robot, state, "right_hand")[:3, 3] - tip
    columns = [
        6 + i
        for i, name in enumerate(robot.joint_names)
        if name.startswith(("right_sh", "right_el", "right_wr"))
    ]
    twists = J[:, columns]
    twists = np.vstack([twists[:3], twists[3:] - np.cross(twists[:3], p, axis=0)])
    assert np.abs(on_line @ twists).max() < 1e-9
