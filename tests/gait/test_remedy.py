"""Gaits that a robot cannot follow: the message names the gait's key, and the value in it works."""

from __future__ import annotations

import re

import numpy as np
import pytest

import screwkin as sk
from screwkin.errors import NoSolutionError
from screwkin.gait.keys import NUMBERS
from screwkin.gait.lengths import lengths_of

KEYS = "|".join(NUMBERS)


def advised(message: str) -> dict[str, float]:
    """Keys and values that a message says to work."""
    single = re.search(rf"({KEYS}) \S+ is [^:]*: (\S+) works", message)
    if single:
        return {single[1]: float(single[2])}
    together = re.search(r"do not fit together: (.*) work", message)
    assert together, message
    return {key: float(value) for key, value in re.findall(rf"({KEYS}) ([-\d.e]+)", together[1])}


def refused(robot: str, gait: str, changes: dict[str, float]) -> str:
    """The message of a walk, after trying what it says."""
    model, wrong = sk.load_robot(robot), sk.load_gait(gait).replace(**changes)
    with pytest.raises(NoSolutionError) as caught:
        sk.walk(model, wrong, 1)
    message = str(caught.value)
    sk.walk(model, wrong.replace(**advised(message)), 1)
    return message


@pytest.mark.parametrize(
    ("robot", "gait", "changes", "key"),
    [
        ("bioloid", "walk", {"stride": 0.5}, "stride"),
        pytest.param("bioloid", "walk", {"turn": 1.2}, "turn", marks=pytest.mark.slow),
        pytest.param("poppy12", "walk", {}, "waist_height", marks=pytest.mark.slow),
    ],
)
def test_a_refusal_names_the_key_and_a_value_that_works(robot, gait, changes, key):
    assert key in advised(refused(robot, gait, {"rate": 10, **changes}))


def test_a_waist_above_the_stretched_legs_is_told_by_their_reach():
    message = refused("bioloid", "walk", {"rate": 10, "waist_height": 0.21})
    reach = lengths_of(sk.load_robot("bioloid"))["leg"]
    assert f"waist_height 0.21 is above what right_leg reaches, {reach:.3g}: " in message


def test_legs_that_reach_no_further_on_level_soles_are_told_by_how_much_feet_may_pitch():
    robot = sk.load_robot("bioloid")
    gait = sk.load_gait("preview").replace(stride=0.165, waist_height=0.16)
    with pytest.raises(NoSolutionError) as caught:
        sk.walk(robot, gait, 4)
    angle = re.search(r"; or soles stay level: toe and heel (\S+) work", str(caught.value))[1]
    assert sk.walk(robot, gait.replace(toe=angle, heel=angle), 4).margin.min() > 0
    with pytest.raises(NoSolutionError, match="out of reach") as caught:
        sk.walk(robot, gait.replace(toe=angle, heel=angle, stride=0.25), 4)
    assert "toe" not in str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["bioloid", "poppy12"])
def test_every_refusal_of_random_gaits_names_a_key_that_was_changed(robot):
    rng = np.random.default_rng(20)
    leg = lengths_of(sk.load_robot(robot))["leg"]
    spans = {
        "stride": (-1.5 * leg, 1.5 * leg),
        "side": (-0.3 * leg, 0.3 * leg),
        "turn": (-1.0, 1.0),
        "lift": (0.02 * leg, 0.8 * leg),
        "waist_height": (0.2 * leg, 1.3 * leg),
        "spread": (-0.1 * leg, 0.4 * leg),
    }
    gait = "walk" if robot == "bioloid" else "poppy12-preview"
    walks = refusals = 0
    for _ in range(24):
        chosen = rng.choice(list(spans), size=rng.integers(1, 3), replace=False)
        changes = {str(key): float(f"{rng.uniform(*spans[key]):.3g}") for key in chosen}
        try:
            sk.walk(sk.load_robot(robot), sk.load_gait(gait).replace(rate=10, **changes), 2)
            walks += 1
        except NoSolutionError as error:
            refusals += 1
            said = str(error)
            assert any(re.search(rf"\b{key}\b", said) for key in changes), (changes, said)
    assert walks
    assert refusals > 5
