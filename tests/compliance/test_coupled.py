"""Weight on robots with coupled joints that stand on any link: gradient and Hessian by differences."""

from __future__ import annotations

import numpy as np
import pytest

import screwkin as sk
from screwkin.algebra.se3 import IDENTITY, as_array
from screwkin.compliance.supported import Supported
from screwkin.kinematics.mass import mass_center
from screwkin.model.urdf_in import parse_urdf
from tests.oracles.coupled import tangled_tree


@pytest.mark.parametrize("seed", [1, 2])
def test_torques_and_stiffness_of_weight_are_the_derivatives_of_its_energy(seed):
    rng = np.random.default_rng(seed)
    robot = parse_urdf(tangled_tree(rng)).robot
    support = robot.coupled[0].child
    q = rng.uniform(-1, 1, len(robot.joints))

    def standing(q: np.ndarray) -> Supported:
        return Supported.of(robot, support, IDENTITY, q.tolist())

    def energy(q: np.ndarray) -> float:
        here = standing(q)
        com = here.base @ mass_center(robot, here.displacements)
        return 9.81 * float(robot.mass) * float(com.z)

    def torques(q: np.ndarray) -> np.ndarray:
        return np.array(standing(q).gravity_torques(9.81), dtype=float)

    h, E = 1e-6, np.eye(len(q))
    slope = [(energy(q + h * e) - energy(q - h * e)) / (2 * h) for e in E]
    np.testing.assert_allclose(torques(q), slope, atol=1e-6)
    bend = np.array([(torques(q + h * e) - torques(q - h * e)) / (2 * h) for e in E])
    hessian = np.zeros_like(bend)
    for (i, j), value in standing(q).gravity_stiffness(9.81).items():
        hessian[i, j] = hessian[j, i] = value
    np.testing.assert_allclose(hessian, bend, atol=1e-6)


def test_a_frames_columns_are_those_of_its_motion_with_the_support_at_rest():
    rng = np.random.default_rng(3)
    robot = parse_urdf(tangled_tree(rng)).robot
    support, frame = robot.coupled[0].child, robot.coupled[-1].child
    q = rng.uniform(-1, 1, len(robot.joints))
    here = Supported.of(robot, support, IDENTITY, q.tolist())
    state = sk.State(as_array(here.base).astype(float), q)
    J, S = (
        sk.jacobian(robot, state, name, base_twist_at="point", point=np.zeros(3)) for name in (frame, support)
    )
    columns = here.jacobian(frame)
    p = as_array(here.pose(frame).p).astype(float)
    relative = (J - S)[:, 6:]
    for i in range(len(q)):
        omega, v = relative[:3, i], relative[3:, i] + np.cross(relative[:3, i], p)
        mine = np.zeros(6) if i not in columns else as_array(columns[i]).astype(float)
        np.testing.assert_allclose(mine, [*omega, *v], atol=1e-12)
