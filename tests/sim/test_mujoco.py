"""The robot in MuJoCo is the robot of the table, and nothing is added to its physics."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import screwkin as sk
from screwkin.errors import InputError, MissingDependencyError, NoSolutionError, RobotRemark
from screwkin.model.robot import Inertia, Joint, Robot
from screwkin.sim.backend import Command, Observation
from screwkin.sim.mujoco import MuJoCoBackend, MuJoCoPhysics
from tests.kinematics.machines import random_tree
from tests.oracles.simulated import without_helical

mujoco = pytest.importorskip("mujoco")


@pytest.fixture(scope="module")
def robot() -> Robot:
    return sk.load_robot("bioloid")


def stand(backend: MuJoCoBackend, state: sk.State, steps: int) -> Observation:
    """Hold the joints of a state for some steps."""
    hold = Command(state.q, np.zeros_like(state.q), state.T_world_base)
    for _ in range(steps):
        backend.step(hold)
    return backend.observe()


def random_state(robot: Robot, seed: int) -> sk.State:
    rng = np.random.default_rng(seed)
    T = np.eye(4)
    T[:3, :3] = Rotation.random(random_state=seed).as_matrix()
    T[:3, 3] = [0.3, -0.2, 1.0]
    return sk.State(T, rng.uniform(-1.5, 1.5, len(robot.joints)))


@pytest.mark.parametrize("seed", [1, 4, 7])
def test_links_stand_where_the_kinematics_say_in_the_table_s_own_frames(seed: int) -> None:
    """Random trees have link frames off their axes, prismatic joints and several branches."""
    robot = without_helical(random_tree(seed))
    backend, state = MuJoCoBackend(robot), random_state(robot, seed)
    seen = backend.reset(state)
    assert np.allclose(seen.T_world_base, state.T_world_base, rtol=0, atol=1e-12)
    poses = sk.link_poses(robot, state)
    for link, pose in zip(robot.links, poses, strict=True):
        if link.name != robot.base_link:
            found = backend.pose(backend.model.body(link.name).id)
            np.testing.assert_allclose(found, pose, rtol=0, atol=1e-12)


def test_joint_inertia_is_the_library_s_with_massless_brackets_merged(robot: Robot) -> None:
    """Joint block of the mass matrix: independent of how the base's rates are written."""
    backend = MuJoCoBackend(robot)
    assert backend.model.nbody < len(robot.links)
    for seed in range(3):
        state = random_state(robot, seed)
        backend.reset(state)
        mujoco.mj_forward(backend.model, backend.data)
        M = np.zeros((backend.model.nv, backend.model.nv))
        for row, unit in zip(M, np.eye(backend.model.nv), strict=True):
            mujoco.mj_mulM(backend.model, backend.data, row, unit)
        dofs = [backend.model.joint(name).dofadr[0] for name in robot.joint_names]
        expected = sk.mass_matrix(robot, state)[6:, 6:]
        np.testing.assert_allclose(M[np.ix_(dofs, dofs)], expected, rtol=0, atol=1e-14)


def test_a_lifted_robot_falls_freely_without_any_damping(robot: Robot) -> None:
    """Semi-implicit Euler drops g dt^2 n (n+1) / 2."""
    home = sk.home(robot)
    T = home.T_world_base.copy()
    T[2, 3] += 2.0
    backend = MuJoCoBackend(robot)
    backend.reset(sk.State(T, home.q))
    seen = stand(backend, home, 300)
    assert T[2, 3] - seen.T_world_base[2, 3] == pytest.approx(9.81 * 1e-6 * 300 * 301 / 2, rel=1e-9)
    assert seen.contacts == ()


