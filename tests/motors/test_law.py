"""The law of a servo's motor against what its figures mean: no-load speed, stall, steady state, sticking."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from screwkin.motors.law import drive, duty, friction_budget, load_torque, motor_torque, stopping_torque
from screwkin.motors.pendulum import STEP, Pendulum, delayed, swing
from screwkin.motors.records import Friction, Motor, stacked

MOTOR = Motor(constant=2.0, resistance=16.0, voltage=12.0, armature=0.005, gain=26.6667)


def test_at_full_duty_torque_falls_from_stall_at_rest_to_nothing_at_the_no_load_speed():
    assert motor_torque(MOTOR, 1.0, 0.0) == pytest.approx(MOTOR.stall_torque) == pytest.approx(1.5)
    assert motor_torque(MOTOR, 1.0, 6.0) == pytest.approx(0.0)
    assert motor_torque(MOTOR, 0.0, 1.0) == pytest.approx(-0.25)


def test_current_and_duty_are_limited_on_both_sides():
    weak = Motor(2.0, 16.0, 12.0, 0.005, 26.7, max_duty=0.5, max_current=0.2)
    error = np.array([-9.0, 9.0])
    assert duty(weak, error) == pytest.approx([-0.5, 0.5])
    assert motor_torque(weak, duty(weak, error), 0.0) == pytest.approx([-0.4, 0.4])
    assert weak.stall_torque == pytest.approx(0.4)


def test_inside_the_dead_zone_nothing_drives_and_beyond_it_at_least_the_punch():
    servo = Motor(2.0, 16.0, 12.0, 0.005, 10.0, dead_zone=0.01, punch=0.03)
    assert duty(servo, np.array([0.0, 0.0099, -0.0099])).tolist() == [0.0, 0.0, 0.0]
    assert duty(servo, np.array([0.02, -0.02])) == pytest.approx([0.13, -0.13])


@pytest.mark.parametrize(
    ("friction", "budget"),
    [
        (Friction(coulomb=0.1, viscous=0.2), 0.1 + 0.2 * 0.5),
        (Friction(stribeck=0.3, speed=0.5, shape=2.0), 0.3 * np.exp(-1.0)),
        (Friction(load_motor=0.1, load_external=0.1), 0.1 * (0.8 + 0.6)),
        (Friction(load_motor=0.1, load_external=0.2), 0.1 * 0.8 + 0.2 * 0.6),
        (Friction(load_motor_stribeck=1.0, speed=0.25, shape=1.0), 0.8 * np.exp(-2.0)),
        (Friction(load_external_square=1.0, load_motor_square=9.0, speed=0.5), 0.36 * np.exp(-1.0)),
    ],
)
def test_the_friction_budget_is_the_sum_of_its_terms(friction, budget):
    """A motor that lifts, 0.8 N m against a load of -0.6 N m, at 0.5 rad/s in either sense."""
    for speed in (0.5, -0.5):
        assert friction_budget(friction, 0.8, -0.6, speed) == pytest.approx(budget)


def test_friction_stops_but_never_drives():
    qd, torque, dt, inertia = np.array([0.01, 0.01, 5.0, -5.0]), np.array([0.02, 0.2, 0.0, 0.0]), 1e-3, 0.01
    friction = stopping_torque(np.full(4, 0.15), inertia, qd, torque, dt)
    after = qd + dt * (torque + friction) / inertia
    assert after[0] == 0.0
    assert (np.abs(friction) <= 0.15).all()
    assert (after[1:] * qd[1:] > 0.0).all()
    assert (np.abs(after[2:]) < 5.0).all()


def test_the_load_of_a_servo_at_rest_is_what_motor_and_friction_hold():
    assert load_torque(MOTOR, 0.5, 0.1, 0.0) == pytest.approx(-0.6)


def test_in_the_steady_state_the_deflection_is_the_weight_over_the_stiffness():
    pendulum = Pendulum.of_mass(0.49, 0.1)
    angles = swing(MOTOR, pendulum, np.full(4000, 0.7), 0.0)
    torque = pendulum.weight * np.sin(angles[-1])
    assert 0.7 - angles[-1] == pytest.approx(torque / MOTOR.stiffness, abs=1e-9)
    assert MOTOR.stiffness == pytest.approx(40.0, rel=1e-4)


def test_a_pendulum_within_the_budget_of_friction_stays_where_it_is():
    stuck = Motor(2.0, 16.0, 12.0, 0.005, 1e-9, friction=Friction(coulomb=0.5))
    assert np.ptp(swing(stuck, Pendulum.of_mass(0.49, 0.1), np.zeros(500), 1.0)) == 0.0


def test_a_free_pendulum_swings_as_its_differential_equation_says():
    free = Motor(1e-6, 1.0, 12.0, 0.002, 0.0)
    pendulum = Pendulum.of_mass(0.5, 0.1)
    angles = swing(free, pendulum, np.zeros(10_000), 1.0, dt=1e-4)
    true = solve_ivp(
        lambda t, y: [y[1], -pendulum.weight * np.sin(y[0]) / (pendulum.inertia + 0.002)],
        (0.0, 1.0),
        [1.0, 0.0],
        rtol=1e-10,
        atol=1e-10,
    )
    assert angles[-1] == pytest.approx(true.y[0, -1], abs=1e-3)


def test_a_command_that_allows_for_load_back_emf_and_rotor_is_followed():
    """Of a mass swung at 4 rad/s; with the load's torque alone it lags by the back-EMF over the stiffness."""
    motor, mass = MOTOR, Pendulum.of_mass(0.3, 0.1)
    time = STEP * np.arange(3000)
    q, qd, qdd = 0.5 * np.sin(4 * time), 2 * np.cos(4 * time), -8 * np.sin(4 * time)
    load = mass.inertia * qdd + mass.weight * np.sin(q)
    taken = motor.damping * qd + motor.armature * qdd
    away = [
        np.abs(swing(motor, mass, q + torque / motor.stiffness, q[0], qd[0])[500:-1] - q[500:]).max()
        for torque in (load + taken, load)
    ]
    assert away[0] < 0.02 * away[1]
    assert away[1] == pytest.approx(motor.damping * 2 / motor.stiffness, rel=0.1)


def test_stacked_motors_drive_their_joints_as_each_would_alone():
    rough = Friction(0.01, 0.02, 0.03, 0.5, 1.5, 0.1, 0.2, 0.03, 0.04, 0.05, 0.06)
    motors = [MOTOR, Motor(0.4, 4.0, 5.0, 0.002, 1.2, friction=rough)]
    goal, q, qd, external = np.random.default_rng(5).normal(size=(4, 2))
    together = drive(stacked(motors), goal, q, qd, external)
    for i, motor in enumerate(motors):
        alone = drive(motor, goal[i], q[i], qd[i], external[i])
        assert (together.torque[i], together.budget[i]) == pytest.approx(alone)


def test_goals_are_delayed_by_whole_and_broken_steps():
    goals = np.arange(6.0)[:, None] * [1.0, 1.0]
    late = delayed(goals, np.array([0.002, 0.0005]), 1e-3)
    assert late[:, 0].tolist() == [0.0, 0.0, 0.0, 1.0, 2.0, 3.0]
    assert late[:, 1].tolist() == [0.0, 0.5, 1.5, 2.5, 3.5, 4.5]
