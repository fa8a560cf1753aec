"""The page docs/conventions.md, held to the programs it speaks about, and its drawing to its script."""

from __future__ import annotations

import importlib.util
import math
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation as ScipyRotation

from screwkin.algebra import se3
from screwkin.algebra.screws import Wrench, at, power, transport, transport_wrench, wrench_at
from screwkin.algebra.se3 import Twist, Vector, as_array
from tests.strategies import assert_close

DOCS = Path(__file__).resolve().parent.parent / "docs"
TWIST = Twist(Vector(0.3, -0.5, 0.7), Vector(0.2, 1.0, -0.4))
WRENCH = Wrench(Vector(1.0, -2.0, 0.5), Vector(3.0, 0.3, -0.7))


def swapped(six):
    """The upper and the lower three of six numbers exchanged."""
    return np.roll(np.asarray(six), 3)


def test_the_drawing_is_what_its_script_draws():
    spec = importlib.util.spec_from_file_location("draw_conventions", DOCS / "draw_conventions.py")
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    text = (DOCS / "images" / "conventions.svg").read_text(encoding="utf-8")
    assert text == script.drawing()
    assert ElementTree.fromstring(text).tag.endswith("svg")


def test_changes_of_frame_and_point_are_those_of_the_page():
    pose = se3.exp(TWIST)
    R, p = pose.R, pose.p
    moved, loaded = transport(pose, TWIST), transport_wrench(pose, WRENCH)
    assert_close(moved.omega, R @ TWIST.omega)
    assert_close(moved.v, R @ TWIST.v + se3.cross(p, moved.omega))
    assert_close(loaded.f, R @ WRENCH.f)
    assert_close(loaded.m, R @ WRENCH.m + se3.cross(p, loaded.f))
    assert_close(at(p, TWIST).v, TWIST.v + se3.cross(TWIST.omega, p))
    assert_close(wrench_at(p, WRENCH).m, WRENCH.m - se3.cross(p, WRENCH.f))


def test_pinocchio_has_linear_above_angular_and_otherwise_the_same_exponential_and_transport():
    motion, force = pin.Motion(swapped(as_array(TWIST))), pin.Force(swapped(as_array(WRENCH)))
    pose = se3.exp(TWIST)
    assert_close(pose, pin.exp6(motion).homogeneous)
    assert_close(swapped(as_array(se3.log(pose))), pin.log6(pin.SE3(as_array(pose))).vector)
    M = pin.SE3(as_array(pose))
    assert_close(transport(pose, TWIST), swapped(M.act(motion).vector))
    assert_close(transport_wrench(pose, WRENCH), swapped(M.act(force).vector))
    other = Twist(se3.X, se3.Y) * 0.5
    crossed = motion.cross(pin.Motion(swapped(as_array(other))))
    assert_close(se3.bracket(TWIST, other), swapped(crossed.vector))
    assert_close(power(WRENCH, TWIST), motion.dot(force))


def test_pinocchio_and_scipy_write_the_scalar_of_a_quaternion_last_and_mujoco_first():
    w = Vector(0.0, 0.0, math.pi / 2)
    half = math.sqrt(0.5)
    R = as_array(se3.rotation_exp(w))
    assert_close(ScipyRotation.from_quat([0, 0, half, half]).as_matrix(), R)
    assert_close(pin.XYZQUATToSE3(np.array([0, 0, 0, 0, 0, half, half])).rotation, R)
    first = np.zeros(9)
    mujoco.mju_quat2Mat(first, np.array([half, 0, 0, half]))
    assert_close(first.reshape(3, 3), R)


def test_mujoco_tells_a_free_joint_by_world_velocity_and_body_rotation():
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body name="b"><freejoint/><geom size=".1"/></body></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    pose = se3.exp(TWIST)
    mujoco.mju_mat2Quat(data.qpos[3:], as_array(pose.R).ravel())
    data.qpos[:3] = as_array(pose.p)
    omega, v = as_array(TWIST.omega), as_array(TWIST.v)
    data.qvel[:] = [*v, *(as_array(pose.R).T @ omega)]
    mujoco.mj_forward(model, data)
    told = np.zeros(6)
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, model.body("b").id, told, 0)
    assert_close(told, [*omega, *v], 1e-12)


def test_rotations_of_a_virtual_chain_are_angles_whose_rates_are_not_omega():
    a, b, c = 0.3, -0.4, 0.9
    rate = np.array([0.5, -0.2, 0.7])

    def turned(a, b, c):
        return as_array(se3.rotate(se3.X, a) @ se3.rotate(se3.Y, b) @ se3.rotate(se3.Z, c))

    Rx, Rxy = se3.rotate(se3.X, a), se3.rotate(se3.X, a) @ se3.rotate(se3.Y, b)
    omega = se3.X * rate[0] + (Rx @ se3.Y) * rate[1] + (Rxy @ se3.Z) * rate[2]
    assert_close(turned(a, b, c), ScipyRotation.from_euler("XYZ", [a, b, c]).as_matrix())
    h = 1e-6
    ahead, behind = turned(*(np.array([a, b, c]) + h * rate)), turned(*(np.array([a, b, c]) - h * rate))
    W = (ahead - behind) / (2 * h) @ turned(a, b, c).T
    assert_close(omega, [W[2, 1], W[0, 2], W[1, 0]], 1e-9)
