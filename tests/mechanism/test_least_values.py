"""Least singular values of secondary blocks by a program against LAPACK's."""

from __future__ import annotations

import numpy as np
import pytest

import screwkin as sk
from screwkin.algebra.se3 import pose_from_array, unstack
from screwkin.compiler.run import run
from screwkin.mechanism.choice import characteristic_length, normalised
from screwkin.mechanism.least_values import block_values, least_values
from screwkin.mechanism.network import coupling_twists, network_matrix
from screwkin.mechanism.rates import block_rows, singular_values
from tests.kinematics.machines import random_state


def network_of(mechanism, state):
    twists = coupling_twists(mechanism, pose_from_array(state.T_world_base).R, unstack(state.q))
    return network_matrix(mechanism, twists, (len(state.q),))


def largest_values(mechanism, N):
    """Largest singular value (B, blocks)."""
    scaled, columns = normalised(N, characteristic_length(mechanism.robot)), mechanism.secondary_columns
    parts = [scaled[:, block_rows(c)][:, :, [columns[i] for i in own]] for c, own in mechanism.blocks]
    return np.stack([np.linalg.norm(A, 2, axis=(1, 2)) for A in parts], axis=1)


@pytest.mark.parametrize("name", ["bioloid", "bioloid24", "poppy12"])
def test_programs_give_the_values_of_lapack_in_any_posture(name):
    """Bases turned at random, since the rotations of a hand's virtual chain do not turn with them."""
    robot = sk.load_robot(name)
    mechanism = sk.closed_mechanism(robot)
    state = random_state(robot, 3, (400,))
    state.q[:7] = 0.0  # straight knees
    N = network_of(mechanism, state)
    expected = singular_values(mechanism, N)
    found = least_values(mechanism, state.T_world_base, state.q)
    assert (np.abs(found - expected) <= 1e-12 * largest_values(mechanism, N)).all()
    program = block_values(robot, mechanism.primary, mechanism.secondary)
    assert (run(program, vars(state))["sure"] > 0).mean() > 0.99


@pytest.mark.parametrize(
    ("imposed", "instead", "largest"),
    [
        ("right_hip_pitch", "right_foot.px", 6),
        ("right_hand.rx", "right_hand.py", 6),
        ("left_hip_pitch", "waist.px", 24),
    ],
)
def test_other_choices_of_primary_couplings_have_values_of_their_own(imposed, instead, largest):
    """Real and virtual couplings in one block; and blocks so large that they are left to LAPACK."""
    robot = sk.load_robot("bioloid")
    usual = sk.closed_mechanism(robot)
    primary = [imposed if name == instead else name for name in usual.primary]
    mechanism = sk.closed_mechanism(robot, primary)
    assert max(len(own) for _, own in mechanism.blocks) == largest
    state = random_state(robot, 4, (50,))
    expected = singular_values(mechanism, network_of(mechanism, state))
    found = least_values(mechanism, state.T_world_base, state.q)
    np.testing.assert_allclose(found, expected, atol=1e-13)
