"""The mode of a servo: what it takes a goal for, by the registers that decide it."""

from __future__ import annotations

from collections.abc import Mapping

from screwkin.servo.profiles import Mode, Profile

MODE_REGISTERS = ("operating_mode", "angle_limit_low", "angle_limit_high", "torque_control")


def mode_registers(profile: Profile) -> tuple[str, ...]:
    """The registers of a model that decide its mode."""
    if profile.modes:
        return ("operating_mode",)
    return tuple(name for name in MODE_REGISTERS if name in profile.registers)


def servo_mode(profile: Profile, values: Mapping[str, int]) -> Mode:
    """The mode of a servo, from the values of its registers.

    Where a model has a register for the mode, that says it. Others turn without end (``wheel``) when both
    angle limits are 0, and over several turns (``multi-turn``, where they have that) when both are at their
    greatest value; a ``torque_control`` of 1 puts ``current`` before both.

    Args:
        profile: of its model.
        values: at least those of ``mode_registers``, signs decoded; more do no harm.

    Returns:
        The mode, ``unknown`` where the register holds a value that the profile does not list.

    Raises:
        KeyError: one of ``mode_registers`` is not among the values.

    Source: the makers' control tables, "operating mode" and "CW/CCW angle limit".
    """
    if profile.modes:
        value = values["operating_mode"]
        return next((mode for mode, number in profile.modes.items() if number == value), "unknown")
    if "torque_control" in profile.registers and values["torque_control"]:
        return "current"
    low, high = values["angle_limit_low"], values["angle_limit_high"]
    if low == high == 0:
        return "wheel"
    greatest = profile.register("angle_limit_high").high
    if "multi_turn_offset" in profile.registers and low == high == greatest:
        return "multi-turn"
    return "joint"
