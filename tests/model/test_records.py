"""Robots made from records: checked as files are, with the same words; and what their text says."""

from __future__ import annotations

import copy
import math
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import screwkin as sk
from screwkin.algebra.screws import INFINITE
from screwkin.algebra.se3 import Pose, Rotation, Vector, X, Y, Z
from screwkin.errors import InputError, TableError
from screwkin.model.library import robot_names
from screwkin.model.record_faults import check_records, record_faults, vars_of
from screwkin.model.records import RobotRecord, same_content
from screwkin.model.robot import Closure, Inertia, Robot, robot_text
from screwkin.model.sound import certified
from screwkin.model.table import load_robot, parse_robot
from tests.model.tables import MINI, changed, only_fault

NAMES = robot_names()
BIOLOID = load_robot("bioloid")


def with_row(robot: Any, table: str, index: int, **change: Any) -> RobotRecord:
    """The records of a robot, unchecked, with one of them changed."""
    rows = list(getattr(robot, table))
    rows[index] = replace(rows[index], **change)
    return RobotRecord(**{**vars_of(robot), table: tuple(rows)})


def faults_of(record: RobotRecord) -> list[str]:
    """What a robot of these records is refused for."""
    with pytest.raises(TableError) as caught:
        Robot(**vars_of(record))
    return [str(fault) for fault in caught.value.faults]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("symbolic", [False, True])
def test_bundled_robots_have_no_faults_and_are_certified_at_a_glance(name: str, symbolic: bool) -> None:
    robot = load_robot(name, symbolic)
    assert not record_faults(robot)
    assert symbolic or certified(robot)


SAME = [
    ('name = "right_shin"\nmass = 0', 'name = "right_shin"\nmass = -1', ("links", 2, {"mass": -1})),
    ("s = [0, 1, 0]", "s = [0, 1, 1]", ("joints", 0, {"s": Vector(0, 1, 1)})),
    ("lower = -1\n", "lower = 3\n", ("joints", 0, {"lower": 3})),
    ('parent = "trunk"', 'parent = "trnk"', ("joints", 0, {"parent": "trnk"})),
    ('child = "right_thigh"', 'child = "right_shin"', ("joints", 0, {"child": "right_shin"})),
    ('parent = "trunk"', 'parent = "right_shin"', ("joints", 0, {"parent": "right_shin"})),
    ('name = "right_leg"', 'name = "right leg"', ("limbs", 0, {"name": "right leg"})),
    ("base_height = 0.2", 'base_height = "1e999"', ("postures", 0, {"base_height": math.inf})),
    ("right_hip = 0.5", "right_hip = 2.5", ("postures", 0, {"q": (2.5, 0.0)})),
    ("lower = -1\n", "lower = -1\neffort = 0\n", ("joints", 0, {"effort": 0})),
]
ONE_LEG = changed(
    ", left_hip = 0.5", "", changed('[[limb]]\nname = "left_leg"\nmirror = "y"\nof = "right_leg"\n', "")
)


@pytest.mark.parametrize(("old", "new", "change"), SAME)
def test_records_are_refused_in_the_words_of_a_file(old: str, new: str, change: Any) -> None:
    table, index, values = change
    robot = parse_robot(ONE_LEG)
    if "s" in values:
        values = {"screw": replace(robot.joints[index].screw, **values)}
    faults = faults_of(with_row(robot, table, index, **values))
    with pytest.raises(TableError) as caught:
        parse_robot(changed(old, new, ONE_LEG))
    expected = list(map(str, caught.value.faults))
    if "inf" not in faults[0]:
        assert faults == expected
    assert len(faults) == len(expected)


def test_dataclasses_replace_is_checked_too() -> None:
    with pytest.raises(TableError, match=r"\[\[link\]\] 1 'torso', key mass: mass -1 is negative"):
        replace(BIOLOID, links=(replace(BIOLOID.links[0], mass=-1), *BIOLOID.links[1:]))


