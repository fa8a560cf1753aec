"""Servos of a model on a bus in simulated time, talked to by the makers' own driver."""

from __future__ import annotations

import pytest

from screwkin.servo.bus import Bus
from screwkin.servo.line import RefusedError
from screwkin.servo.profiles import decode, encode, load_profile
from screwkin.servo.virtual.bus import SimulatedClock, VirtualBus
from screwkin.servo.virtual.servo import VirtualServo

X = ("MX-28-2", "XL330-M288", "XL430-W250", "XM430-W350", "XC330-M288")
"""Models of protocol 2.0 with the tables of the X series."""


class Bench:
    """Servos of a model on a bus that the makers' driver talks over."""

    def __init__(self, model, count=1, supply=0.0, **servo):
        self.profile, self.clock = load_profile(model), SimulatedClock()
        self.servos = [VirtualServo(self.profile, k + 1, **servo) for k in range(count)]
        self.line = VirtualBus(self.servos, self.clock, supply=supply)
        self.bus = Bus(self.line, self.profile.protocol, 1_000_000, self.clock, patience=0.003)
        self.servo, self.body = self.servos[0], self.servos[0].body

    def write(self, name, value, id=1):
        register = self.profile.register(name)
        self.bus.write(id, register.address, encode(register, value), register.width)

    def read(self, name, id=1):
        register = self.profile.register(name)
        return decode(register, self.bus.read(id, register.address, register.width).value)

    def set_up(self, **registers):
        """Write registers, lasting ones first, and switch torque on."""
        for name in sorted(registers, key=lambda name: self.profile.register(name).address):
            self.write(name, registers[name])
        self.write("torque_enable", 1)

    def after(self, seconds):
        self.clock.sleep(seconds)
        self.line.advance()
        return self.body


def refusal(errors, act):
    with pytest.raises(RefusedError) as refused:
        act()
    assert refused.value.errors & errors
