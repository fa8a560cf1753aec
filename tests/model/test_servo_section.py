"""Faults of ``[servos]`` stop a table at the door, all at once, with what would be right."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from screwkin.errors import Fault, TableError
from screwkin.model.servo_models import model_names
from screwkin.model.servo_section import KEYS
from screwkin.model.table import load_robot
from screwkin.model.toml_out import table_text
from screwkin.servo.servo_map import ServoMap, map_faults
from tests.model.tables import MINI, faults_of, parse_robot

Servos = dict[str, Any]
MINI_JOINTS = ("right_hip", "right_knee", "left_hip", "left_knee")


def sound(draw: Callable[..., Any]) -> Servos:
    """A section without faults for the joints of MINI."""
    ids = draw(st.lists(st.integers(0, 252), min_size=4, max_size=4, unique=True))
    angle = st.floats(-3.0, 3.0)
    return {
        "model": draw(st.sampled_from(["AX-12A", "ax-12", "MX-28"])),
        "ids": dict(zip(MINI_JOINTS, ids, strict=True)),
        "direction": draw(
            st.dictionaries(st.sampled_from(MINI_JOINTS), st.sampled_from([1, -1]), min_size=1)
        ),
        "zero": draw(st.dictionaries(st.sampled_from(MINI_JOINTS), angle, min_size=1)),
        "baud": draw(st.sampled_from([115200, 1_000_000])),
        "range_deg": draw(st.floats(100.0, 360.0)),
        "stiffness": draw(st.floats(1.0, 99.0)),
        "gain": draw(st.floats(1.0, 99.0)),
    }


def unknown_model(servos: Servos) -> tuple[str, str]:
    servos["model"] = "SR-581"
    return "model: 'SR-581' is unknown", "Did you mean 'SR-518'?"


def unknown_model_of_a_joint(servos: Servos) -> tuple[str, str]:
    servos["models"] = {"left_hip": 12}
    return "models.left_hip: 12 is unknown", "Known are "


def id_given_twice(servos: Servos) -> tuple[str, str]:
    servos["ids"]["left_hip"] = servos["ids"]["right_hip"]
    return f"ids: {servos['ids']['right_hip']} is given to right_hip, left_hip", "an id of its own"


def id_beyond_the_bus(servos: Servos) -> tuple[str, str]:
    servos["ids"]["right_knee"] = 253
    return "ids.right_knee: is 253", "from 0 to 252"


def id_of_no_joint(servos: Servos) -> tuple[str, str]:
    servos["ids"]["rihgt_knee"] = next(i for i in range(252) if i not in servos["ids"].values())
    return "ids.rihgt_knee: is no joint", "Did you mean 'right_knee'?"


def unknown_key(servos: Servos) -> tuple[str, str]:
    servos["directions"] = servos["direction"]
    return "directions: is unknown", "Did you mean 'direction'?"


def direction_of_three(servos: Servos) -> tuple[str, str]:
    servos["direction"]["right_hip"] = 3
    return "direction.right_hip: is 3", "Write 1 or -1"


def zero_in_degrees(servos: Servos) -> tuple[str, str]:
    servos["zero"]["right_hip"] = 45
    return "zero.right_hip: is 45", "in rad"


def endless_range(servos: Servos) -> tuple[str, str]:
    servos["range_deg"] = 720
    return "range_deg: is 720", "up to 360"


def no_gain(servos: Servos) -> tuple[str, str]:
    servos["gain"] = 0
    return "gain: is 0", "above 0"


def negative_stiffness(servos: Servos) -> tuple[str, str]:
    servos["stiffness"] = {"default": 5.0, "left_hip": -1.0}
    return "stiffness.left_hip: is -1.0", "positive number in N m/rad"


FAULTS = (
    unknown_model,
    unknown_model_of_a_joint,
    id_given_twice,
    id_beyond_the_bus,
    id_of_no_joint,
    unknown_key,
    direction_of_three,
    zero_in_degrees,
    endless_range,
    no_gain,
    negative_stiffness,
)


def with_servos(servos: Mapping[str, Any]) -> str:
    return MINI + "\n" + table_text({"servos": servos})


@given(st.data())
def test_a_table_is_refused_for_every_fault_of_its_servos_at_once_and_for_nothing_else(data):
    servos = sound(data.draw)
    assert parse_robot(with_servos(servos)).servos == servos
    injected = data.draw(st.lists(st.sampled_from(FAULTS), unique=True, min_size=1))
    expected = [inject(servos) for inject in injected]
    faults = faults_of(with_servos(servos))
    texts = [str(fault) for fault in faults]
    for found, fix in expected:
        assert any(f"[servos], key {found}" in text and fix in text for text in texts), (found, texts)
    assert len(faults) == len(injected)


@given(st.data())
def test_what_stops_a_table_stops_the_bus_with_the_same_words(data):
    servos = sound(data.draw)
    robot = parse_robot(with_servos(servos))
    for inject in data.draw(st.lists(st.sampled_from(FAULTS), unique=True, min_size=1)):
        inject(servos)
    faults = faults_of(with_servos(servos))
    with pytest.raises(TableError) as caught:
        ServoMap.of(replace(robot, servos=copy.deepcopy(servos)))
    assert set(faults) <= set(caught.value.faults)


@given(st.data())
def test_what_a_simulation_needs_is_enough_for_a_table(data):
    servos = sound(data.draw)
    kept = {key: servos[key] for key in data.draw(st.sets(st.sampled_from(sorted(servos))))}
    assert parse_robot(with_servos(kept)).servos == kept


def test_servos_of_mirrored_and_passive_joints():
    passive = MINI.replace('name = "right_knee"', 'name = "right_knee"\npassive = true')
    text = passive + "\n[servos]\nids = { right_hip = 1, left_hip = 2 }\n"
    assert parse_robot(text).servos["ids"] == {"right_hip": 1, "left_hip": 2}
    robot = parse_robot(
        text.replace("left_hip = 2", 'left_hip = 2, left_knee = 3 }\nmodels = { left_hip = "AX-12A"')
    )
    fault = next(fault for fault in map_faults(robot) if fault.key == "ids.left_knee")
    fix = "Joints with motors are right_hip, left_hip"
    assert fault == Fault("[servos]", "ids.left_knee", "is turned by no motor", fix)


def test_a_joint_without_servo_is_a_fault_of_the_bus_alone():
    """A neck that is not yet mounted keeps no robot from walking."""
    ids = {name: i for i, name in enumerate(MINI_JOINTS) if name != "left_knee"}
    robot = parse_robot(with_servos({"model": "AX-12A", "ids": ids}))
    (fault,) = map_faults(robot)
    assert (fault.key, fault.found) == ("ids", "has none for left_knee")


def test_joints_that_a_failed_mirror_would_have_made_are_not_called_unknown():
    text = MINI.replace('of = "right_leg"', 'of = "right_lge"') + "\n[servos]\nids = { left_hip = 2 }\n"
    assert not [fault for fault in faults_of(text) if fault.row == "[servos]"]


def test_models_for_some_joints_alone_are_a_fault_of_the_bus():
    servos = {"models": {"left_hip": "AX-12A"}, "ids": {name: i for i, name in enumerate(MINI_JOINTS)}}
    robot = parse_robot(with_servos(servos))
    (fault,) = map_faults(robot)
    assert (fault.key, fault.found) == ("models", "has none for right_hip, right_knee, left_knee")


def test_every_bundled_model_may_be_named_and_every_key_is_known():
    for name in model_names():
        assert parse_robot(with_servos({"model": name.lower()})).servos["model"] == name.lower()
    for name in ("bioloid", "bioloid24", "poppy12", "linkages/parallel-ankles"):
        assert set(load_robot(name).servos) <= set(KEYS)
        assert not map_faults(load_robot(name))