FOREIGN = [
    ("links", 0, {"mass": math.nan}, "key mass: nan is not finite"),
    ("links", 0, {"mass": "1"}, "key mass: found '1'. Give a number"),
    ("links", 0, {"com": (0, 0, 0)}, "key com: found (0, 0, 0). Give a Vector"),
    ("links", 1, {"com": Vector(0, math.nan, 0)}, "key com: nan is not finite"),
    ("links", 0, {"boxes": []}, "key boxes: is a list. Give a tuple"),
    ("links", 0, {"frame": Pose(Rotation(X, Y, -Z), Vector(0, 0, 0))}, "key frame: is no rotation"),
    ("links", 0, {"frame": Pose(Rotation(X, X, Z), Vector(0, 0, 0))}, "key frame: is no rotation"),
    ("joints", 0, {"type": "prismatic"}, "key screw.pitch: 0 on a prismatic joint. Give the pitch INFINITE"),
    ("joints", 0, {"type": "spherical"}, "key type: found 'spherical'"),
    ("joints", 0, {"lower": math.nan}, "key lower: nan is not finite"),
    ("joints", 0, {"name": 3}, "key name: found 3. Give a text"),
    ("postures", 0, {"q": (0.0,)}, "key q: has 1 positions. Give one for each of the 18 joints"),
    ("limbs", 0, {"chain": ("px", "px")}, "key chain: ['px', 'px'] has a coupling twice"),
    ("limbs", 0, {"tip": "torso"}, "tip 'torso' has the name of a link"),
    ("soles", 0, {"corners": ()}, "key corners: 0 given"),
]


@pytest.mark.parametrize(("table", "index", "change", "words"), FOREIGN)
def test_what_only_records_can_get_wrong_is_named(table: str, index: int, change: Any, words: str) -> None:
    assert words in faults_of(with_row(BIOLOID, table, index, **change))[0]


def test_a_waist_is_checked_too() -> None:
    turned = Pose(Rotation(Y, -X, Z), Vector(0.1, 0, 0))
    assert robot_text(replace(BIOLOID, waist=turned)).count("[waist]") == 1
    for waist, words in (
        (Pose(Rotation(X, Y, -Z), Vector(0, 0, 0)), "[waist]: is no rotation"),
        (Pose(Rotation(X, Y, Z), Vector(0, 0, math.inf)), "[waist], key xyz: inf is not finite"),
        (Vector(0, 0, 0), "[waist]: found Vector"),
    ):
        assert words in faults_of(RobotRecord(**{**vars_of(BIOLOID), "waist": waist}))[0]


def test_a_pitch_must_fit_the_type_of_its_joint() -> None:
    screw = replace(BIOLOID.joints[3].screw, pitch=0.01)
    (fault,) = faults_of(with_row(BIOLOID, "joints", 3, screw=screw))
    assert fault.startswith("[[joint]] 4 'right_knee', key pitch: 0.01 on a revolute joint")
    screw = replace(screw, pitch=INFINITE)
    assert "not finite" in faults_of(with_row(BIOLOID, "joints", 3, screw=screw))[0]


def test_a_list_of_records_is_named() -> None:
    (fault,) = faults_of(RobotRecord(**{**vars_of(BIOLOID), "joints": list(BIOLOID.joints)}))
    assert fault == "robot, key joints: is a list. Give a tuple of Joint records"


numbers = st.one_of(st.floats(-2, 2), st.sampled_from([0, 1, -1, math.nan, math.inf, -math.inf]))
NUMERIC = {"links": ("mass",), "joints": ("lower", "upper", "velocity", "effort")}
NAMED = {
    "links": ("name",),
    "joints": ("name", "parent", "child"),
    "limbs": ("name", "link", "tip"),
    "soles": ("limb",),
}


@st.composite
def broken(draw: st.DrawFn) -> RobotRecord:
    """A bundled robot with some names and numbers exchanged at random."""
    record: Any = load_robot(draw(st.sampled_from(NAMES)))
    words = [*record.link_names, *record.joint_names, *record.tip_names, "base", "two words"]
    for _ in range(draw(st.integers(1, 3))):
        names = draw(st.booleans())
        keys = NAMED if names else NUMERIC
        table = draw(st.sampled_from([table for table in keys if getattr(record, table)]))
        index = draw(st.integers(0, len(getattr(record, table)) - 1))
        value = draw(st.sampled_from(words) if names else numbers)
        record = with_row(record, table, index, **{draw(st.sampled_from(keys[table])): value})
    return record


