"""Limbs whose joints are coupled to one another: their inverse kinematics in the joints that lead."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import IDENTITY, UNTURNED, Pose, Vector
from screwkin.errors import InputError
from screwkin.kinematics.status import Status
from screwkin.model.records import CoupledJoint, Joint, Limb, Posture
from screwkin.model.robot import Robot
from tests.kinematics.machines import body, unit

SPATIAL = ("px", "py", "pz", "rx", "ry", "rz")


def robot_of(joints: list[Joint], coupled: list[CoupledJoint], limbs: list[Limb], home: list[float]) -> Robot:
    """A robot on a fixed base of these joints, each of which carries one link."""
    rng = np.random.default_rng(0)
    links = [
        replace(body(rng, name), frame=IDENTITY) for name in ("base", *(j.child for j in (*joints, *coupled)))
    ]
    posture = Posture("home", 0.0, tuple(home))
    return Robot(
        "coupled", "", "", "fixed", "base", tuple(links), tuple(joints), tuple(limbs), (), (), (posture,),
        coupled=tuple(coupled),
    )  # fmt: skip


def following(joint: Joint, leader: str, ratio: float, offset: float = 0.0) -> CoupledJoint:
    return CoupledJoint(**vars(joint), leader=leader, ratio=ratio, offset=offset)


def telescope(bone: float = 0.3) -> Robot:
    """A leg whose knee turns back twice as far as its hip turns: the foot goes up and down a line."""
    hip, knee = (Screw(Vector(0, 1, 0), Vector(0, 0, z)) for z in (0.0, -bone))
    first = Joint("hip", "base", "thigh", "revolute", hip, -1.4, 1.4, 9.0, 9.0)
    second = Joint("knee", "thigh", "shin", "revolute", knee, -2.0, 2.0, 9.0, 9.0)
    limb = Limb("leg", "leg", "shin", "foot", Pose(UNTURNED, Vector(0, 0, -2 * bone)), SPATIAL)
    return robot_of([first], [following(second, "hip", -2.0)], [limb], [0.3])


def geared(seed: int, joints: int, count: int) -> Robot:
    """A random arm of so many joints, some of which follow others with ratios and offsets of their own."""
    rng = np.random.default_rng(seed)
    names = ["base", *(f"link_{i}" for i in range(joints))]
    axes = [Screw(unit(rng), Vector(*rng.uniform(-0.2, 0.2, 3))) for _ in range(joints)]
    rows = [
        Joint(f"joint_{i}", names[i], names[i + 1], "revolute", axis, -2.0, 2.0, 9.0, 9.0)
        for i, axis in enumerate(axes)
    ]
    follow = sorted(rng.choice(joints, count, replace=False).tolist())
    lead = [row.name for i, row in enumerate(rows) if i not in follow]
    coupled = [
        following(
            replace(rows[i], lower=-9.0, upper=9.0),
            str(rng.choice(lead)),
            float(rng.uniform(-1.5, 1.5)),
            float(rng.uniform(-0.3, 0.3)),
        )
        for i in follow
    ]
    limb = Limb("arm", "arm", names[-1], "hand", Pose(UNTURNED, Vector(*rng.uniform(-0.3, 0.3, 3))), SPATIAL)
    return robot_of([row for row in rows if row.name in lead], coupled, [limb], [0.0] * len(lead))


def test_a_telescope_of_two_bones_by_hand() -> None:
    """The foot is 2 l cos(hip) below the hip; the knee's 2 rad leave the hip 1 rad."""
    robot, hip = telescope(), np.array([0.1, 0.6, 0.99, 1.2])
    target = np.zeros((4, 3))
    target[:, 2] = -0.6 * np.cos(hip)
    found = sk.limb_ik(robot, "leg", target)
    assert found.joint_names == ("hip",)
    np.testing.assert_allclose(found.best[:, 0], hip, atol=1e-8)
    assert found.status.tolist() == [0, 0, 0, Status.OUT_OF_LIMITS]
    with pytest.raises(InputError, match="leg has no closed form: it has 2 joints, some coupled"):
        sk.limb_ik(robot, "leg", np.eye(4), method="closed")


@pytest.mark.parametrize("seed", range(4))
def test_poses_of_coupled_limbs_are_reached(seed: int) -> None:
    """Six that lead to poses, three to positions; in the order in which they appear on the way."""
    rng = np.random.default_rng(seed)
    for joints, count in ((7, 1), (5, 2)):
        robot = geared(seed, joints, count)
        n = len(robot.joints)
        q = rng.uniform(-1.5, 1.5, (20, n))
        poses = sk.frame_pose(robot, sk.State(np.eye(4), q), "hand")
        target = poses if n == 6 else poses[:, :3, 3]
        order = [robot.joint_names.index(name) for name in sk.limb_ik(robot, "arm", target[0]).joint_names]
        assert sorted(order) == list(range(n))
        found = sk.limb_ik(robot, "arm", target, guess=(q + rng.uniform(-0.05, 0.05, q.shape))[:, order])
        own = found.best[:, np.argsort(order)]
        assert (found.status == Status.CONVERGED).all()
        assert (np.abs(own) <= 2.0 + 1e-9).all()
        reached = sk.frame_pose(robot, sk.State(np.eye(4), own), "hand")
        reached = reached if n == 6 else reached[:, :3, 3]
        np.testing.assert_allclose(reached, target, atol=1e-7)
        whole = sk.solve_pose(robot, {"hand": target}, sk.State(np.eye(4), own))
        assert whole.ok
        np.testing.assert_allclose(whole.state.q, own, atol=1e-5)


def test_limbs_that_one_joint_leads_are_solved_together() -> None:
    """The left leg's knee follows the right one's: each leg has a hip of its own."""
    rows, coupled, limbs = [], [], []
    for y, side in ((-0.1, "right"), (0.1, "left")):
        axes = [Screw(Vector(0, 1, 0), Vector(0, y, z)) for z in (0.0, -0.3)]
        hip = Joint(f"{side}_hip", "base", f"{side}_thigh", "revolute", axes[0], -2.0, 2.0, 9.0, 9.0)
        knee = Joint(
            f"{side}_knee", f"{side}_thigh", f"{side}_shin", "revolute", axes[1], -2.0, 2.0, 9.0, 9.0
        )
        rows += [hip] if side == "left" else [hip, knee]
        coupled += [following(knee, "right_knee", 0.5, 0.1)] if side == "left" else []
        tip = Pose(UNTURNED, Vector(0, y, -0.6))
        limbs.append(Limb(f"{side}_leg", "leg", f"{side}_shin", f"{side}_foot", tip, SPATIAL))
    robot = robot_of(rows, coupled, limbs, [0.1, 0.2, 0.1])
    q = np.random.default_rng(1).uniform(0.1, 1.0, (20, 3))
    state = sk.State(np.eye(4), q)
    targets = {foot: sk.frame_pose(robot, state, foot) for foot in robot.tip_names}
    near = sk.State(np.eye(4), q + 0.05)
    solved = sk.solve_pose(robot, targets, near)
    assert solved.ok
    np.testing.assert_allclose(solved.state.q, q, atol=1e-9)
    targets["left_foot"][:, 2, 3] += 0.01
    assert (sk.solve_pose(robot, targets, near).status == Status.UNREACHABLE).any(axis=1).all()


def test_jax_arrays_of_coupled_limbs_are_refused() -> None:
    import jax
    import jax.numpy as jnp

    with jax.enable_x64(True), pytest.raises(InputError, match=r"coupled joints here.*NumPy arrays"):
        sk.limb_ik(telescope(), "leg", jnp.array([0.0, 0.0, -0.5]))
