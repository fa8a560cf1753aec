"""The file ``validation.json`` is read strictly, and a verdict may not contradict itself."""

from __future__ import annotations

import json
import math
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

import screwkin as sk
from screwkin.analysis.verdict import Criteria, Verdict, contradictions, verdict_from_json
from screwkin.errors import InputError
from tests.verdicts import passing_data

CONTRACT = "passed reasons warnings engine engine_settings servo criteria trajectory_sha256 robot_sha256"


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    path: Path = tmp_path_factory.mktemp("good") / "trajectory.npz"
    return passing_data(sk.walk(sk.load_robot("bioloid"), sk.load_gait("smooth"), 1).save(path))


def read(data: dict[str, Any]) -> Verdict:
    return verdict_from_json(json.dumps(data))


def test_a_verdict_survives_its_file(good: dict[str, Any]) -> None:
    assert read(good).to_dict() == good
    assert contradictions(read(good)) == ()
    assert set(good) >= {*CONTRACT.split(), "servo_map_sha256", "rate", "versions"}


NAMES = [f.name for f in fields(Verdict)]


@pytest.mark.parametrize("name", NAMES)
def test_every_field_must_be_there(good: dict[str, Any], name: str) -> None:
    with pytest.raises(InputError, match=f"{name}: field required"):
        read({key: value for key, value in good.items() if key != name})


@pytest.mark.parametrize("name", NAMES)
def test_every_field_must_be_of_its_kind(good: dict[str, Any], name: str) -> None:
    """A list of nulls is of no field's kind, nor is a text where a number, a list or a flag is due."""
    for wrong in ([[None]], "1" if not isinstance(good[name], str) else 1):
        with pytest.raises(InputError, match=name):
            read(good | {name: wrong})


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_no_number_may_be_missing(good: dict[str, Any], number: float) -> None:
    names = [name for name, value in good.items() if isinstance(value, float)]
    for name in names:
        with pytest.raises(InputError, match=f"{name}: input should be a finite number"):
            read(good | {name: number})
    with pytest.raises(InputError, match="torque_use"):
        read(good | {"torque_use": {"right_knee": number}})


def test_unknown_fields_are_refused_at_every_depth(good: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="approved: unexpected"):
        read(good | {"approved": True})
    with pytest.raises(InputError, match="criteria"):
        read(good | {"criteria": good["criteria"] | {"leniency": 1.0}})
    schedule = good["criteria"]["schedule"] | {"nap": 1.0}
    with pytest.raises(InputError, match="criteria"):
        read(good | {"criteria": good["criteria"] | {"schedule": schedule}})


def test_nested_without_end_is_refused_and_no_recursion(good: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="nested 3,000 deep"):
        verdict_from_json("[" * 3000 + "]" * 3000)
    deep = json.dumps(good)[:-1] + ', "x": ' + '{"x":' * 3000 + "1" + "}" * 3000 + "}"
    with pytest.raises(InputError, match="nested 3,001 deep"):
        verdict_from_json(deep)
    assert read(good | {"warnings": ["[" * 100 + '\\"']}).warnings


SPEAKS_AGAINST = [
    ({"fell": True}, "fell"),
    ({"fell_at": 1.0}, "fell at 1.00 s"),
    ({"reasons": ["slipped"]}, "slipped"),
    ({"engine": "kinematic"}, "confirms nothing"),
    ({"engine": "none"}, "confirms nothing"),
    ({"engine": "pybullet+kinematic"}, "confirms nothing"),
    ({"engine": ""}, "confirms nothing"),
    ({"end_error_mm": 500.0}, "end error 500.0 mm"),
    ({"slip_mm": 10.1}, "slips 10.1 mm"),
    ({"min_margin_mm": -0.1}, "leaves the support polygon"),
    ({"torque_use": {"right_knee": 1.0}}, "right_knee 100 %"),
    ({"zmp_rms_mm": None}, "no ZMP was measured"),
    ({"slip_mm": -1.0}, "slip_mm is -1, below 0"),
    ({"max_tilt_deg": 80.0}, "tilted by 80 deg"),
    ({"repeated": {}}, "falls in None"),
    ({"engine_settings": {"mujoco": {"feedback": {}}}}, "recorded commands"),
    ({"engine_settings": {"mujoco": {"perturbation": {"push": [0, 0, 1.0]}}}}, "not the planned one"),
    ({"repeated": {"fallen": 1, "runs": 4}}, "falls in 1 of 4"),
]


@pytest.mark.parametrize(("change", "said"), SPEAKS_AGAINST)
def test_what_speaks_against_a_pass_is_named(good: dict[str, Any], change: dict[str, Any], said: str) -> None:
    assert said in "; ".join(contradictions(read(good | change)))


@pytest.mark.parametrize(
    ("name", "weaker", "stricter"),
    [
        ("end_error", 0.02, 0.005),
        ("end_error_share", 1.0, 0.01),
        ("slip", 1.0, 0.005),
        ("torque_share", 2.0, 0.9),
        ("frame_deviation", 0.006, 0.001),
    ],
)
def test_weaker_criteria_are_no_verdict_of_this_version(
    good: dict[str, Any], name: str, weaker: float, stricter: float
) -> None:
    def judged_by(value: float) -> tuple[str, ...]:
        return contradictions(read(good | {"criteria": good["criteria"] | {name: value}}))

    assert f"judged by {name} = {weaker:g}" in judged_by(weaker)[0]
    assert judged_by(stricter) == ()


@pytest.mark.parametrize(
    ("name", "weaker"), [("hold", 0.0), ("settle", 0.1), ("fallen_height", 0.1), ("fallen_tilt", 1.5)]
)
def test_a_laxer_idea_of_a_fall_is_no_verdict_of_this_version(
    good: dict[str, Any], name: str, weaker: float
) -> None:
    schedule = good["criteria"]["schedule"] | {name: weaker}
    verdict = read(good | {"criteria": good["criteria"] | {"schedule": schedule}})
    assert f"judged by {name}" in contradictions(verdict)[0]
    assert Criteria().schedule != verdict.criteria.schedule
