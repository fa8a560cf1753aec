"""Least singular values of secondary blocks by a program against LAPACK's."""

from __future__ import annotations

import numpy as np
import pytest

import screwkin as sk
from screwkin.algebra.singular_values import TRUSTED
from screwkin.compiler.run import run
from screwkin.mechanism.least_values import block_values, least_values
from tests.kinematics.machines import random_state
from tests.mechanism.oracle import largest_values_of, least_values_of, network_of


@pytest.mark.parametrize("name", ["bioloid", "bioloid24", "poppy12"])
def test_programs_give_the_values_of_lapack_in_any_posture(name):
    """Bases turned at random, since the rotations of a hand's virtual chain do not turn with them."""
    robot = sk.load_robot(name)
    mechanism = sk.closed_mechanism(robot)
    state = random_state(robot, 3, (400,))
    state.q[:7] = 0.0  # straight knees
    N = network_of(mechanism, state)
    expected = least_values_of(mechanism, N)
    found = least_values(mechanism, state.T_world_base, state.q)
    assert (np.abs(found - expected) <= 1e-12 * largest_values_of(mechanism, N)).all()
    program = block_values(robot, mechanism.primary, mechanism.secondary)
    assert (run(program, vars(state))["error"] <= TRUSTED).mean() > 0.99


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
    expected = least_values_of(mechanism, network_of(mechanism, state))
    found = least_values(mechanism, state.T_world_base, state.q)
    np.testing.assert_allclose(found, expected, atol=1e-13)
