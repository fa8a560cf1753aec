"""Pinocchio on the same limbs: it puts the tip of every branch where ours does, and finds none of its own."""

from __future__ import annotations

import numpy as np
import pytest

from screwkin.algebra.se3 import as_array
from screwkin.analysis.ik_others import pinocchio_clik, pinocchio_model
from screwkin.analysis.ik_targets import random_targets, walking_path, walking_targets
from screwkin.ik.methods import solve_limb
from screwkin.ik.numeric import IkSettings
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.model.table import load_robot
from tests.ik.legs import apart

pin = pytest.importorskip("pinocchio")

LIMBS = [
    ("poppy12", "left_leg"),
    ("poppy12", "right_leg"),
    ("bioloid", "left_leg"),
    ("bioloid24", "right_arm"),
]


@pytest.mark.parametrize(("robot", "limb"), LIMBS)
def test_pinocchio_puts_every_branch_at_the_target(robot: str, limb: str) -> None:
    chain = SerialChain.of(load_robot(robot), limb)
    target = random_targets(chain, 100, 1)
    found = solve_limb(chain, target, "closed", np.zeros((100, 6)), IkSettings(), (100,))
    model = pinocchio_model(pin, chain)
    data = model.createData()
    home = as_array(chain.tip).astype(float)
    last = as_array(chain.screws[-1].s0).astype(float)
    reach = pin.SE3(home[:3, :3], home[:3, 3] - last)
    for T, branches, valid in zip(target, found.q, found.valid, strict=True):
        assert valid.any()
        for q in branches[valid]:
            pin.forwardKinematics(model, data, q)
            np.testing.assert_allclose((data.oMi[6] * reach).homogeneous, T, atol=2e-12)


@pytest.mark.parametrize(("robot", "limb"), LIMBS)
def test_what_pinocchios_iteration_finds_is_among_the_branches(robot: str, limb: str) -> None:
    chain = SerialChain.of(load_robot(robot), limb)
    target = random_targets(chain, 30, 2)
    outcome = pinocchio_clik(chain, target, IkSettings(1e-9, 1e-9, 300))
    assert outcome is not None
    assert outcome.solved.sum() >= 20
    found = solve_limb(chain, target, "closed", np.zeros((30, 6)), IkSettings(), (30,))
    for q, branches, valid in zip(
        outcome.q[outcome.solved], found.q[outcome.solved], found.valid[outcome.solved], strict=True
    ):
        assert apart(branches[valid], q).min() < 1e-5


def test_its_iterations_count_as_a_geometric_decay_predicts() -> None:
    """A step of a tenth leaves 0.9 of the error: from 0.4 to 1e-6 takes about 120 iterations."""
    chain = SerialChain.of(load_robot("bioloid"), "left_leg")
    target = walking_targets(chain, walking_path(chain))[::75]
    outcome = pinocchio_clik(chain, target, IkSettings(1e-6, 1e-6, 500))
    assert outcome is not None
    usual = outcome.iterations[outcome.solved]
    assert 90 < np.median(usual) < 150
