"""``screwkin bus``: the verbs that talk to servos, or stand in for them."""

from __future__ import annotations

import typer

from screwkin.cli import APP
from screwkin.cli.bus_configure import bus_configure
from screwkin.cli.bus_identify import bus_identify
from screwkin.cli.bus_profiles import bus_profiles
from screwkin.cli.bus_talk import bus_calibrate, bus_read, bus_scan
from screwkin.cli.bus_virtual import virtual

bus = typer.Typer(**APP)


@bus.callback()
def group() -> None:
    """Servos on a bus. Every verb here takes --json: one JSON object on stdout."""


bus.command("scan")(bus_scan)
bus.command("read")(bus_read)
bus.command("configure")(bus_configure)
bus.command("calibrate")(bus_calibrate)
bus.command("profiles")(bus_profiles)
bus.command("identify")(bus_identify)
bus.command("virtual")(virtual)
