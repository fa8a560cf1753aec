"""An empty batch is no fault: every array function gives arrays without samples, in the usual shapes."""

from __future__ import annotations

import numpy as np
import pytest

import screwkin as sk

POSES, TWISTS = np.zeros((0, 4, 4)), np.zeros((0, 6))
ROBOT = sk.load_robot("bioloid")
MECHANISM = sk.closed_mechanism(ROBOT)
STATE = sk.State(POSES, np.zeros((0, 18)))


@pytest.mark.parametrize(
    ("ask", "shape"),
    [
        (lambda: sk.link_poses(ROBOT, STATE), (0, 19, 4, 4)),
        (lambda: sk.jacobian(ROBOT, STATE, "right_foot"), (0, 6, 24)),
        (lambda: sk.momentum(ROBOT, STATE, np.zeros((0, 18)), TWISTS), (0, 6)),
        (lambda: sk.network_matrix(MECHANISM, STATE), (0, 24, 48)),
        (
            lambda: sk.virtual_motion(MECHANISM, STATE, TWISTS, dict.fromkeys(ROBOT.tip_names, TWISTS)),
            (0, 24),
        ),
        (lambda: sk.secondary_rates(MECHANISM, STATE, np.zeros((0, len(MECHANISM.primary)))), (0, 24)),
        (lambda: sk.solve_pose(ROBOT, {"base": POSES, "right_foot": POSES}).state.q, (0, 18)),
    ],
)
def test_results_have_their_shapes(ask, shape):
    assert ask().shape == shape


@pytest.mark.parametrize("method", ["auto", "closed", "hybrid", "newton", "lm", "dls", "pinv"])
def test_limbs_have_branches_but_no_samples(method):
    found = sk.limb_ik(ROBOT, "left_leg", POSES, method=method)
    count = found.q.shape[1]
    assert found.q.shape == (0, count, 6)
    assert found.valid.shape == found.residual.shape == found.iterations.shape == (0, count)
