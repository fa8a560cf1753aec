"""Every bundled model plays a walk on the virtual bus, by the makers' driver, read as its profile says."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest

from screwkin.gait.files import load_gait
from screwkin.gait.walk import walk
from screwkin.model.table import load_robot
from screwkin.servo.budget import budget
from screwkin.servo.bus import Bus
from screwkin.servo.gate import Bounds, Gate
from screwkin.servo.leave import leave
from screwkin.servo.player import Player, PlaySettings
from screwkin.servo.profiles import profile_models
from screwkin.servo.reading import Readings
from screwkin.servo.servo_map import ServoMap
from screwkin.servo.virtual.bus import SimulatedClock, VirtualBus
from screwkin.servo.virtual.robot import virtual_servos
from screwkin.trajectory import Trajectory

ROBOT = load_robot("bioloid")
QUICK = ("XL-320", "XM430-W350", "STS3215")  # a table of its own, load by current, another protocol
MODELS = [
    model if model in QUICK else pytest.param(model, marks=pytest.mark.slow) for model in profile_models()
]


@cache
def one_step() -> Trajectory:
    return walk(ROBOT, replace(load_gait("smooth"), Tc=2.0), 1)


def fitted(model):
    """The robot with servos of that model, and them on a bus."""
    settings = {key: value for key, value in ROBOT.servos.items() if key != "protocol"}
    robot, clock = replace(ROBOT, servos={**settings, "model": model}), SimulatedClock()
    line = VirtualBus(virtual_servos(robot, return_delay=500e-6), clock)
    return robot, line, Bus(line, ServoMap.of(robot).protocol, clock=clock)


@pytest.mark.parametrize("model", MODELS)
def test_a_walk_is_played_by_servos_of_every_model(model):
    robot, line, bus = fitted(model)
    outcome = Player(bus, robot, PlaySettings(rate=20.0)).play(one_step())
    assert outcome.faults == ()
    assert outcome.final.unconfirmed == ()
    assert 0.01 < outcome.max_tracking_error < 0.2
    for servo, angle in zip(line.servos, one_step().q[-1], strict=True):
        joint = ServoMap.of(robot).by_id(servo.id)
        assert servo.torque_on
        assert joint.direction * (servo.body.angle - joint.zero) == pytest.approx(
            angle, abs=2 * joint.profile.tick
        )


@pytest.mark.parametrize("model", ["XM430-W350", "STS3215"])
def test_a_position_just_below_the_first_tick_is_read_as_such(model):
    """Deflected over its end of range a servo shows -3, written as two's complement or by a bit."""
    robot, line, bus = fitted(model)
    bounds = Bounds.of(robot)
    servo = line.servo(bounds.ids[0])
    servo.put("operating_mode", servo.profile.modes.get("extended position", 0))
    if model == "STS3215":
        servo.put("angle_limit_low", 0)
        servo.put("angle_limit_high", 0)
    servo.body.angle = -2051 * servo.profile.tick
    readings = Readings(bus, bounds)
    measured = readings.values(0, readings.ask(0))["position"]
    assert measured == pytest.approx(bounds.radians_of(0, -3))


def test_a_servo_deflected_below_its_first_tick_is_held_at_the_nearest_goal():
    robot, line, bus = fitted("XM430-W350")
    gate = Gate(bus, Bounds.of(robot))
    servo = line.servo(gate.bounds.ids[0])
    servo.body.angle = -2051 * servo.profile.tick
    assert leave(gate, bus, "hold").unconfirmed == ()
    assert servo.get("goal_position") == gate.bounds.low[0]


def test_the_budget_counts_the_packets_that_the_gate_sends():
    """An STS has a register between position and speed: its goals go in two packets."""
    for model, packets in (("AX-12A", 1), ("XM430-W350", 1), ("STS3215", 2)):
        robot, line, bus = fitted(model)
        bounds = Bounds.of(robot)
        began, sent = line.packets, []
        write = line.write
        line.write = lambda data, write=write, sent=sent: (sent.append(len(data)), write(data))[1]
        Gate(bus, bounds).stay(dict(enumerate(bounds.low.tolist())))
        assert line.packets - began == packets
        assert sum(sent) * 10 / 1_000_000 == pytest.approx(budget(bounds.profiles, 1_000_000).write)