def test_a_standing_robot_weighs_what_it_weighs_over_its_centre_of_mass(robot: Robot) -> None:
    """Statics: the floor bears the weight, with its centre of pressure below the CoM."""
    home = sk.home(robot)
    backend = MuJoCoBackend(robot)
    backend.reset(home)
    seen = stand(backend, home, 400)
    force = sum((np.array(c.force) for c in seen.contacts), np.zeros(3))
    moment = sum((np.cross(c.point, c.force) for c in seen.contacts), np.zeros(3))
    com = sk.center_of_mass(robot, sk.State(seen.T_world_base, seen.q))
    assert force[2] == pytest.approx(robot.mass * 9.81, rel=1e-4)
    assert np.abs(force[:2]).max() < 1e-3
    zmp = np.array([-moment[1], moment[0]]) / force[2]
    assert np.abs(zmp - com[:2]).max() < 1e-5
    ankle = seen.ankle_wrench.sum(axis=0)
    np.testing.assert_allclose(ankle, np.concatenate([moment, force]), rtol=0, atol=2e-3)
    assert {c.link for c in seen.contacts} == {"right_foot_link", "left_foot_link"}
    assert len(seen.contacts) == 8


def test_on_both_feet_it_does_not_creep(robot: Robot) -> None:
    home = sk.home(robot)
    backend = MuJoCoBackend(robot)
    backend.reset(home)
    seen = stand(backend, home, 1000)
    assert np.rad2deg(abs(np.arctan2(seen.T_world_base[1, 0], seen.T_world_base[0, 0]))) < 1e-3
    assert np.abs(seen.T_world_base[:2, 3] - home.T_world_base[:2, 3]).max() < 2e-5


def test_rigid_servos_are_where_they_are_commanded_while_they_carry_the_robot(robot: Robot) -> None:
    """A squat: a position servo of 150 N m/rad would lag by milliradians."""
    home = sk.home(robot)
    backend = MuJoCoBackend(robot)
    backend.reset(home)
    stand(backend, home, 100)
    rate = 0.3 * home.q  # deeper, soles flat: hip, knee and ankle of home add up to nothing
    q = home.q.copy()
    for _ in range(200):
        backend.step(Command(q, rate, home.T_world_base))
        q = q + backend.dt * rate
    seen = backend.observe()
    assert np.abs(seen.q - q).max() < 2e-5
    assert np.abs(seen.torque).max() > 0.1


def test_motors_stay_within_their_effort(robot: Robot) -> None:
    weak = replace(robot, joints=tuple(replace(joint, effort=0.2) for joint in robot.joints))
    backend, home = MuJoCoBackend(weak), sk.home(robot)
    backend.reset(home)
    largest = max(np.abs(stand(backend, home, 1).torque).max() for _ in range(300))
    assert 0.19 < largest <= 0.2 + 1e-9


def test_friction_beyond_its_cone_slips(robot: Robot) -> None:
    """On a floor of friction 0.1 under gravity tilted by 0.2, the robot slides by (0.2 - 0.1) g t^2 / 2."""
    home = sk.home(robot)
    backend = MuJoCoBackend(robot, MuJoCoPhysics(friction=0.1))
    backend.reset(home)
    stand(backend, home, 300)
    start = backend.observe().T_world_base[0, 3]
    backend.model.opt.gravity[0] = 0.2 * 9.81
    moved = stand(backend, home, 300).T_world_base[0, 3] - start
    assert moved == pytest.approx(0.1 * 9.81 * 0.3**2 / 2, rel=0.02)


def test_the_same_commands_end_in_the_same_bytes_after_a_reset(robot: Robot) -> None:
    home, backend = sk.home(robot), MuJoCoBackend(robot)
    ends = []
    for _ in range(2):
        backend.reset(home)
        ends.append(stand(backend, home, 150))
    assert np.array_equal(ends[0].T_world_base, ends[1].T_world_base)
    assert np.array_equal(ends[0].torque, ends[1].torque)


def weighty(robot: Robot) -> Robot:
    """A linkage whose bars have a mass."""
    bar = Inertia(1e-5, 1e-4, 1e-4)
    return replace(robot, links=tuple(replace(link, mass=0.1, inertia=bar) for link in robot.links))


