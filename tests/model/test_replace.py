"""``Robot.replace``: other numbers in the same table, and a text that says exactly that."""

from __future__ import annotations

import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import screwkin as sk
from screwkin.errors import InputError, TableError, UnknownNameError
from screwkin.model.library import robot_names
from screwkin.model.record_faults import vars_of
from screwkin.model.records import same_content
from screwkin.model.robot import Robot, robot_text
from screwkin.model.table import load_robot, parse_robot
from screwkin.model.toml_edit import edited
from tests.model.tables import MINI

BIOLOID = load_robot("bioloid")


def comments(text: str) -> int:
    return text.count("#")


def test_a_longer_thigh_moves_everything_that_depends_on_it() -> None:
    longer = BIOLOID.replace(thigh=0.09)
    for side in ("right", "left"):
        assert longer.joint(f"{side}_knee").screw.s0.z == -0.09
        link = longer.link(f"{side}_thigh")
        assert link.com.z == -0.045
        assert link.inertia.xx == pytest.approx(link.mass * (0.04**2 + 0.09**2) / 12)
    state = sk.home(longer)
    assert sk.frame_pose(longer, state, "right_foot")[2, 3] == pytest.approx(0, abs=1e-12)
    assert longer.path == "<bioloid, changed>"
    assert longer.text == BIOLOID.text.replace("thigh = 0.0773829 ", "thigh = 0.09 ")
    assert same_content(longer, parse_robot(longer.text))


def test_masses_limits_speeds_efforts_and_the_name() -> None:
    robot = BIOLOID.replace(
        masses={
            "torso": np.float64(1.2),
            "right_thigh": "0.2 + 0.01",
            "left_calf": 0.19589,
            "right_calf": 0.19589,
        },
        limits={"right_knee": (-0.5, math.inf), "right_hip_yaw": (-0.1, 0.2), "left_hip_yaw": (-0.2, 0.1)},
        velocity={"right_knee": 4},
        effort={"right_knee": math.inf},
        name="other",
    )
    assert (robot.name, robot.link("torso").mass) == ("other", 1.2)
    assert robot.link("left_thigh").mass == robot.link("right_thigh").mass == pytest.approx(0.21)
    for side in ("right", "left"):
        knee = robot.joint(f"{side}_knee")
        assert (knee.lower, knee.upper, knee.velocity, knee.effort) == (-0.5, math.inf, 4.0, math.inf)
    assert (robot.joint("left_hip_yaw").lower, robot.joint("left_hip_yaw").upper) == (-0.2, 0.1)
    assert comments(robot.text) == comments(BIOLOID.text)
    assert same_content(robot, parse_robot(robot.text))


@given(
    st.sampled_from(robot_names()),
    st.floats(0.5, 2.0),
    st.floats(0, 3, allow_subnormal=False),
    st.integers(0, 99),
)
@settings(max_examples=25, deadline=None)
def test_the_new_text_reads_back_to_the_new_robot(name: str, factor: float, mass: float, at: int) -> None:
    robot = load_robot(name)
    rows = tomllib.loads(robot.text)
    numbers = {k: v for k, v in rows.get("parameters", {}).items() if isinstance(v, float)}
    heavy = [row["name"] for row in rows["link"] if row["mass"]]
    joint = rows["joint"][at % len(rows["joint"])]["name"]
    changes = {k: v * factor for k, v in list(numbers.items())[at % 7 : at % 7 + 1] if "height" not in k}
    try:
        new = robot.replace(masses=dict.fromkeys(heavy[at % 3 :], mass), velocity={joint: factor}, **changes)
    except TableError:  # legs too short for the height of the home posture
        return
    assert new.text_matches
    again = parse_robot(new.text)
    assert same_content(new, again)
    assert dict(new.parameters) == dict(again.parameters)
    assert all(new.link(link).mass == mass for link in heavy[at % 3 :])
    assert all(new.parameters[k] == v for k, v in changes.items())
    assert same_content(robot, new.replace(
        masses={link: robot.link(link).mass for link in heavy},
        velocity={joint: robot.joint(joint).velocity},
        **{k: numbers[k] for k in changes},
    ))  # fmt: skip