@given(broken())
@settings(max_examples=60, deadline=None)
def test_the_quick_look_certifies_only_what_the_checks_of_files_accept(record: RobotRecord) -> None:
    faults = record_faults(record)
    assert not (certified(record) and faults)
    if faults:
        with pytest.raises(TableError):
            check_records(record)
    else:
        assert same_content(record, Robot(**vars_of(record)))


@given(st.sampled_from(NAMES), st.floats(0.1, 3), st.integers(0, 30))
@settings(max_examples=20, deadline=None)
def test_the_text_of_changed_records_describes_the_changed_robot(name: str, factor: float, at: int) -> None:
    robot = load_robot(name)
    assert robot_text(robot) == robot.text
    link = robot.links[at % len(robot.links)]
    heavier = replace(
        robot, links=tuple(replace(x, mass=x.mass * factor + 0.1) if x is link else x for x in robot.links)
    )
    assert not heavier.text_matches
    again = parse_robot(robot_text(heavier))
    assert again.link(link.name).mass == heavier.link(link.name).mass
    assert again.joint_names == heavier.joint_names


def test_a_renamed_robot_is_recorded_under_its_new_name() -> None:
    assert 'name = "other"' in robot_text(replace(BIOLOID, name="other"))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("symbolic", [False, True])
def test_robots_survive_pickles_and_copies(name: str, symbolic: bool) -> None:
    robot = load_robot(name, symbolic)
    _ = robot.traversal, robot.mass
    for other in (pickle.loads(pickle.dumps(robot)), copy.deepcopy(robot), copy.copy(robot)):  # noqa: S301
        assert isinstance(other, Robot)
        assert same_content(robot, other)
        assert other.text == robot.text
        assert dict(other.parameters) == dict(robot.parameters)


def test_a_robot_prints_in_a_few_lines_and_as_an_escaped_table() -> None:
    lines = repr(BIOLOID).splitlines()
    assert lines[0] == "Robot 'bioloid': floating base 'torso', 19 links, 18 joints, 1.7 kg"
    assert len(lines) <= 4
    assert max(map(len, lines)) <= 120
    html = replace(BIOLOID, description="<b>")._repr_html_()
    assert html.count("<tr>") == 19
    assert "right_knee" in html
    assert "loop" in repr(load_robot("linkages/four-bar"))


def test_faults_of_a_file_keep_their_place() -> None:
    assert only_fault(changed("mass = 0.5", "mass = -0.5")).row == "[[link]] 2 'right_thigh'"


def test_closures_are_refused_with_the_function_that_honours_them() -> None:
    from screwkin.model.robot import refuse_closures

    refuse_closures(BIOLOID, "mass_matrix", "nothing")
    robot = load_robot("linkages/four-bar")
    with pytest.raises(
        InputError, match=r"four-bar has closures \(loop\), and mass_matrix sees .*; use that"
    ):
        refuse_closures(robot, "mass_matrix", "use that")
    assert isinstance(robot.closures[0], Closure)
    assert np.isfinite(sk.home(robot).q).all()
    assert MINI


@given(st.integers(0, 2**31))
@settings(max_examples=60, deadline=None)
def test_a_floor_of_inertia_leaves_a_body(seed: int) -> None:
    rng = np.random.default_rng(seed)
    p = rng.normal(size=(3, 3)) * np.exp(rng.uniform(-8, -3, 3)) @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
    J = 0.02 * sum(np.dot(x, x) * np.eye(3) - np.outer(x, x) for x in p - p.mean(axis=0))
    inertia = Inertia(J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2])
    light = replace(BIOLOID, links=(replace(BIOLOID.links[0], inertia=inertia), *BIOLOID.links[1:]))
    raised = light.with_inertia_floor().links[0].inertia
    assert min(raised.xx, raised.yy, raised.zz) >= 1e-6 * (1 - 1e-12)
