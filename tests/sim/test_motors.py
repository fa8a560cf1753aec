"""Servos in engines against the library's own integration: one joint, a mass, every kind of friction."""

import numpy as np
import pytest

import screwkin as sk
from screwkin.errors import InputError
from screwkin.model.state import State
from screwkin.motors.library import load_motor, motors_of
from screwkin.motors.pendulum import delayed, swing
from screwkin.motors.records import Friction, Motor
from screwkin.servo.bench import pendulum_of
from screwkin.sim.backend import Command
from screwkin.sim.motors import MotorServos
from screwkin.sim.mujoco import MuJoCoBackend
from screwkin.sim.pybullet import PyBulletBackend

BENCH = """
[robot]
name = "bench"
description = "a mass on a servo"
source = "a test"
base_link = "stand"
base = "fixed"

[[link]]
name = "stand"
mass = 1.0
com = [0, 0, 0]
inertia = { box = [0.1, 0.1, 0.1] }

[[link]]
name = "arm"
mass = 0.49
com = [0, 0, -0.1]
inertia = { box = [0.04, 0.04, 0.04] }

[[joint]]
name = "shaft"
parent = "stand"
child = "arm"
type = "revolute"
s = [0, 1, 0]
s0 = [0, 0, 0]
lower = -3.0
upper = 3.0
velocity = 20.0
effort = 10.0
"""
ROBOT = sk.robot_from_text(BENCH)
ENGINES = {"mujoco": MuJoCoBackend, "pybullet": PyBulletBackend}
SERVOS = {
    "assumed": load_motor("AX-12A").motor,
    "load": load_motor("XL330").motor,
    "squares": load_motor("MX-64").motor,
    "viscous": load_motor("STS3215").motor,
    "late, with a dead zone": Motor(
        2.0, 16.0, 12.0, 0.005, 26.7, dead_zone=0.01, punch=0.03, lag=0.0123, friction=Friction(0.05, 0.02)
    ),
}


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("servo", SERVOS)
def test_a_pendulum_swings_in_an_engine_as_in_the_library(engine, servo):
    motor, dt = SERVOS[servo], 1e-3
    time = np.arange(0.0, 3.0, dt)
    goals = (1.2 * np.sin(2.0 * time) + 0.3 * np.sin(9.0 * time))[:, None]
    pytest.importorskip(engine)
    backend = ENGINES[engine](ROBOT, servos=MotorServos([motor], dt, servo))
    backend.reset(State(np.eye(4), np.zeros(1)))
    angles = [0.0]
    for goal in goals:
        backend.step(Command(goal, np.zeros(1), np.eye(4)))
        angles.append(float(backend.observe().q[0]))
    backend.close()
    own = swing(motor, pendulum_of(ROBOT), delayed(goals[:, 0], motor.lag, dt), 0.0, dt=dt)
    assert np.ptp(own) > 0.5
    np.testing.assert_allclose(angles, own, atol=1e-3)


def test_a_step_too_long_for_a_servo_is_refused():
    with pytest.raises(InputError, match="too long for the servo of joint 0"):
        MotorServos([SERVOS["assumed"]], 0.05, "assumed")


def test_in_the_air_rotors_turn_a_robot_no_more_in_one_engine_than_in_the_other():
    """Legs swing by 0.3 rad within 0.2 s; bodies with the rotors' inertia would turn the torso elsewhere."""
    pytest.importorskip("pybullet")
    pytest.importorskip("mujoco")
    robot = sk.load_robot("bioloid")
    home = sk.home(robot)
    base = np.array(home.T_world_base)
    base[2, 3] += 1.0
    legs = np.array([name.endswith(("hip_pitch", "shoulder_roll")) for name in robot.joint_names])
    found = []
    for backend in ENGINES.values():
        engine = backend(robot, servos=MotorServos(motors_of(robot), 1e-3, "table"))
        engine.reset(State(base, np.array(home.q)))
        for k in range(200):
            q = np.array(home.q) + 0.3 * legs * np.sin(np.pi * k / 400)
            engine.step(Command(q, np.zeros(18), base))
        found.append(engine.observe())
        engine.close()
    one, other = found
    turned = float(np.arccos((np.trace(base[:3, :3].T @ one.T_world_base[:3, :3]) - 1) / 2))
    between = float(np.arccos((np.trace(other.T_world_base[:3, :3].T @ one.T_world_base[:3, :3]) - 1) / 2))
    assert turned > 0.1
    assert between < 0.02 * turned
    np.testing.assert_allclose(one.q, other.q, atol=5e-3)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_standing_foot_stays_where_it_is_when_the_other_strikes_the_floor(engine):
    """The gait sets its foot down at 0.1 m/s; rotors that answer to the blow hammer both feet away."""
    pytest.importorskip(engine)
    robot = sk.load_robot("bioloid")
    walk = sk.walk(robot, sk.load_gait("paper").replace(Tc=1.0, stride=0.2), steps=1)
    assert sk.validate(robot, walk, engine, servo="table").slip_mm < 0.1
