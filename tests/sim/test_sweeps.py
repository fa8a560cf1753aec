"""How many sweeps a solver needs: by what a corner of a sole feels of the robot, against Pinocchio."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.analysis.engines import SimulatedCompliance, opened
from screwkin.model.inertias import impossible, inertia_matrix
from screwkin.sim.compliant import Compliance
from screwkin.sim.sweeps import FURTHER, LEAST, RIGID, SERVED, load_ratio, sweeps


def test_the_ratio_is_that_of_pinocchios_mass_matrix():
    pin = pytest.importorskip("pinocchio")
    from screwkin.dynamics.support import sole_corners
    from screwkin.model.urdf import urdf_from_robot

    robot = sk.load_robot("bioloid")
    model = pin.buildModelFromXML(urdf_from_robot(robot.with_inertia_floor()), pin.JointModelFreeFlyer())
    data, q = model.createData(), np.zeros(model.nq)
    q[6] = 1.0
    for name, value in zip(robot.joint_names, sk.home(robot).q, strict=True):
        q[model.joints[model.getJointId(name)].idx_q] = value
    M = pin.crba(model, data, q)
    M = np.triu(M) + np.triu(M, 1).T
    pin.framesForwardKinematics(model, data, q)
    freest = 0.0
    for limb in (limb for limb in robot.limbs if limb.kind == "leg"):
        frame = model.getFrameId(limb.tip)
        J = pin.computeFrameJacobian(model, data, q, frame, pin.ReferenceFrame.LOCAL)
        for corner in sole_corners(robot, limb.tip):
            push = J[2] + np.cross(J[3:].T, corner)[:, 2]
            freest = max(freest, push @ np.linalg.solve(M, push))
    assert load_ratio(robot) == pytest.approx(robot.mass * freest, rel=1e-9)


@pytest.mark.parametrize("name", ["bioloid", "bioloid24", "poppy12"])
def test_bundled_robots_are_served_by_the_least_number(name):
    assert sweeps(sk.load_robot(name)) == LEAST


def test_a_heavy_robot_on_light_feet_gets_more():
    robot = sk.load_robot("bioloid")
    links = [
        replace(link, mass=20 * link.mass) if link.name == robot.base_link else link for link in robot.links
    ]
    heavy = replace(robot, links=tuple(links))
    assert load_ratio(heavy) > 2 * SERVED
    assert sweeps(heavy) == LEAST + np.ceil(FURTHER * (load_ratio(heavy) - SERVED))


def test_an_arm_gets_the_least_number():
    assert sweeps(sk.load_robot("linkages/four-bar")) == LEAST


def test_rigid_servos_get_more_than_springs_and_motors():
    pytest.importorskip("pybullet")
    robot = sk.load_robot("bioloid")
    kinds = {
        RIGID * LEAST: SimulatedCompliance(),
        LEAST: SimulatedCompliance(motors="table"),
        float(LEAST): SimulatedCompliance(servos=Compliance(dict.fromkeys(robot.joint_names, 40.0))),
    }
    for wanted, compliance in kinds.items():
        backend = opened(robot, "pybullet", compliance)
        assert backend.settings["iterations"] == wanted
        backend.close()


def test_the_contact_zmp_on_rigid_servos_is_that_of_a_plan_whose_accelerations_do_not_jump():
    """With the sweeps that serve motors it is .28 mm RMS from it."""
    pytest.importorskip("pybullet")
    robot = sk.load_robot("bioloid")
    walk = sk.walk(robot, sk.load_gait("smooth").replace(Tc=1.0), 1)
    assert sk.validate(robot, walk, "pybullet", servo="rigid").zmp_rms_mm < 0.15


def test_pybullet_gives_a_link_with_an_impossible_inertia_the_nearest_one_of_a_body():
    """By itself it would give it none, and print a line about it."""
    pytest.importorskip("pybullet")
    from screwkin.sim.pybullet import PyBulletBackend

    robot = sk.load_robot("bioloid")
    i = robot.links[-1].inertia
    odd = replace(i, xx=2.0 * (i.yy + i.zz))
    robot = replace(robot, links=(*robot.links[:-1], replace(robot.links[-1], inertia=odd)))
    assert impossible(odd)
    backend = PyBulletBackend(robot)
    try:
        index = backend._link_names.index(robot.links[-1].name) - 1
        moments = np.sort(backend._p.getDynamicsInfo(backend._body, index, **backend._here)[2])
    finally:
        backend.close()
    before = np.linalg.eigvalsh(inertia_matrix(odd))
    excess = before[2] - before[0] - before[1]
    np.testing.assert_allclose(moments, before + excess / 3 * np.array([1, 1, -1]), rtol=1e-5)
