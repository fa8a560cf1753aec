"""A player on virtual servos in simulated time: what the tests of plays share."""

from __future__ import annotations

from functools import cache

from screwkin.gait.files import load_gait
from screwkin.gait.walk import walk
from screwkin.model.robot import Robot
from screwkin.model.table import load_robot
from screwkin.servo.bus import Bus
from screwkin.servo.player import Player, PlaySettings
from screwkin.servo.servo_map import ServoMap
from screwkin.servo.virtual.bus import SimulatedClock, VirtualBus
from screwkin.servo.virtual.faults import InjectedFault
from screwkin.servo.virtual.servo import VirtualServo
from screwkin.trajectory import Trajectory

ROBOT = load_robot("bioloid")
WITHIN = 2.0  # s of the clock: in the walk; it begins after 0.05 s of asking and 1 s of soft start


@cache
def steps() -> Trajectory:
    return walk(ROBOT, load_gait("smooth"), 1)


class Rig:
    """A player on virtual servos that stand in the home posture; every command to a servo is kept."""

    def __init__(
        self, *faults: InjectedFault, robot: Robot = ROBOT, seed: int = 0, **settings: object
    ) -> None:
        self.clock, self.told = SimulatedClock(), []
        servos = ServoMap.of(robot)
        self.line = VirtualBus(
            [
                VirtualServo(s.profile, s.id, s.direction * angle + s.zero, return_delay=500e-6)
                for s, angle in zip(servos.joints, robot.posture("home").q, strict=True)
            ],
            self.clock,
            faults=faults,
            seed=seed,
            witness=lambda time, id, command: self.told.append((time, id, command)),
        )
        self.player = Player(
            Bus(self.line, servos.protocol, clock=self.clock), robot, PlaySettings(**settings)
        )

    def play(self, trajectory: Trajectory | None = None):
        return self.player.play(trajectory or steps())

    def all(self, register: str) -> set[int]:
        """What a register holds on all servos."""
        return {servo.get(register) for servo in self.line.servos}

    def written(self, address: int) -> list[int]:
        """Every number of two bytes that any servo was told to write there."""
        found = []
        for _, _, command in self.told:
            if command.kind == "write" and 0 <= address - command.address <= len(command.data) - 2:
                at = address - command.address
                found.append(int.from_bytes(command.data[at : at + 2], "little"))
        return found
