"""Gait files: what is read, what is refused, and what a changed parameter does."""

from __future__ import annotations

import json
import pickle
import re

import numpy as np
import pytest

from screwkin.errors import GaitError, UnknownNameError
from screwkin.gait.files import load_gait, parse_gait
from screwkin.gait.record import gait_from_dict
from screwkin.model.library import find_gait

KEY_POINT_PRESETS = ("backwards", "paper", "sideways", "step-in-place", "turn", "walk")


def faults_of(action):
    with pytest.raises(GaitError) as caught:
        action()
    return {(fault.row, fault.key): f"{fault.found}. {fault.fix}" for fault in caught.value.faults}


def test_the_paper_preset_holds_the_printed_numbers():
    gait = load_gait("paper")
    assert (gait.Tc, gait.stride, gait.lift, gait.swing) == (1.0, 0.2, 0.03, "cubic")
    height = gait.channels["foot_height"]
    assert height.at == pytest.approx([0.1, 0.13, 0.18, 0.5, 0.81, 0.86, 0.89])
    assert height.value == pytest.approx([0, 0.003, 0.009, 0.03, 0.009, 0.003, 0])
    assert gait.channels["waist_side"].value == pytest.approx([0, 0.027, 0.042, 0.027, 0])


def test_the_default_walk_has_the_papers_footholds_a_longer_step_and_smoother_swings():
    gait = load_gait("walk")
    assert (gait.Tc, gait.stride, gait.swing, gait.rate) == (1.5, 0.2, "minimum-jerk", 50.0)


def test_presets_move_as_their_names_say():
    assert load_gait("step-in-place").stride == 0
    assert load_gait("backwards").stride == -0.075
    assert (load_gait("sideways").side, load_gait("sideways").footholds) == (0.04, "close")
    assert load_gait("turn").turn == pytest.approx(np.pi / 18)


def test_a_gait_file_works_by_its_path(tmp_path):
    copy = tmp_path / "mine.toml"
    copy.write_text(find_gait("walk").read_text().replace("Tc = 1.5", "Tc = 1.25"))
    assert load_gait(copy).Tc == 1.25


@pytest.mark.parametrize("name", KEY_POINT_PRESETS)
def test_a_gait_survives_json_and_pickle(name):
    gait = load_gait(name)
    for again in (gait_from_dict(json.loads(json.dumps(gait.to_dict()))), pickle.loads(pickle.dumps(gait))):  # noqa: S301
        assert again.numbers == gait.numbers
        assert again.to_dict() == gait.to_dict()
        for channel in gait.channels.values():
            assert again.channels[channel.name].at.tolist() == channel.at.tolist()
            assert again.channels[channel.name].value.tolist() == channel.value.tolist()


def test_changing_the_data_of_to_dict_leaves_the_gait_alone():
    gait = load_gait("walk")
    gait.to_dict()["channel"]["waist_side"]["value"][2] = 1.0
    assert gait.to_dict()["channel"]["waist_side"]["value"][2] == "sway_middle"


def test_a_changed_parameter_reaches_the_formulas_that_use_it():
    gait = load_gait("paper").replace(Tc=2.0, lift=0.04, sway_middle=0.05)
    assert gait.channels["foot_height"].at[1] == pytest.approx(0.115)
    assert gait.channels["foot_height"].value[3] == pytest.approx(0.04)
    assert gait.channels["waist_side"].value[2] == pytest.approx(0.05)
    assert load_gait("paper").Tc == 1.0


def test_values_may_come_as_text_from_a_command_line():
    gait = load_gait("walk").replace(Tc="1.2", turn="-10*deg", swing="cubic", stride="2*lift")
    assert gait.Tc == 1.2
    assert gait.turn == pytest.approx(-np.pi / 18)
    assert gait.swing == "cubic"
    assert gait.stride == pytest.approx(0.06)


def test_key_points_are_reached_by_dotted_keys():
    one = load_gait("walk").replace(**{"channel.waist_side.value.2": "0.9*sway_middle"})
    assert one.channels["waist_side"].value[2] == pytest.approx(0.0378)
    text = "[0, min(0.02, 0.03), 0.04, 0.02, 0]"
    whole = load_gait("walk").replace(**{"channel.waist_side.value": text})
    assert whole.channels["waist_side"].value == pytest.approx([0, 0.02, 0.04, 0.02, 0])
    array = load_gait("walk").replace(**{"channel.waist_side.value": np.array([0, 0.01, 0.02, 0.01, 0])})
    assert array.channels["waist_side"].value[2] == pytest.approx(0.02)


def test_an_unknown_gait_lists_the_bundled_ones():
    with pytest.raises(UnknownNameError, match=r"unknown gait 'wlak'.*walk"):
        load_gait("wlak")


def test_unknown_keys_of_replace_are_told_all_at_once_with_the_valid_ones():
    faults = faults_of(
        lambda: load_gait("walk").replace(Tcc=1.0, speed=2.0, **{"channel.foot_height.value.9": 1})
    )
    assert set(faults) == {("", "Tcc"), ("", "speed"), ("", "channel.foot_height.value.9")}
    assert re.search("Did you mean 'Tc'.*stride.*sway_middle.*channel.waist_side.value", faults["", "Tcc"])


def test_unknown_keys_of_a_file_are_refused_by_name():
    text = (
        find_gait("walk").read_text()
        + "\n[channel.tail_height]\nat = [0, 1]\nvalue = [0, 0]\n[speed]\nx = 1\n"
    )
    faults = faults_of(lambda: parse_gait(text.replace("[gait]", "[gait]\nstrid = 3")))
    assert "Did you mean 'stride'" in faults["[gait]", "strid"]
    assert "foot_height" in faults["[channel.tail_height]", ""]
    assert "parameters" in faults["[speed]", ""]