WRONG = [
    ({"thig": 0.1}, UnknownNameError, "unknown parameter 'thig'; valid: thigh, .* Did you mean 'thigh'"),
    ({"masses": {"torsso": 1}}, UnknownNameError, "unknown link 'torsso'; .* Did you mean 'torso'"),
    ({"limits": {"knee": (0, 1)}}, UnknownNameError, "unknown joint 'knee'"),
    ({"masses": {"left_thigh": 1}}, InputError, "'left_thigh' has no row of its own but mirrors another"),
    ({"thigh": None}, InputError, "thigh is None, expected"),
    ({"thigh": True}, InputError, "thigh is True, expected a number"),
    ({"thigh": math.nan}, InputError, "thigh is nan, expected a finite number"),
    ({"thigh": "calf*"}, TableError, r"key thigh: 'calf\*' is not a formula"),
    ({"limits": {"right_knee": 3}}, InputError, "give a pair"),
    ({"limits": {"right_knee": (1, 2, 3)}}, InputError, "has 3 numbers"),
    ({"limits": {"right_knee": (0, 0.1)}}, TableError, "'home', key q.right_knee: .* lies outside"),
    ({"masses": 3}, InputError, "masses is the int 3, expected Mapping; give values by the name"),
    ({"masses": {"torso": -1}}, TableError, "mass -1 is negative"),
    ({"name": "two words"}, TableError, "'two words' is not a name"),
]


@pytest.mark.parametrize(("change", "error", "words"), WRONG)
def test_wrong_changes_are_refused(change, error, words) -> None:
    with pytest.raises(error, match=words):
        BIOLOID.replace(**change)


def test_a_symbolic_robot_stays_symbolic() -> None:
    robot = load_robot("bioloid", symbolic=True).replace(masses={"torso": 2})
    assert robot.link("torso").mass == 2
    assert str(robot.joint("right_knee").screw.s0.z) == "-thigh"


def test_a_robot_without_a_text_of_its_own_is_written_first() -> None:
    bare = Robot(**{**vars_of(BIOLOID), "text": ""})
    robot = bare.replace(masses={"left_thigh": 0.3})
    assert (robot.link("left_thigh").mass, robot.link("right_thigh").mass) == (0.3, 0.15586)
    heavy = replace(BIOLOID, links=(replace(BIOLOID.links[0], mass=2.0), *BIOLOID.links[1:]))
    robot = heavy.replace(name="heavy")
    assert robot.link("torso").mass == 2.0
    assert robot_text(robot) == robot.text


INLINE = MINI.replace("[parameters]\nthigh = 0.1", "").replace(
    "[robot]", 'parameters.thigh = 0.1 # "quoted" = 3\n[robot] # [parameters]'
)


@pytest.mark.parametrize(
    "text",
    [
        MINI,
        INLINE,
        MINI.replace("[parameters]\nthigh = 0.1", "").replace(
            "[robot]", "parameters = { thigh = 0.1 }\n[robot]"
        ),
        MINI.replace("\n", "\r\n"),
        MINI.replace("thigh = 0.1", '"thigh"   =   0.1# [x'),
        MINI.replace("thigh = 0.1", "'thigh' = 1e-1 # ]"),
        MINI.replace(
            'base = "floating"', 'base = "floating"\ndescription = """\nthigh = 3 # "x"\n[parameters]"""'
        ),
        MINI.replace('base = "floating"', "base = 'floating'\nsource = '''a\n\\''[[link]] # '''"),
    ],
)
def test_values_are_found_however_a_table_is_written(text: str) -> None:
    robot = parse_robot(text)
    new = robot.replace(thigh=0.15, masses={"trunk": 3}, limits={"right_hip": (-0.5, math.inf)})
    assert new.parameters["thigh"] == 0.15
    assert new.link("trunk").mass == 3
    assert (new.joint("right_hip").lower, new.joint("right_hip").upper) == (-0.5, math.inf)
    assert same_content(new, parse_robot(new.text))


def test_rows_in_one_array_are_written_anew() -> None:
    text = 'a = [{ x = 1, y = "f*2" }, { x = 2 }] # comment\nb = 3\n'
    new = edited(text, {("a", 1, "x"): 5})
    assert tomllib.loads(new) == {"a": [{"x": 1, "y": "f*2"}, {"x": 5}], "b": 3}


def test_a_key_left_out_is_written_at_the_end_of_its_row() -> None:
    text = "[[a]]\nx = 1 # one\n\n[[a]] # two\n[c]\n"
    new = edited(text, {("a", 0, "y"): 2, ("a", 1, "y"): 3, ("c", "z"): "w"})
    assert new == '[[a]]\nx = 1 # one\ny = 2\n\n[[a]] # two\ny = 3\n[c]\nz = "w"\n'
    assert edited(new, {("a", 0, "y"): None, ("c", "z"): None}) == text.replace(
        "[[a]] # two\n", "[[a]] # two\ny = 3\n"
    )
