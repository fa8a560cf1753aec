"""Chains as data: rows of a file are the records of Python, and imposed ones lead the mechanism."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import screwkin as sk
from screwkin.errors import SingularError, TableError, UnknownNameError
from screwkin.mechanism.chain_files import load_chains
from screwkin.mechanism.choice import mechanism_imposing

DOCS = Path(__file__).parents[2] / "docs" / "conventions.md"
ALONG = np.array([np.cos(np.pi / 6), 0, np.sin(np.pi / 6)])


@pytest.fixture
def line(tmp_path):
    """The file of the page, written to a folder."""
    (text,) = re.findall(r"```toml\n(.*?)```", DOCS.read_text(encoding="utf-8"), re.DOTALL)
    path = tmp_path / "line.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def robot():
    return sk.load_robot("bioloid")


def test_the_rows_of_a_file_are_the_records_of_python(line):
    T = np.eye(4)
    T[:3, 0], T[:3, 2], T[:3, 3] = ALONG, [-0.5, 0, np.sqrt(0.75)], [0, -0.065, 0]
    wanted = sk.VirtualChain("line", "3P3R", "right_hand", start_frame=T)
    (found,) = load_chains(line)
    assert (found.name, found.couplings, found.end, found.start) == (
        "line",
        wanted.couplings,
        "right_hand",
        "floor",
    )
    np.testing.assert_allclose(np.array(found.start_frame), T, atol=1e-15)
    assert found.end_frame is None
    line.write_text(
        '[[chain]]\nname = "turn"\ncouplings = ["rz", "px"]\nend = "torso"\nstart = "left_hand"\n'
    )
    assert load_chains(line) == (sk.VirtualChain("turn", ("rz", "px"), "torso", "left_hand"),)


def test_a_hand_led_along_a_line_moves_along_it_and_other_tips_rest(robot, line):
    chains = load_chains(line)
    names = ("line.px", "line.py", "line.pz")
    mechanism, home = mechanism_imposing(robot, names, chains), sk.home(robot)
    assert {*names} <= {*mechanism.primary}
    rates = sk.secondary_rates(mechanism, home, np.array([0.1 * (n == "line.px") for n in mechanism.primary]))
    every = dict(zip((*mechanism.primary, *mechanism.secondary), [*np.zeros(24), *rates], strict=True))
    np.testing.assert_allclose(
        [every[f"right_hand.{c}"] for c in ("px", "py", "pz")], 0.1 * ALONG, atol=1e-12
    )
    assert all(abs(every[name]) < 1e-12 for name in every if name.startswith("left_"))
    moved = np.array([every[name] for name in robot.joint_names])
    slide = sk.jacobian(robot, home, "right_hand")[3:, 6:] @ moved
    np.testing.assert_allclose(slide, 0.1 * ALONG, atol=1e-12)


def test_what_is_primary_anyway_changes_nothing_and_what_depends_is_refused(robot, line):
    chains = load_chains(line)
    same, default = (
        mechanism_imposing(robot, ("waist.px",), chains),
        sk.closed_mechanism(robot, chains=chains),
    )
    assert same.primary == default.primary
    every = ("line.px", "line.py", "line.pz", "right_hand.px", "right_elbow", "line.ry")
    with pytest.raises(SingularError, match=r"cannot all be imposed: .* follow"):
        mechanism_imposing(robot, every, chains)
    with pytest.raises(UnknownNameError, match=r"unknown coupling 'line.qx'"):
        mechanism_imposing(robot, ("line.qx",), chains)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no row stands there"),
        ("[chain]\nname = 1", "no row stands there"),
        ("[robot]\n[[chain]]", "robot.* is unknown"),
        ('[[chain]]\nname = "a"\ncouplings = "3P3R"', "end.*is missing"),
        ('[[chain]]\nname = "a"\ncouplings = "3P4R"\nend = "base"', "3P4R"),
        ('[[chain]]\nname = "a"\ncouplings = ["px", "px"]\nend = "base"', "couplings"),
        (
            '[[chain]]\nname = "a"\ncouplings = "3R"\nend = "base"\nstart_frame = { xyz = [0, 0] }',
            "start_frame.xyz",
        ),
        (
            '[[chain]]\nname = "a"\ncouplings = "3R"\nend = "base"\nstart_frame = { xy = [0, 0, 0] }',
            "xy: is unknown",
        ),
        ('[[chain]]\nname = "a"\ncouplings = "3R"\nend = "base"\n' * 2, "stands twice"),
        ("[[chain", "TOML"),
    ],
)
def test_faults_are_named_with_their_row(tmp_path, text, message):
    path = tmp_path / "chains.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(TableError, match=message):
        load_chains(path)