def test_every_fault_of_a_file_is_told_at_once():
    text = find_gait("walk").read_text()
    for good, bad in (("Tc = 1.5", "Tc = -1"), ("lift = 0.03", "lift = nan"), ('"alternate"', '"hop"')):
        text = text.replace(good, bad)
    faults = faults_of(lambda: parse_gait(text, "mine.toml"))
    assert set(faults) == {("[gait]", "Tc"), ("[gait]", "lift"), ("[gait]", "footholds")}


@pytest.mark.parametrize("value", [float("nan"), float("inf"), "1e999", True, None, [1.0], "fast", "", "1,5"])
def test_a_number_that_is_none_is_refused(value):
    assert ("[gait]", "Tc") in faults_of(lambda: load_gait("walk").replace(Tc=value))


@pytest.mark.parametrize(
    "code", ["__import__('os').getcwd()", "().__class__", "lambda: 1", "Tc.real", "1 if 1 else 2"]
)
def test_code_in_a_number_is_refused_and_not_run(code):
    assert (
        "is not arithmetic" in faults_of(lambda: load_gait("walk").replace(stride=code))["[gait]", "stride"]
    )


@pytest.mark.parametrize(
    ("key", "value"), [("Tc", 0), ("lift", -0.01), ("rate", 0), ("ramp", -1), ("hand_drop", 0)]
)
def test_a_number_out_of_its_range_is_refused(key, value):
    assert faults_of(lambda: load_gait("walk").replace(**{key: value})).keys() == {("[gait]", key)}


def test_an_unknown_choice_lists_the_valid_ones():
    assert (
        "minimum-jerk, cubic"
        in faults_of(lambda: load_gait("walk").replace(swing="quintic"))["[gait]", "swing"]
    )


def test_a_parameter_that_refers_to_itself_is_refused():
    faults = faults_of(lambda: load_gait("walk").replace(liftoff="0.5*landing", landing="liftoff + 0.5"))
    assert any("refers to itself" in told for told in faults.values())


def test_a_period_below_the_key_point_offsets_tells_the_smallest_one():
    """0.08 s after liftoff at .1 must come before .5 and 0.08 s before .89 after it: Tc > .08/.39 s."""
    faults = faults_of(lambda: load_gait("paper").replace(Tc=0.2))
    assert "Raise Tc to at least 0.206 s" in faults["[channel.foot_height]", "at"]
    assert load_gait("paper").replace(Tc=0.206).Tc == 0.206
    with pytest.raises(GaitError):
        load_gait("paper").replace(Tc=0.205)


def test_the_offsets_of_the_default_walk_follow_any_period():
    for Tc in (0.05, 100.0):
        assert load_gait("walk").replace(Tc=Tc).Tc == Tc


@pytest.mark.parametrize(
    ("key", "value", "place"),
    [
        ("channel.waist_side.at.1", 0.6, ("[channel.waist_side]", "at")),
        ("channel.waist_side.at.4", 1.5, ("[channel.waist_side]", "at")),
        ("channel.waist_side.value.4", 0.01, ("[channel.waist_side]", "value")),
        ("channel.waist_side.value.4", "sway_outer", ("[channel.waist_side]", "value.4")),
        ("channel.waist_side.value", [0, 1], ("[channel.waist_side]", "at")),
        ("channel.waist_progress.value.4", 2, ("[channel.waist_progress]", "value")),
        ("channel.hand_raise.value.0", 0.1, ("[channel.hand_raise]", "value")),
        ("channel.hand_forward.value.4", "-hand_swing", ("[channel.hand_forward]", "value")),
        ("channel.foot_progress.value.2", 0.9, ("[channel.foot_progress]", "value.2")),
        ("channel.foot_height.value.0", 0.01, ("[channel.foot_height]", "value.0")),
        ("channel.foot_height.at.0", -0.1, ("[channel.foot_height]", "at")),
        ("channel.foot_progress.at.0", 0.05, ("[channel.foot_progress]", "at")),
    ],
)
def test_key_points_that_cannot_be_a_gait_are_refused(key, value, place):
    assert place in faults_of(lambda: load_gait("walk").replace(**{key: value}))


def test_a_missing_channel_is_asked_for_unless_the_waist_is_free():
    document = load_gait("walk").to_dict()
    del document["channel"]["waist_side"]
    assert "missing" in faults_of(lambda: gait_from_dict(document))["[channel.waist_side]", ""]
    document["waist"] = {"side": [0.04, 0.0]}
    assert gait_from_dict(document).waist == {"side": (0.04, 0.0)}


def test_coefficients_of_a_free_waist_are_checked():
    document = load_gait("walk").to_dict()
    document["waist"] = {"forward": [0.1], "side": [float("nan"), 0.0], "up": [1.0], "span": -1}
    keys = {key for row, key in faults_of(lambda: gait_from_dict(document)) if row == "[waist]"}
    assert keys == {"forward", "side.0", "up", "span"}


@pytest.mark.parametrize("text", ["[gait", "gait = 3", "", "channel = 1", "[gait]\nTc = 2020-01-01"])
def test_what_is_no_gait_file_is_refused_with_a_message(text):
    with pytest.raises(GaitError, match=r"mine\.toml: "):
        parse_gait(text, "mine.toml")


def test_a_folder_or_binary_file_is_refused_with_a_message(tmp_path):
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    for path in (tmp_path, binary):
        with pytest.raises(GaitError):
            load_gait(path)
