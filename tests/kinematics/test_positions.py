"""Successive screw displacements and Jacobians of random trees, against exponentials and differences."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.linalg import expm

import screwkin as sk
from screwkin.algebra.se3 import as_array
from screwkin.kinematics.positions import chain_jacobian, screws_in, successive_displacement
from screwkin.model.table import load_robot
from tests.kinematics.machines import array_of, pose, random_state, random_tree, seeds


def bracketed(twist):
    """4 x 4 matrix of a twist [omega; v]."""
    x, y, z, u, v, w = twist
    return np.array([[0, -z, y, u], [z, 0, -x, v], [-y, x, 0, w], [0, 0, 0, 0]], dtype=float)


def exponential_positions(robot, q):
    """Displacements of all links by matrix exponentials of the zero-pose twists, from the base outwards."""
    carried = {robot.base_link: np.eye(4)}
    while len(carried) < len(robot.links):
        for i, joint in enumerate(robot.joints):
            if joint.parent in carried and joint.child not in carried:
                twist = np.array(as_array(joint.screw.twist), dtype=float)
                carried[joint.child] = carried[joint.parent] @ expm(bracketed(twist) * q[i])
    return carried


@given(seed=seeds)
@settings(max_examples=20, derandomize=True)
def test_link_poses_are_products_of_exponentials(seed):
    robot = random_tree(seed)
    state = random_state(robot, seed)
    found = dict(zip(robot.link_names, sk.link_poses(robot, state), strict=True))
    for name, D in exponential_positions(robot, state.q).items():
        wanted = state.T_world_base @ D @ array_of(robot.link(name).frame)
        np.testing.assert_allclose(found[name], wanted, atol=1e-12)
        np.testing.assert_allclose(sk.frame_pose(robot, state, name), wanted, atol=1e-12)


def spatial_velocity(before, after, step):
    """[omega; v of the frame's origin] in world axes, from two poses a small time apart."""
    turn = (after[:3, :3] - before[:3, :3]) @ ((after + before) / 2)[:3, :3].T / step
    return np.r_[turn[2, 1], turn[0, 2], turn[1, 0], (after[:3, 3] - before[:3, 3]) / step]


def moved(state, base_twist, qd, t):
    """The state after a small time at constant twist (told at the base origin) and rates."""
    w, v = base_twist[:3], base_twist[3:]
    T = state.T_world_base.copy()
    T[:3, :3] = expm(bracketed([*w, 0, 0, 0])[:3, :3] * t) @ T[:3, :3]
    T[:3, 3] += v * t
    return sk.State(T, state.q + qd * t)


@given(seed=seeds)
@settings(max_examples=20, derandomize=True)
def test_the_jacobian_of_a_frame_gives_its_velocity_by_differences(seed):
    robot = random_tree(seed)
    state = random_state(robot, seed)
    rng = np.random.default_rng(seed)
    base, qd = rng.uniform(-1, 1, 6), rng.uniform(-1, 1, len(robot.joints))
    name = robot.link_names[rng.integers(len(robot.links))]
    h = 1e-6
    ends = [sk.frame_pose(robot, moved(state, base, qd, t), name) for t in (-h, h)]
    wanted = spatial_velocity(*ends, 2 * h)
    arm = sk.frame_pose(robot, state, name)[:3, 3] - state.T_world_base[:3, 3]
    J = sk.jacobian(robot, state, name)
    np.testing.assert_allclose(J @ np.r_[base, qd], wanted, atol=1e-8)
    there = np.r_[base[:3], base[3:] + np.cross(base[:3], arm)]
    J = sk.jacobian(robot, state, name, base_twist_at="point")
    np.testing.assert_allclose(J @ np.r_[there, qd], wanted, atol=1e-8)
    np.testing.assert_array_equal(J[:, :6], np.eye(6))


@given(seed=seeds)
@settings(max_examples=10, derandomize=True)
def test_expressed_at_another_point_only_velocities_change(seed):
    robot = random_tree(seed)
    state = random_state(robot, seed)
    point = np.random.default_rng(seed).uniform(-1, 1, 3)
    name = robot.link_names[-1]
    here = sk.jacobian(robot, state, name)
    there = sk.jacobian(robot, state, name, point=point, base_twist_at="point")
    arm = point - sk.frame_pose(robot, state, name)[:3, 3]
    np.testing.assert_allclose(there[:3], here[:3], atol=1e-15)
    shifted = here[3:, 6:] + np.cross(here[:3, 6:], arm, axisa=0, axisb=0, axisc=0)
    np.testing.assert_allclose(there[3:, 6:], shifted, atol=1e-13)
    np.testing.assert_array_equal(there[:, :6], np.eye(6))


@pytest.mark.parametrize("seed", range(5))
def test_in_the_zero_pose_the_jacobian_is_the_screw_table(seed):
    robot = random_tree(seed, branching=False)
    state = sk.State(np.eye(4), np.zeros(len(robot.joints)))
    J = sk.jacobian(robot, state, robot.link_names[-1], point=[0, 0, 0])
    table = np.array([as_array(joint.screw.twist) for joint in robot.joints], dtype=float).T
    np.testing.assert_allclose(J[:, 6:], table, atol=1e-15)


def test_joints_off_the_path_have_zero_columns():
    robot = load_robot("bioloid")
    J = sk.jacobian(robot, sk.home(robot), "left_foot")
    moving = np.flatnonzero(J[:, 6:].any(axis=0))
    assert [robot.joint_names[i] for i in moving] == list(robot.joint_names[6:12])


@given(seed=seeds)
@settings(max_examples=20, derandomize=True)
def test_any_reference_frame_gives_the_same_chain(seed):
    """Eq. 3: screws told in a frame of free choice, with the zero-pose transforms before and behind."""
    robot = random_tree(seed, branching=False)
    rng = np.random.default_rng(seed)
    screws = [joint.screw for joint in robot.joints]
    q = list(rng.uniform(-2, 2, len(screws)))
    tip, reference = pose(rng), pose(rng)
    plain = successive_displacement(screws, q, A_ref_k=tip)
    told = successive_displacement(screws_in(reference, screws), q, reference, reference.inverse @ tip)
    np.testing.assert_allclose(array_of(told), array_of(plain), atol=1e-12)


@given(seed=seeds)
@settings(max_examples=10, derandomize=True)
def test_the_jacobian_of_a_chain_is_that_of_the_robot(seed):
    robot = random_tree(seed, branching=False, base="fixed")
    q = np.random.default_rng(seed).uniform(-1, 1, len(robot.joints))
    columns = np.array([as_array(c) for c in chain_jacobian([j.screw for j in robot.joints], list(q))]).T
    J = sk.jacobian(robot, sk.State(np.eye(4), q), robot.link_names[-1], point=np.zeros(3))
    np.testing.assert_allclose(columns, J[:, 6:], atol=1e-12)


def test_a_robot_without_joints_stands_still():
    robot = random_tree(0, joints=0)
    state = random_state(robot, 1)
    wanted = state.T_world_base @ array_of(robot.links[0].frame)
    np.testing.assert_allclose(sk.link_poses(robot, state), [wanted], atol=1e-15)
    assert sk.jacobian(robot, state, "base").shape == (6, 6)


def test_rows_in_any_order_make_the_same_robot():
    """A child's row may stand before its parent's: positions follow the tree, q follows the table."""
    from dataclasses import replace

    robot = random_tree(3)
    order = [4, 0, 6, 2, 5, 1, 3]
    shuffled = replace(robot, joints=tuple(robot.joints[i] for i in order), links=robot.links[::-1])
    state = random_state(robot, 3, (5,))
    other = sk.State(state.T_world_base, state.q[:, order])
    np.testing.assert_allclose(
        sk.link_poses(shuffled, other)[:, ::-1], sk.link_poses(robot, state), atol=1e-14
    )
