"""Which angle a position register means: reversed, offset, geared down, as the registers of a servo say.

    true position = angle / tick + centre
    position shown = (true position, mirrored at the centre if reversed) / divider + offset

Offsets and dividers count where the makers say so: the offset of a MX servo of protocol 1.0 and its divider
over several turns only, a homing offset of the X series in joint mode up to a quarter turn only.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from screwkin.servo.model_file import Mode
from screwkin.servo.profiles import Profile, radians_from_ticks

FRAME_REGISTERS = ("drive_mode", "homing_offset", "multi_turn_offset", "resolution_divider")

_TURN = 360.0  # degrees
_QUARTER = 4  # of a turn


@dataclass(frozen=True)
class CountingFrame:
    """How a servo counts: see the module. ``turn``: positions at which it begins anew, 0 if it counts on."""

    profile: Profile
    reversed: bool = False
    offset: int = 0
    divider: int = 1
    turn: int = 0

    def shown(self, angle: float) -> int:
        """The position of an angle from the servo's centre [rad]."""
        true = angle / self.profile.tick
        mirrored = -true if self.reversed else true
        position = round((mirrored + self.profile.centre) / self.divider + self.offset)
        return position % self.turn if self.turn else position

    def angle(self, position: int) -> float:
        """The angle from the servo's centre [rad] that a position means."""
        true = (position - self.offset) * self.divider
        ticks = 2 * self.profile.centre - true if self.reversed else true
        return ticks * self.profile.tick + radians_from_ticks(self.profile, 0)


def frame_of(profile: Profile, mode: Mode, values: Mapping[str, int]) -> CountingFrame:
    """The frame of a servo in a mode.

    Args:
        profile: of its model.
        mode: see ``modes.servo_mode``.
        values: those of ``FRAME_REGISTERS`` that it has.
    """
    several = mode in ("multi-turn", "extended position", "current-based position")
    reverses = mode != "wheel" and bool(values.get("drive_mode", 0) >> profile.reverse_bit & 1)
    offset = profile.homing_sign * values.get("homing_offset", 0)
    if mode == "joint" and profile.homing_sign > 0 and abs(offset) > profile.ticks // _QUARTER:
        offset = 0
    divider = 1
    if several:
        offset += values.get("multi_turn_offset", 0)
        divider = values.get("resolution_divider", 1)
    around = profile.ticks * _TURN / profile.range_deg
    anew = (bool(profile.multi_turn) and not several) or mode == "wheel"
    return CountingFrame(profile, reverses, offset, divider, round(around) if anew else 0)
