"""The singularity report: the right limb, the right joints, and the cause that geometry has prepared."""

from __future__ import annotations

import numpy as np
import pytest

import screwkin as sk
from screwkin.errors import SingularError
from screwkin.kinematics.status import Status
from screwkin.mechanism.least_values import least_values
from screwkin.mechanism.singularity import singularity_report
from screwkin.model.table import load_robot

THIGH, CALF = 0.0773829, 0.0780929


@pytest.fixture(scope="module")
def bioloid():
    return load_robot("bioloid")


@pytest.fixture(scope="module")
def mechanism(bioloid):
    return sk.closed_mechanism(bioloid)


def posed(robot, **joints):
    """Home with some joints elsewhere."""
    state = sk.home(robot)
    for name, value in joints.items():
        state.q[robot.joint_names.index(name)] = value
    return state


def report(mechanism, **joints):
    state = posed(mechanism.robot, **joints)
    return {entry.limb: entry for entry in singularity_report(mechanism, sk.network_matrix(mechanism, state))}


def hip_on_ankle_roll_axis():
    """Knee and ankle pitch for which the hip centre lies on the axis of ankle roll, from the triangle."""
    knee = np.pi / 2
    hip = np.array([-np.sin(knee) * THIGH, CALF + np.cos(knee) * THIGH])  # from the ankle, in the calf
    return {"right_knee": knee, "right_ankle_pitch": np.arctan2(-hip[1], hip[0]) + np.pi}


def test_at_home_nothing_is_near_a_singularity(mechanism):
    found = report(mechanism)
    assert list(found) == ["right_leg", "left_leg", "right_arm", "left_arm"]
    assert not any(entry.near for entry in found.values())
    assert all(entry.cause == "" for entry in found.values())
    home = sk.home(mechanism.robot)
    expected = least_values(mechanism, home.T_world_base, home.q)
    np.testing.assert_allclose([entry.sigma for entry in found.values()], expected)


CASES = [
    (
        {"right_knee": 0.0},
        "right_leg",
        ("right_hip_pitch", "right_knee", "right_ankle_pitch"),
        "right_knee is near straight or fully folded: its axis lies in one plane with right_hip_pitch",
    ),
    (
        {"left_hip_roll": np.pi / 2},
        "left_leg",
        ("left_hip_yaw", "left_hip_pitch"),
        "the axes of left_hip_yaw, left_hip_pitch fall together: left_hip_roll between them is near",
    ),
    (
        {"left_hip_roll": -np.pi / 2},
        "left_leg",
        ("left_hip_yaw", "left_hip_pitch"),
        "left_hip_roll between them is near +-90 deg",
    ),
    (
        hip_on_ankle_roll_axis(),
        "right_leg",
        ("right_hip_yaw", "right_hip_roll", "right_ankle_roll"),
        "right_ankle_roll passes through the point where those of right_hip_yaw, right_hip_roll meet",
    ),
    (
        {**hip_on_ankle_roll_axis(), "right_hip_yaw": 0.3, "right_hip_roll": 0.2, "right_ankle_roll": 0.2},
        "right_leg",
        ("right_hip_yaw", "right_hip_roll", "right_hip_pitch", "right_ankle_roll"),
        "the axis of right_ankle_roll passes through the point where those of",
    ),
    (
        {"left_elbow": 0.0},
        "left_arm",
        ("left_shoulder_pitch", "left_elbow", "left_hand.ry"),
        "left_elbow is near straight or fully folded",
    ),
    (
        {"left_elbow": 0.0, "left_shoulder_roll": -0.4},
        "left_arm",
        ("left_shoulder_pitch", "left_elbow", "left_hand.rx", "left_hand.ry", "left_hand.rz"),
        "left_elbow is near straight or fully folded",
    ),
    (
        {"right_shoulder_roll": np.pi / 2},
        "right_arm",
        ("right_shoulder_pitch", "right_shoulder_roll", "right_hand.rx", "right_hand.ry", "right_hand.rz"),
        "can both turn about the line through the two points where they meet",
    ),
]


@pytest.mark.parametrize(("joints", "limb", "dependent", "cause"), CASES)
def test_a_singular_limb_is_named_with_its_joints_and_its_cause(mechanism, joints, limb, dependent, cause):
    found = report(mechanism, **joints)
    assert [name for name, entry in found.items() if entry.near] == [limb]
    assert found[limb].sigma < 1e-9
    assert found[limb].joints == dependent
    assert cause in found[limb].cause


@pytest.mark.parametrize(("joints", "limb"), [(case[0], case[1]) for case in CASES])
def test_what_is_called_singular_has_lost_a_direction_of_motion(bioloid, joints, limb):
    """Independent of the mechanism: the limb's Jacobian loses rank, for an arm its rows of velocity."""
    state = posed(bioloid, **joints)
    chosen = bioloid.limb(limb)
    columns = [6 + i for i in bioloid.path_to(chosen.link)]
    J = sk.jacobian(bioloid, state, chosen.tip)[:, columns]
    J = J if chosen.kind == "leg" else J[3:]
    assert np.linalg.svd(J, compute_uv=False)[-1] < 1e-9


def test_near_a_singularity_the_limb_is_told_already(mechanism):
    found = report(mechanism, right_knee=0.03)["right_leg"]
    assert found.near
    assert 1e-3 < found.sigma < 0.02
    assert found.cause.startswith("right_knee is near straight")


def test_a_wrist_at_ninety_degrees_and_a_straight_arm_are_told_for_six_joint_arms():
    mechanism = sk.closed_mechanism(load_robot("bioloid24"))
    found = report(mechanism, right_wrist_roll=np.pi / 2)["right_arm"]
    assert found.cause.endswith("right_wrist_roll between them is near +-90 deg")
    found = report(mechanism, right_elbow=0.0, right_wrist_roll=0.3, right_wrist_yaw=0.2)["right_arm"]
    assert found.cause.startswith("right_elbow is near straight or fully folded")


def test_of_a_trajectory_the_worst_sample_is_reported(bioloid, mechanism):
    knee = np.array([0.9, 0.4, 0.001, 0.5])
    state = sk.home(bioloid)
    q = np.tile(state.q, (4, 1))
    q[:, bioloid.joint_names.index("left_knee")] = knee
    N = sk.network_matrix(mechanism, sk.State(state.T_world_base, q))
    leg = singularity_report(mechanism, N)[1]
    assert (leg.limb, leg.sample, leg.near) == ("left_leg", 2, True)


def test_rates_of_a_singular_limb_raise_with_limb_sample_and_cause(bioloid, mechanism):
    state = sk.home(bioloid)
    q = np.tile(state.q, (3, 1))
    q[2, bioloid.joint_names.index("right_knee")] = 0.0
    bent = sk.State(state.T_world_base, q)
    with pytest.raises(
        SingularError, match=r"right_leg, sample 2: singular; right_knee is near straig"
    ) as caught:
        sk.secondary_rates(mechanism, bent, np.zeros(24))
    assert (caught.value.limb, caught.value.sample, caught.value.exit_code) == ("right_leg", 2, 3)
    rates, status = sk.secondary_rates(mechanism, bent, np.zeros(24), on_singular="status")
    assert list(status) == [Status.CONVERGED, Status.CONVERGED, Status.SINGULAR]
    assert not rates.any()
