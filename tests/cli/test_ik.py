"""``screwkin ik``: the table of methods, as text and as JSON, and what it refuses."""

from __future__ import annotations

import pytest

from tests.cli.conftest import Cli, told_once

FIELDS = {"method", "mean_iterations", "max_iterations", "solved", "in_limits", "microseconds"}


def test_json_holds_a_row_for_every_method_on_random_poses(cli: Cli) -> None:
    called = cli("ik", "bioloid", "left_hand", "--poses", 3, "--json")
    assert called.code == 0
    data = called.data
    assert (data["robot"], data["limb"]) == ("bioloid", "left_arm")
    for row in data["rows"]:
        assert set(row) >= FIELDS
    assert {"newton", "lm", "pinv"} <= {row["method"] for row in data["rows"]}
    assert {row["method"]: row["iterations"] for row in data["paper"]}["numerical DLS"] == 104


def test_text_tells_rows_paper_and_settings(cli: Cli) -> None:
    called = cli("ik", "bioloid", "left_arm", "--poses", 3)
    assert called.code == 0
    assert "random poses inside the limits, 3 points" in called.out
    assert "numerical pseudoinverse  205" in called.out
    assert "an unsolved sample counts 500 iterations" in called.out


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("bioloid", "tail"), 2, "valid: right_leg"),
        (("nobody", "left_leg"), 2, "unknown robot"),
        (("bioloid", "left_leg", "--poses", "0"), 2, "poses is 0"),
        (("bioloid", "left_leg", "--waist", "0.3"), 3, "left_leg cannot reach point 0 of the walk"),
    ],
)
def test_bad_input_ends_in_one_message(cli: Cli, words: tuple[str, ...], code: int, message: str) -> None:
    assert message in told_once(cli("ik", *words), code)
