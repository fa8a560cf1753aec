"""``screwkin bus profiles``: the servo models that a bus can talk to."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Annotated, Any

import typer

from screwkin.cli.options import AsJson
from screwkin.cli.output import aligned, print_json, say
from screwkin.motors.library import has_motor
from screwkin.servo.profiles import Profile, Register, load_profile, profile_models

_RPM = 2 * math.pi / 60  # rad/s


def bus_profiles(
    model: Annotated[str, typer.Argument(help="Only this one, with its registers: a name, or a file.")] = "",
    as_json: AsJson = False,
) -> int:
    """Servo models that a bus can talk to; with MODEL all that is known of one. Nothing is opened.

    A path of a file of yours stands wherever a model's name does; a file with faults is refused, all of them
    listed.
    """
    chosen = [model] if model else list(profile_models())
    profiles = [(name, load_profile(name)) for name in chosen]
    if as_json:
        rows = [_facts(profile, name) for name, profile in profiles]
        if model:
            rows[0]["registers"] = {name: asdict(r) for name, r in profiles[0][1].registers.items()}
        print_json({"models": rows})
        return 0
    titles = ("model", "protocol", "number", "ticks", "degrees", "N m", "rpm", "V", "reads", "table")
    say(aligned([titles, *(_row(profile) for _, profile in profiles)], "  "))
    if model:
        say(f"table: {profiles[0][1].source}\nfigures: {profiles[0][1].sheet}")
        say(aligned([_REGISTER, *map(_register, profiles[0][1].registers.values())], "  "))
    return 0


def _facts(profile: Profile, name: str) -> dict[str, Any]:
    return {
        "model": profile.model,
        "aliases": profile.aliases,
        "protocol": profile.protocol,
        "number": profile.number,
        "ticks": profile.ticks,
        "range_deg": profile.range_deg,
        "stall_torque": profile.stall_torque,
        "stall_current": profile.stall_current or None,
        "no_load_speed": profile.no_load_speed,
        "voltage": profile.voltage,
        "sync_read": profile.has_sync_read,
        "bulk_read": profile.has_bulk_read,
        "modes": list(profile.modes),
        "verified": profile.verified,
        "simulated": has_motor(name),
        "table": profile.source,
        "sheet": profile.sheet,
    }


def _row(profile: Profile) -> tuple[object, ...]:
    reads = " ".join(
        kind for kind, has in (("sync", profile.has_sync_read), ("bulk", profile.has_bulk_read)) if has
    )
    return (
        profile.model,
        profile.protocol,
        profile.number,
        profile.ticks,
        f"{profile.range_deg:g}",
        f"{profile.stall_torque:g}",
        f"{profile.no_load_speed / _RPM:.3g}",
        f"{profile.voltage:g}",
        reads or "one by one",
        "the maker's" if profile.verified else "not verified",
    )


_REGISTER = ("register", "address", "bytes", "access", "range", "new", "unit", "sign")


def _register(row: Register) -> tuple[object, ...]:
    sign = "" if row.sign == "none" else row.sign
    return (
        row.name,
        row.address,
        row.width,
        row.access,
        f"{row.low}..{row.high}",
        row.initial,
        row.unit,
        sign,
    )
