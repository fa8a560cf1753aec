"""A row says what plan and simulation say, and what goes wrong in it is its outcome."""

from __future__ import annotations

import csv
import io
import json

import numpy as np
import pytest

import screwkin as sk
from screwkin.campaign import row as campaign_row
from screwkin.campaign.outcome import Outcome, outcome_from_dict
from screwkin.campaign.plan import Campaign, CampaignRow
from screwkin.campaign.row import gait_of, played_row, walk_of_setting
from screwkin.campaign.sheet import finished_rows, rows_arrays, rows_csv
from screwkin.errors import GaitError, UnreachableError
from screwkin.files import npz_bytes, read_npz
from screwkin.model.robot import robot_text

ROBOT = sk.load_robot("bioloid")
GAIT = sk.load_gait("walk").replace(steps=1, rate=20)


def campaign(**axes: tuple[str, ...]) -> Campaign:
    conditions = {"gait": ("mine",), "engine": ("kinematic",), "servo": ("rigid",)}
    conditions |= {"feedback": ("off",), "perturb": ("none",)}
    return Campaign(robot_text(ROBOT), {"mine": json.dumps(GAIT.to_dict())}, conditions | axes, (3, 4), {})


def test_a_row_is_the_walk_of_its_setting_and_its_verdict():
    plan = campaign(Tc=("1.2",))
    walk = sk.walk(ROBOT, GAIT.replace(Tc="1.2"))
    assert walk_of_setting(plan, plan.rows[0].values).sha256 == walk.sha256
    check = sk.validate(ROBOT, walk, "kinematic")
    outcome = played_row(plan, plan.rows[1])
    assert outcome.row == 1
    assert outcome.margin_mm == check.min_margin_mm
    assert outcome.end_error_mm == check.end_error_mm
    assert outcome.reason == "; ".join(check.reasons)


def test_an_engine_without_forces_knows_of_no_fall():
    plan = campaign()
    assert played_row(plan, plan.rows[0]).status == "planned"


def test_a_walk_that_cannot_be_is_refused_by_its_reason_once_planned(monkeypatch):
    calls = []

    def out_of_reach(*_: object) -> None:
        calls.append(1)
        raise UnreachableError("right_leg out of reach", "right_leg")

    monkeypatch.setattr(campaign_row, "walk", out_of_reach)
    plan = campaign(stride=("0.5",))
    first, second = (played_row(plan, row) for row in plan.rows)
    assert first == Outcome(0, "refused", reason="right_leg out of reach")
    assert second == Outcome(1, "refused", reason="right_leg out of reach")
    assert len(calls) == 1


def test_what_fails_in_a_row_is_its_crash(monkeypatch):
    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("of a simulator")

    monkeypatch.setattr(campaign_row, "validate", broken)
    plan = campaign()
    outcome = played_row(plan, plan.rows[0])
    assert (outcome.status, outcome.reason) == ("crashed", "ZeroDivisionError: of a simulator")


def test_an_interrupt_is_no_outcome(monkeypatch):
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(campaign_row, "validate", interrupted)
    plan = campaign()
    with pytest.raises(KeyboardInterrupt):
        played_row(plan, plan.rows[0])


def test_a_key_that_is_no_parameter_is_refused_before_anything_is_played():
    with pytest.raises(GaitError, match="strid"):
        gait_of(campaign(strid=("0.1",)), {**campaign(strid=("0.1",)).settings[0]})


def test_tables_hold_every_row_as_it_ended():
    plan = campaign(stride=("0.03", "0.5"))
    outcomes = {
        0: Outcome(0, "stood", passed=True, margin_mm=1 / 3),
        2: Outcome(2, "refused", reason="out of reach, by 3 mm"),
        3: Outcome(3, "fell", fell_at=1.25, margin_mm=-2.0),
    }
    rows = finished_rows(plan, outcomes)
    arrays = read_npz(npz_bytes(rows_arrays(plan, rows)))
    assert arrays["row"].tolist() == [0, 2, 3]
    assert arrays["seed"].tolist() == [3, 3, 4]
    assert [arrays["statuses"][k] for k in arrays["status"]] == ["stood", "refused", "fell"]
    np.testing.assert_array_equal(arrays["margin_mm"], [1 / 3, np.nan, -2.0])
    np.testing.assert_array_equal(arrays["fell_at"], [np.nan, np.nan, 1.25])
    assert arrays["passed"].tolist() == [True, False, False]
    stride = [*arrays["keys"]].index("stride")
    assert [arrays["settings"][k, stride] for k in arrays["setting"]] == ["0.03", "0.5", "0.5"]
    lines = [*csv.DictReader(io.StringIO(rows_csv(plan, rows)))]
    assert [line["stride"] for line in lines] == ["0.03", "0.5", "0.5"]
    assert [line["reason"] for line in lines] == ["", "out of reach, by 3 mm", ""]
    assert float(lines[0]["margin_mm"]) == 1 / 3
    assert lines[1]["margin_mm"] == ""


def test_an_outcome_is_its_json_data():
    plan = campaign()
    outcome = played_row(plan, CampaignRow(7, 0, 0, 3, plan.settings[0]))
    assert outcome_from_dict(json.loads(json.dumps(outcome.to_dict()))) == outcome
