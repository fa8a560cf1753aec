"""Springs and dampers of passive joints: MuJoCo's own, energy, statics, and what planning holds."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings

import screwkin as sk
from screwkin.errors import InputError, TableError
from screwkin.model.robot import Robot
from screwkin.model.sprung import sprung_joints, stiffened, with_springs
from tests.compliance.test_passive import ARM, at
from tests.kinematics.machines import random_loops, random_state, random_tree, seeds
from tests.linked import GAIT_OF_LEAVES, leaf_legs
from tests.oracles.closed import in_mujoco, random_motion
from tests.oracles.welded import welded

SPRING = "passive = true\nstiffness = 5\nrest = 0.2\ndamping = 0.1"

HEAVY = ARM.replace("mass = 0", "mass = 0.5\ncom = [0.05, 0, 0.3]\ninertia = { box = [0.05, 0.05, 0.3] }")


def with_random_springs(robot: Robot, seed: int, share: float = 0.5) -> Robot:
    """About half of the joints passive, on springs and dampers."""
    rng = np.random.default_rng(seed + 31)
    joints = [
        replace(
            joint,
            passive=True,
            stiffness=float(rng.uniform(1, 30)),
            rest=float(rng.uniform(-0.5, 0.5)),
            damping=float(rng.choice([0.0, 0.7])),
        )
        if rng.random() < share
        else joint
        for joint in robot.joints
    ]
    return replace(robot, joints=tuple(joints), text="", path="")


def sprung_arm(spring: str = SPRING) -> Robot:
    """Two bars of some mass on a free shoulder with a spring."""
    return sk.robot_from_text(HEAVY.replace("FREE", spring))


@given(seed=seeds)
@settings(max_examples=5, deadline=None)
def test_a_tree_on_springs_falls_as_in_mujoco(seed: int) -> None:
    """Open trees: MuJoCo's accelerations under the same efforts, to rounding."""
    import mujoco

    tree = random_tree(seed, base="fixed")
    robot = with_random_springs(replace(tree, joints=tuple(_revolute(j) for j in tree.joints)), seed)
    state, rng = random_state(robot, seed), np.random.default_rng(seed)
    state = sk.State(np.eye(4), state.q)
    qd, efforts = rng.uniform(-1, 1, (2, 7))
    model, dofs, _ = welded(robot, np.eye(3))
    data = mujoco.MjData(model)
    data.qpos[dofs], data.qvel[dofs], data.qfrc_applied[dofs] = state.q, qd, efforts
    mujoco.mj_forward(model, data)
    found = sk.forward_dynamics(robot, state, qd, efforts)[6:]
    np.testing.assert_allclose(found, data.qacc[dofs], rtol=0, atol=1e-9 * (1 + np.abs(found).max()))
    np.testing.assert_allclose(
        sk.inverse_dynamics(robot, state, qd, found)[6:],
        efforts,
        rtol=0,
        atol=1e-9 * (1 + np.abs(found).max()),
    )


def _revolute(joint: Any) -> Any:
    return (
        joint
        if joint.type != "helical"
        else replace(joint, type="revolute", screw=replace(joint.screw, pitch=0))
    )


@pytest.mark.parametrize("case", [(0, 1, "fixed", False), (1, 1, "floating", False), (2, 2, "fixed", True)])
def test_loops_on_springs_need_what_mujoco_says_beside_its_own(case: Any) -> None:
    """Helical joints and welds, springs amid the loops."""
    robot = with_random_springs(random_loops(*case), case[0], 0.3)
    assert sprung_joints(robot)
    motion = random_motion(robot, case[0])
    found = in_mujoco(robot, motion)
    assert max(found.values()) < 1e-9, found


def test_power_of_dampers_is_the_loss_of_energy() -> None:
    """Kinetic, potential and elastic energy, by central differences along the motion of no efforts."""
    robot = with_random_springs(random_tree(4, base="fixed"), 4)
    state, qd = random_state(robot, 4), np.random.default_rng(4).uniform(-1, 1, 7)
    fixed = sk.State(np.eye(4), state.q)
    qdd = sk.forward_dynamics(robot, fixed, qd, np.zeros(7))[6:]
    k, rest, d = (
        np.array([getattr(j, key) for j in robot.joints]) for key in ("stiffness", "rest", "damping")
    )

    def energy(t: float) -> float:
        q, rate = state.q + t * qd + t**2 / 2 * qdd, qd + t * qdd
        here = sk.State(np.eye(4), q)
        kinetic = rate @ sk.mass_matrix(robot, here)[6:, 6:] @ rate / 2
        height = float(sk.center_of_mass(robot, here)[2])
        return float(kinetic + 9.81 * robot.mass * height + k @ (q - rest) ** 2 / 2)

    h = 1e-5
    lost = (energy(h) - energy(-h)) / (2 * h)
    assert lost == pytest.approx(-(d @ qd**2), rel=1e-5)
    assert d @ qd**2 > 0.1


