"""Screws against DH: equal motion, counted operations, and the jump of DH tables at parallel axes."""

from __future__ import annotations

import json
import math
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import UNTURNED, Pose, Vector, as_array
from screwkin.analysis.chains import by_dh, by_library, by_screws, chains_of, reversed_table, support_models
from screwkin.analysis.compare import compare_models, largest_differences, random_positions
from screwkin.analysis.misalignment import misalignment, sensitivity
from screwkin.analysis.operations import _count, operations
from screwkin.errors import InputError
from screwkin.model.dh import DHRow, DHTable
from screwkin.model.dh_derive import dh_from_screws
from screwkin.model.library import data_folder, robot_names
from screwkin.model.robot import Robot
from screwkin.model.table import load_robot, parse_robot
from tests.model.chains import fk_by_matrices, random_chain


def with_table(folder: Path, change: tuple[str, str]) -> Robot:
    """The twelve-joint biped in a folder of its own, with a changed DH table beside it."""
    for name in ("poppy12.toml", "dh/poppy12.csv"):
        (folder / name).parent.mkdir(exist_ok=True)
        text = (data_folder("robots") / name).read_text(encoding="utf-8")
        (folder / name).write_text(text.replace(*change) if name.endswith(".csv") else text, encoding="utf-8")
    return load_robot(folder / "poppy12.toml")


@pytest.mark.parametrize(
    ("name", "jacobians", "dh", "screws"),
    [("bioloid", 5, 4 * 18 + 24, 6 * 18 + 24), ("poppy12", 3, 4 * 12 + 12, 6 * 12 + 12)],
)
def test_the_models_agree_and_their_numbers_are_counted(name, jacobians, dh, screws):
    found = compare_models(load_robot(name), samples=1000, rounds=3)
    assert found.fk_max_abs < 1e-12
    assert found.jacobian_max_abs < 1e-12
    assert (found.dh_models, found.screw_models) == (2, 1)
    assert (found.dh_jacobians, found.screw_jacobians) == (jacobians, 1)
    assert (found.parameters["dh"], found.parameters["dh_per_model"]) == (2 * dh, dh)
    assert found.parameters["screw"] == screws
    assert set(found.seconds) == {"dh", "screw", "library"}
    assert found.speed_ratio == found.seconds["dh"] / found.seconds["screw"]
    assert found.speed_ratio_library == found.seconds["dh"] / found.seconds["library"]
    assert all(5 < condition < 50 for condition in found.jacobian_condition.values())
    data = found.to_dict()
    promised = (
        "fk_max_abs jacobian_max_abs dh_models screw_models dh_jacobians parameters operations speed_ratio "
        "speed_ratio_by_steps speed_ratio_library"
    )
    assert set(promised.split()) <= set(data)
    assert data["operations"]["screw_by_steps"] == data["operations"]["library"]
    assert [table["printed"] for table in data["tables"].values()] == [name == "poppy12"] * len(found.chains)


@pytest.mark.parametrize("name", robot_names())
def test_every_bundled_robot_has_chains_that_agree(name):
    robot = load_robot(name)
    rng = np.random.default_rng(1)
    q = random_positions(robot, 200, rng)
    for chain in chains_of(robot):
        values = [q[:, i] for i in chain.joints]
        tip, columns = by_screws(chain.screws, chain.frame, values)
        np.testing.assert_allclose(
            fk_by_matrices(chain.table, q[:, list(chain.joints)]), as_array(tip), atol=1e-13
        )
        others = by_dh(chain.table, values)[1]
        for a, b in zip(columns, others, strict=True):
            np.testing.assert_allclose(as_array(a, (200,)), as_array(b, (200,)), rtol=0, atol=1e-13)


def test_mechanisms_without_limbs_are_compared_up_to_their_outermost_links():
    assert [chain.name for chain in chains_of(load_robot("linkages/four-bar"))] == ["eye", "rocker"]
    found = compare_models(load_robot("linkages/slider-crank"), samples=10, rounds=1)
    assert (found.dh_models, found.dh_jacobians) == (1, 2)
    assert math.isfinite(found.speed_ratio)


def test_a_wrong_number_in_a_printed_table_is_seen(tmp_path):
    robot = with_table(tmp_path, ("left_knee,revolute,0,181", "left_knee,revolute,0,182"))
    chains = chains_of(robot)
    q = random_positions(robot, 100, np.random.default_rng(4))
    fk, jacobian = largest_differences(chains, support_models(robot, chains), q)
    assert fk > 5e-4
    assert jacobian > 5e-4


def test_a_printed_table_must_name_the_robots_joints(tmp_path):
    robot = with_table(tmp_path, ("left_knee", "left_elbow"))
    with pytest.raises(
        InputError, match=r"poppy12.csv: chain 'left_leg' has the joints .*left_elbow.* but the"
    ):
        chains_of(robot)