@pytest.mark.parametrize("name", ["linkages/four-bar", "linkages/slider-crank", "linkages/rssr"])
def test_loops_stay_closed_while_a_servo_drives_them(name: str) -> None:
    """All joints but the first are limp: the loop's constraint alone moves them."""
    robot = weighty(sk.load_robot(name))
    first = robot.joint_names[0]
    limp = replace(
        robot, joints=tuple(j if j.name == first else replace(j, passive=True) for j in robot.joints)
    )
    home = sk.State(np.eye(4), np.array(robot.posture("home").q))
    backend = MuJoCoBackend(limp)
    backend.reset(home)
    rate = np.zeros(len(robot.joints))
    rate[0] = 1.0
    q = home.q.copy()
    for _ in range(300):
        backend.step(Command(q, rate, home.T_world_base))
        q = q + backend.dt * rate
    seen = backend.observe()
    assert seen.q[0] - home.q[0] == pytest.approx(0.3, abs=1e-4)
    closed = sk.close_loops(sk.closed_mechanism(robot), sk.State(np.eye(4), seen.q), {first: seen.q[0]})
    np.testing.assert_allclose(seen.q, closed.state.q, rtol=0, atol=2e-4)


def test_a_sole_that_no_box_has_touches_with_its_own_corners(robot: Robot) -> None:
    """Without boxes the robot stands on the polygons of its table alone."""
    bare = replace(robot, links=tuple(replace(link, boxes=()) for link in robot.links))
    backend, home = MuJoCoBackend(bare), sk.home(robot)
    backend.reset(home)
    seen = stand(backend, home, 300)
    assert len(seen.contacts) == 8
    assert sum(c.force[2] for c in seen.contacts) == pytest.approx(robot.mass * 9.81, rel=1e-4)
    corners = sorted((round(c.point[0], 4), round(c.point[1], 4)) for c in seen.contacts)
    x = [corner.x for sole in robot.soles for corner in sole.corners]
    assert (min(corners)[0], max(corners)[0]) == pytest.approx((min(x), max(x)), abs=1e-4)


def test_a_joint_without_room_between_its_limits_rests_there(robot: Robot) -> None:
    elbow, home = robot.joint_names.index("left_elbow"), sk.home(robot)
    at = float(home.q[elbow])
    joints = [replace(j, lower=at, upper=at) if i == elbow else j for i, j in enumerate(robot.joints)]
    stiff = replace(robot, joints=tuple(joints), postures=(robot.posture("home"),))
    assert stand(MuJoCoBackend(stiff), home, 100).q[elbow] == pytest.approx(at, abs=2e-4)


def helical(joint: Joint) -> Joint:
    return replace(joint, type="helical", screw=replace(joint.screw, pitch=0.01))


def test_what_mujoco_cannot_simulate_is_refused_by_name(robot: Robot) -> None:
    with pytest.raises(InputError, match="no helical joints, but it has right_hip_yaw"):
        MuJoCoBackend(replace(robot, joints=(helical(robot.joints[0]), *robot.joints[1:])))
    bare = replace(robot, soles=(), links=tuple(replace(link, boxes=()) for link in robot.links))
    with pytest.raises(InputError, match="has neither box nor sole"):
        MuJoCoBackend(bare)


def test_without_mujoco_the_message_says_what_to_install(
    robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(MissingDependencyError, match="python -m pip install mujoco") as caught:
        MuJoCoBackend(robot)
    assert caught.value.exit_code == 2


def test_a_window_without_a_display_is_refused(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    with pytest.raises(InputError, match="DISPLAY is not set"):
        MuJoCoBackend(robot, gui=True)


def test_an_inertia_that_no_body_has_is_balanced_and_said() -> None:
    text = sk.load_robot("bioloid").text.replace(
        "inertia = { box = [0.06, 0.10, 0.14] }",
        "inertia = { xx = 1e-3, yy = 1e-3, zz = 3e-3, xy = 0, xz = 0, yz = 0 }",
    )
    with pytest.warns(RobotRemark):
        robot = sk.robot_from_text(text)
    backend = MuJoCoBackend(robot)
    assert "inertia balanced of torso" in backend.settings["remarks"]
    assert not any("balanced" in text for text in MuJoCoBackend(sk.load_robot("bioloid")).settings["remarks"])


def test_a_simulation_that_explodes_says_so_and_does_not_begin_anew(robot: Robot) -> None:
    """MuJoCo puts itself back into its first state then, as if nothing had been."""
    backend, state = MuJoCoBackend(robot), sk.home(robot)
    stand(backend, state, 1)
    backend.data.qvel[:] = 1e12
    q, rest = np.asarray(state.q), np.zeros(len(state.q))
    with pytest.raises(NoSolutionError, match=r"unstable after 0\.00"):
        backend.step(Command(q, rest, state.T_world_base))
