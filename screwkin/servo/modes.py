"""The mode of a servo: what it takes a goal for, by the registers that decide it."""

from __future__ import annotations

from collections.abc import Mapping

from screwkin.servo.model_file import Mode
from screwkin.servo.profiles import Profile

MODE_REGISTERS = ("operating_mode", "angle_limit_low", "angle_limit_high", "torque_control")


def mode_registers(profile: Profile) -> tuple[str, ...]:
    """The registers of a model that decide its mode."""
    if profile.modes and profile.multi_turn != "zero":
        return ("operating_mode",)
    return tuple(name for name in MODE_REGISTERS if name in profile.registers)


def servo_mode(profile: Profile, values: Mapping[str, int]) -> Mode:
    """The mode of a servo, from the values of its registers.

    Where a model has a register for the mode, that says it. Others turn without end (``wheel``) when both
    angle limits are 0, and over several turns (``multi-turn``, where they have that) when both are at their
    greatest value; a ``torque_control`` of 1 puts ``current`` before both. Feetech's turn over several turns
    when both limits are 0.

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
        named: Mapping[int, Mode] = {number: mode for mode, number in profile.modes.items()}
        mode = named.get(value, "unknown")
        turns = profile.multi_turn == "zero" and values["angle_limit_low"] == values["angle_limit_high"] == 0
        return "multi-turn" if mode == "joint" and turns else mode
    if "torque_control" in profile.registers and values["torque_control"]:
        return "current"
    low, high = values["angle_limit_low"], values["angle_limit_high"]
    if low == high == 0:
        return "wheel"
    turns = profile.multi_turn == "greatest" and low == high == profile.register("angle_limit_high").high
    return "multi-turn" if turns else "joint"
