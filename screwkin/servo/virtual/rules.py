"""What a servo refuses to have written into its registers, and why."""

from __future__ import annotations

from screwkin.servo.model_file import Mode
from screwkin.servo.packets import ProtocolFacts, RequestOutcome
from screwkin.servo.profiles import Profile, Register
from screwkin.servo.virtual.drive import Get

TRIPPED = -1
"""What ``bus_watchdog`` holds once the bus was silent for too long."""

_GOALS = ("goal_position", "goal_velocity", "goal_current")


def write_outcome(
    profile: Profile, facts: ProtocolFacts, mode: Mode, get: Get, register: Register, value: int
) -> RequestOutcome:
    """What becomes of a write of a value into a register.

    Args:
        profile: of the model.
        facts: of its protocol.
        mode: that the servo is in.
        get: its registers as they stand; 0 where it has none.
        register: that is written.
        value: with its sign.
    """
    lasting = register.address < profile.ram_begins
    if register.access == "r" or (lasting and _locked(profile, facts, get)):
        return "access"
    if register.name == "lock" and not profile.unlocked_to_last and get("lock") and not value:
        return "access"  # only switching the power off unlocks it
    if register.name in _GOALS and get("bus_watchdog") == TRIPPED:
        return "range"
    within = get("angle_limit_low") <= value <= get("angle_limit_high")
    if register.name == "goal_position" and mode == "joint" and not within:
        return "angle"
    low, high = _bounds(mode, get, register)
    return "done" if low <= value <= high else "limit"


def _locked(profile: Profile, facts: ProtocolFacts, get: Get) -> bool:
    """Whether the lasting registers cannot be written."""
    if facts.locked_while_stiff and get("torque_enable"):
        return True
    return bool(get("lock")) and not profile.unlocked_to_last


def _bounds(mode: Mode, get: Get, register: Register) -> tuple[int, int]:
    """Least and greatest value that the servo takes now."""
    match register.name:
        case "moving_speed" if mode not in ("wheel", "velocity"):
            return 0, register.high
        case "goal_velocity":
            return -get("velocity_limit"), get("velocity_limit")
        case "goal_current":
            return -get("current_limit"), get("current_limit")
    return register.low, register.high
