"""What a servo's registers make its motor do: the drive and the share of its torque, by its mode."""

from __future__ import annotations

import math
from collections.abc import Callable

from screwkin.servo.model_file import Mode
from screwkin.servo.profiles import Profile
from screwkin.servo.virtual.body import AtRate, Body, Drive, ToAngle
from screwkin.servo.virtual.frame import CountingFrame

Get = Callable[[str], int]
"""The value of a register by its name; 0 where the model has none."""

_LEAST_SPEED = 1e-9  # rad/s
_NOTHING = 1e-6  # share of the torque that turns nothing


def drive_of(profile: Profile, mode: Mode, frame: CountingFrame, get: Get, body: Body) -> Drive:
    """What the motor is to do with torque on.

    A rate is the servo's own, positive towards greater ticks as it counts them; reversed servos turn the
    other way. Speeds end at that without load, in proportion to the voltage, and at ``velocity_limit``.
    """
    most = profile.no_load_speed * body.supply / profile.voltage
    if mode in ("joint", "multi-turn", "extended position", "current-based position", "step", "unknown"):
        speed = _limited(profile, get, get("moving_speed") * profile.speed_unit or most, most)
        return ToAngle(frame.angle(get("goal_position")), max(speed, _LEAST_SPEED))
    way = -1.0 if frame.reversed else 1.0
    if mode == "velocity" or (mode == "wheel" and profile.multi_turn):
        name = "goal_velocity" if "goal_velocity" in profile.registers else "moving_speed"
        rate = get(name) * profile.speed_unit
        return AtRate(way * math.copysign(_limited(profile, get, abs(rate), most), rate))
    if mode == "current":
        net = way * current_share(profile, get) + body.turned_with / body.stall_torque
        return AtRate(math.copysign(most, net) if abs(net) > _NOTHING else 0.0)
    share = way * _output_share(profile, mode, get)
    free = share + body.turned_with / body.stall_torque  # gears hold what would turn it back
    return AtRate(free * most if free * share > 0 else 0.0)


def torque_share(profile: Profile, mode: Mode, get: Get) -> float:
    """The share of its greatest torque that a servo may use."""
    limit = abs(get("torque_limit")) / profile.register("torque_limit").high
    share = min(
        limit,
        get("max_torque") / profile.register("torque_limit").high
        if "max_torque" in profile.registers
        else 1.0,
    )
    if mode in ("current", "current-based position"):
        share = min(share, abs(current_share(profile, get)))
    return share


def current_share(profile: Profile, get: Get) -> float:
    """The goal of a current, as a share of the greatest torque, with its sign."""
    name = "goal_current" if "goal_current" in profile.registers else "goal_torque"
    return get(name) * profile.load_unit


def _limited(profile: Profile, get: Get, speed: float, most: float) -> float:
    cap = get("velocity_limit") * profile.speed_unit if "velocity_limit" in profile.registers else most
    return min(speed, most, cap)


def _output_share(profile: Profile, mode: Mode, get: Get) -> float:
    """The share of the voltage that reaches the motor, with its sign: modes pwm and wheel."""
    name = (
        "moving_speed"
        if mode == "wheel"
        else "goal_pwm"
        if "goal_pwm" in profile.registers
        else "torque_limit"
    )
    return get(name) / profile.register(name).high
