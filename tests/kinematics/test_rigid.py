"""Matrices that are, nearly are, or are no poses."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import screwkin as sk
from screwkin.errors import InputError, ShapeError
from screwkin.kinematics.rigid import foreign, nearest_poses


def poses(count=1000, seed=0):
    rng = np.random.default_rng(seed)
    T = np.tile(np.eye(4), (count, 1, 1))
    T[:, :3, :3], T[:, :3, 3] = Rotation.random(count, rng=rng).as_matrix(), rng.uniform(-1, 1, (count, 3))
    return T, rng


def test_deviation_is_the_largest_entry_that_is_wrong():
    T, rng = poses()
    T[:, :3, :3] += rng.uniform(-0.01, 0.01, (1000, 3, 3))
    T[5, 3, 1], T[6, 3, 3] = 0.5, 1.75
    T[7, :, 0] *= -1
    R = T[:, :3, :3]
    expected = np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max(axis=(1, 2))
    expected[5:8] = 0.5, 0.75, np.inf
    np.testing.assert_allclose(nearest_poses(T)[0], expected, atol=1e-14)


@pytest.mark.parametrize("count", [4, 300, 20_000])
def test_what_is_no_pose_is_found_in_batches_of_every_size(count):
    T, rng = poses(count)
    assert not foreign(T).any()
    bad = rng.random(count) < 0.5
    T[bad, :3, 0] *= 1 + 1e-5
    np.testing.assert_array_equal(foreign(T), bad)
    np.testing.assert_array_equal([foreign(one) for one in T[:50]], bad[:50])
    np.testing.assert_array_equal(foreign(T.reshape(2, -1, 4, 4)[:, :2]), bad.reshape(2, -1)[:, :2])


def test_the_nearest_pose_has_the_rotation_of_the_polar_decomposition():
    T, rng = poses()
    T[:, :3, :3] += rng.uniform(-1e-6, 1e-6, (1000, 3, 3))
    _, exact = nearest_poses(T)
    U, _, V = np.linalg.svd(T[:, :3, :3])
    np.testing.assert_allclose(exact[:, :3, :3], U @ V, atol=1e-15)
    np.testing.assert_array_equal(exact[:, :3, 3], T[:, :3, 3])
    np.testing.assert_array_equal(exact[:, 3], np.tile([0.0, 0.0, 0.0, 1.0], (1000, 1)))


@pytest.mark.parametrize("change", [(0, 0, -2.0), (3, 1, 0.1), (1, 2, 1e-5)])
def test_large_batches_with_a_matrix_that_is_no_pose_are_refused(change):
    row, column, by = change
    T, _ = poses()
    T[321, row, column] += by
    robot = sk.load_robot("poppy12")
    with pytest.raises(InputError, match=r"sample \(321,\)"):
        sk.limb_ik(robot, "left_leg", T)
    with pytest.raises(ShapeError, match=r"\(321,\)"):
        sk.frame_pose(robot, sk.State(T, np.zeros(12)), "left_foot")