@pytest.mark.parametrize("name", ["bioloid", "poppy12"])
def test_a_table_that_runs_up_the_standing_leg_undoes_the_leg(name):
    """Each supporting foot needs such a table of its own; behind it stand those of the other limbs."""
    robot = load_robot(name)
    chains = {chain.name: chain for chain in chains_of(robot)}
    models = support_models(robot, list(chains.values()))
    assert set(models) == {"left_leg", "right_leg"}
    q = np.random.default_rng(2).uniform(-3, 3, (100, len(robot.joints)))
    for leg, tables in models.items():
        chain, positions = chains[leg], q[:, list(chains[leg].joints)]
        assert [table.name for table in tables[1:]] == [other for other in chains if other != leg]
        up, down = fk_by_matrices(tables[0], positions[:, ::-1]), fk_by_matrices(chain.table, positions)
        np.testing.assert_allclose(up @ down, np.broadcast_to(np.eye(4), up.shape), rtol=0, atol=1e-14)
        assert reversed_table(chain).joint_names == chain.table.joint_names[::-1]


def test_the_librarys_chain_is_the_same_motion_and_jacobian():
    rng = np.random.default_rng(3)
    for _ in range(100):
        screws, tool, _ = random_chain(rng, 6)
        q = list(rng.uniform(-3, 3, (6, 5)))
        for one, other in zip(by_screws(screws, tool, q), by_library(screws, tool, q), strict=True):
            np.testing.assert_allclose(as_array(one, (5,)), as_array(other, (5,)), rtol=0, atol=1e-13)


def test_operations_are_counted_as_one_counts_by_hand():
    """A link of length 0.3 on a joint: cos, sin, 0.3 cos, 0.3 sin, no change of sign; constant Jacobian."""
    arm = DHTable("standard", (DHRow("q", 0.0, 0.3, 0.0, 0.0),))
    assert _count(partial(by_dh, arm), 1) == {"fk": 4, "jacobian": 0, "both": 4}


@pytest.mark.parametrize("name", robot_names())
def test_the_librarys_chain_needs_no_more_operations_than_dh(name):
    counts = operations(chains_of(load_robot(name)))
    for part in ("fk", "jacobian", "both"):
        assert counts["library"][part] <= counts["dh"][part]
    assert counts["library"]["both"] < counts["screw_best_reference"]["both"] < counts["screw"]["both"]


def test_parallel_skew_axes_cost_about_as_much_as_a_dh_table_of_them():
    """Hip, knee and ankle that lean by 30 degrees: all but the first turn about an axis of the same frame."""
    s = Vector(0, math.cos(math.pi / 6), math.sin(math.pi / 6))
    screws, tip = [Screw(s, Vector(0, 0.05, -0.2 * k)) for k in range(3)], Pose(UNTURNED, Vector(0, 0, -0.5))
    library = _count(partial(by_library, screws, tip), 3)
    dh = _count(partial(by_dh, dh_from_screws(screws, tip)), 3)
    assert all(count <= dh[part] + 2 for part, count in library.items())


def test_the_parameters_of_nearly_parallel_axes_explode_while_screws_follow_the_axis():
    series = misalignment(chains_of(load_robot("poppy12")))
    assert series is not None
    assert series.joints == ("left_hip_pitch", "left_knee")
    # A line at distance a that leans by t / sqrt(2) towards another and by as much across comes nearest to it
    # a / (sqrt(2) t) away; the knee does so to the hip on one side and to the ankle on the other.
    expected = (0.181 + 0.178) / math.sqrt(2) / series.tilt
    np.testing.assert_allclose(series.dh_length, expected, rtol=2e-3)
    assert (series.dh_angle > 0.7).all()
    np.testing.assert_allclose(series.screw_change, series.tilt / math.sqrt(2), rtol=2e-2)
    assert (np.diff(series.parallel_error) < 0).all()
    last = series.tilt <= 1e-5
    assert (series.dh_error[last] > 1e3 * np.finfo(float).eps).all()
    near = np.argmin(np.abs(np.log(series.dh_error / series.parallel_error)))
    assert 1e-9 <= series.tilt[near] <= 1e-7  # where the two errors are equal, tables change over


def test_a_chain_without_parallel_axes_has_no_series_and_a_tame_table():
    skew, legs = chains_of(load_robot("linkages/bennett")), chains_of(load_robot("poppy12"))
    assert misalignment(skew) is None
    assert sensitivity(skew, 0.1)["dh"] < 100
    assert sensitivity(legs, 0.4)["dh"] > 1e9
    for chains in (skew, legs):
        assert 0.9 < sensitivity(chains, 0.4)["screw"] <= 1 + 1e-6


def test_what_cannot_be_compared_is_refused():
    alone = (
        '[robot]\nname = "stone"\nbase = "fixed"\nbase_link = "stone"\n[[link]]\nname = "stone"\nmass = 0\n'
    )
    with pytest.raises(InputError, match="robot stone has no joints"):
        compare_models(parse_robot(alone))
    bolt = (
        alone
        + '[[link]]\nname = "nut"\nmass = 0\n[[joint]]\nname = "thread"\nparent = "stone"\nchild = "nut"\n'
    )
    bolt += 'type = "helical"\npitch = 0.01\ns = [0, 0, 1]\ns0 = [0, 0, 0]\n'
    with pytest.raises(InputError, match="joint 'thread' is helical"):
        compare_models(parse_robot(bolt))
    with pytest.raises(InputError, match="samples 0"):
        compare_models(load_robot("poppy12"), samples=0)


def test_the_whole_comparison_is_json_data():
    from screwkin.cli.output import plain

    data = compare_models(load_robot("linkages/slider-crank"), samples=10, rounds=1).to_dict()
    assert json.loads(json.dumps(plain(data), allow_nan=False))["misalignment"]["joints"] == [
        "crank",
        "crank_pin",
    ]