def test_where_springs_and_weight_balance_nothing_accelerates() -> None:
    """Statics and dynamics meet: the spring of the table yields from its own rest."""
    robot, start = sprung_arm(), at(0.3, 0.4)
    bent = sk.static_deflection(robot, start, "base", {"elbow": 1e9})
    bent.raise_on_failure()
    settled = bent.state.q
    held = sk.inverse_dynamics(robot, bent.state, np.zeros(2), np.zeros(2))[6:]
    falling = sk.forward_dynamics(robot, bent.state, np.zeros(2), held * [0, 1])[6:]
    np.testing.assert_allclose(falling, 0, atol=1e-8)
    assert abs(held[0]) < 1e-9
    named = sk.static_deflection(robot, start, "base", {"elbow": 1e9, "shoulder": 5.0})
    assert abs(named.state.q[0] - settled[0]) > 0.01  # a spring that is asked for is relaxed as commanded


def test_a_robot_without_springs_has_no_further_operations() -> None:
    from screwkin.dynamics.quantities import inverse_dynamics

    plain, sprung = (inverse_dynamics.program(sprung_arm(text)) for text in ("passive = true", SPRING))
    assert 0 < sprung.operations - plain.operations <= 6


def test_planning_takes_leaves_as_rigid_and_their_links_as_one() -> None:
    robot = leaf_legs()
    rigid = stiffened(robot)
    assert len(robot.joints) - len(rigid.joints) == len(sprung_joints(robot)) == 4
    assert rigid.mass == pytest.approx(float(robot.mass))
    whole, home = sk.home(robot), sk.home(rigid)
    np.testing.assert_array_equal(with_springs(robot, home.q), whole.q)
    np.testing.assert_allclose(
        sk.center_of_mass(rigid, home), sk.center_of_mass(robot, whole), rtol=0, atol=1e-15
    )
    still = np.zeros(len(robot.joints))
    np.testing.assert_allclose(
        sk.ground_wrench(rigid, home, still[4:], still[4:]),
        sk.ground_wrench(robot, whole, still, still),
        rtol=0,
        atol=1e-12,
    )
    plain = sk.load_robot("linkages/tarsus-legs")
    assert stiffened(plain) is plain


def test_leaf_legs_walk_as_rigid_ones_and_what_would_move_leaves_refuses() -> None:
    robot = leaf_legs()
    plan = sk.load_gait("walk").replace(rate=10.0, **GAIT_OF_LEAVES)
    walked, rigid = (sk.walk(one, plan, 1) for one in (robot, stiffened(robot)))
    np.testing.assert_array_equal(walked.zmp, rigid.zmp)
    np.testing.assert_array_equal(walked.q[:, list(sprung_joints(robot))], 0.0)
    poses = sk.tip_poses(robot, sk.State(walked.T_world_base, walked.q))
    for k, tip in enumerate(robot.tip_names):
        np.testing.assert_allclose(poses[:, k], walked.T_world_tip[tip], rtol=0, atol=1e-9)
    assert walked.meta["robot"]["table"] == robot.text
    gait = sk.load_gait("preview").replace(waist_height=GAIT_OF_LEAVES["waist_height"], rate=10.0)
    squat = sk.stand(robot, gait, (0, 0, -0.005, 1.0))
    assert squat.q.shape[1] == len(robot.joints)
    assert not squat.q[:, list(sprung_joints(robot))].any()
    foot = sk.frame_pose(robot, sk.home(robot), "right_foot")
    for ask in (
        lambda: sk.limb_ik(robot, "right_leg", foot),
        lambda: sk.solve_pose(robot, {"base": np.eye(4), "right_foot": foot}, sk.home(robot)),
    ):
        with pytest.raises(InputError, match=r"joints on springs \(right_shin_leaf, .*stiffened\(robot\)"):
            ask()


@pytest.mark.parametrize(
    ("spring", "message"),
    [
        ("stiffness = 5", "is 5 at a joint that has a motor. Write passive = true"),
        ("passive = true\nstiffness = -1", "is -1. Write a finite number of at least 0"),
        ("passive = true\nrest = 0.1", "is 0.1 without a spring"),
        ("passive = true\ndamping = inf", "damping: inf is not finite"),
        ('stiffness = 5\nmimic = { joint = "elbow" }', "at a joint that follows another one"),
    ],
)
def test_a_spring_that_cannot_be_is_named(spring: str, message: str) -> None:
    with pytest.raises(TableError) as error:
        sprung_arm(spring)
    assert message in str(error.value)


def test_a_table_of_springs_is_written_and_read_and_its_mirror_image_rests_opposite() -> None:
    from screwkin.model.robot import robot_toml

    robot = sprung_arm()
    again = sk.robot_from_text(robot_toml(robot))
    assert again.joints[0].passive
    assert (again.joints[0].stiffness, again.joints[0].rest, again.joints[0].damping) == (5, 0.2, 0.1)
    legs = leaf_legs()
    named = dict(zip(legs.joint_names, legs.joints, strict=True))
    assert named["left_shin_leaf"].stiffness == named["right_shin_leaf"].stiffness > 0


def test_links_that_bend_are_refused_where_motion_would_take_them_as_rigid() -> None:
    from tests.compliance.test_links import AT_REST, beam

    with pytest.raises(
        InputError, match=r"links that bend \(bar\), and forward_dynamics takes links as rigid"
    ):
        sk.forward_dynamics(beam(), AT_REST, np.zeros(1), np.zeros(1))
