"""``screwkin bus profiles``: the models that a bus can talk to, and a user's own."""

from __future__ import annotations

from importlib.resources import files

from screwkin.servo.profiles import profile_models

BUNDLED = {
    "AX-12A",
    "AX-18A",
    "MX-28",
    "MX-28-2",
    "MX-64",
    "MX-106",
    "XL-320",
    "XL330-M288",
    "XL430-W250",
    "XM430-W350",
    "XC330-M288",
    "SR-518",
    "STS3215",
}


def test_the_command_lists_models_and_shows_one(cli, refused, tmp_path):
    listed = cli("bus", "profiles", "--json").data["models"]
    assert [row["model"] for row in listed] == list(profile_models())
    assert {row["model"] for row in listed} >= BUNDLED
    assert [row["model"] for row in listed if not row["verified"]] == ["SR-518"]
    text = (files("screwkin.motors") / "models" / "ax-12a.toml").read_text("utf-8")
    mine = tmp_path / "mine.toml"
    mine.write_text(text.replace("AX-12A", "MINE"), encoding="utf-8")
    (own,) = cli("bus", "profiles", mine, "--json").data["models"]
    assert own["registers"]["goal_position"]["address"] == 30
    assert "goal_position" in cli("bus", "profiles", "STS3215").out
    mine.write_text(text.replace("ticks = 1024", "ticks = 0"), encoding="utf-8")
    assert "key ticks: is 0" in refused(cli("bus", "profiles", mine), 2)
    assert "AX-12A" in refused(cli("bus", "profiles", "AX-12B"), 2)
