"""Measures of papers against what a table or a walk made up says by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from screwkin.analysis.compliance import Trial
from screwkin.errors import InputError
from screwkin.papers import measures_leg, measures_springs
from screwkin.papers.bench import Bench
from screwkin.papers.measures_springs import landing
from screwkin.papers.measures_table import mass, range_share, size, tilt, torque_limit, zero_pose_distance
from screwkin.sim.measure import ZmpRecord, landings


@pytest.fixture(scope="module")
def bench() -> Bench:
    return Bench("poppy12", {"steps": 2})


def test_a_share_of_a_range_is_what_both_have_of_it(bench: Bench) -> None:
    assert range_share(bench, "left_knee", [-10, 155]) == pytest.approx((112 + 6) / 165)
    assert range_share(bench, "left_knee", [0, 100]) == pytest.approx(1.0)
    assert range_share(bench, "left_knee", [120, 130]) == 0.0


def test_differences_from_another_robot_have_its_size_taken_off(bench: Bench) -> None:
    assert mass(bench, "left_thigh", beside=0.239) == pytest.approx(-0.013)
    knee = ["left_hip_pitch", "left_knee"]
    assert zero_pose_distance(bench, knee, "z", beside=0.181) == pytest.approx(0.0, abs=1e-12)
    assert size(bench, "xy", "left_foot_link", [0.145, 0.05]) == pytest.approx([-0.016, 0.013])
    assert tilt(bench, knee) == pytest.approx(math.atan2(23, 181))
    assert torque_limit(bench, "left_knee") == 1.765


def test_the_swing_foots_correction_is_told_by_swings(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """A correction of 2 mm in the first swing of a foot, 5 mm in later ones, none while it stands."""
    walk = bench.account("paper-poppy12", None, {"steps": 7}).trajectory
    other = SimpleNamespace(robot=bench.robot, account=lambda gait: SimpleNamespace(trajectory=walk))
    foot = bench.robot.limb("left_leg").tip
    flying = ~walk.contact[:, walk.feet.index(foot)]
    begins = np.flatnonzero(flying & ~np.roll(flying, 1))
    planned = np.zeros((walk.samples, 3))
    moved = planned.copy()
    moved[flying, 2] = np.where(np.flatnonzero(flying) < begins[1], 0.002, 0.005)
    monkeypatch.setattr(measures_leg, "foot_from_waist", lambda *_: (planned, moved))

    def told(key: str) -> float | str:
        return measures_leg.swing_corrections(other, "", "left_leg", key, 60.0)  # type: ignore[arg-type]

    assert len(begins) > 1
    assert [told(key) for key in ("first", "others", "standing", "order")] == [0.002, 0.005, 0.0, "lower"]
    assert told("stride") == pytest.approx(0.5)
    moved[flying, 2] = 0.003
    assert told("order") == "not lower"


def test_the_most_changed_commands_are_named_from_the_waist_down(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    changes = np.array([0.3, 0.0, 0.1, 0.5, 0.4, 0.2])
    monkeypatch.setattr(measures_leg, "command_changes", lambda *_: changes)
    named = measures_leg.most_changed(bench, "", "left_leg", 3, 60.0)
    assert named == "left hip roll, left knee, left ankle pitch"


def test_landings_are_timed_against_the_plan(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    walk = bench.account("paper-poppy12").trajectory
    at = landings(walk)
    time = np.linspace(0, walk.duration, 400)
    wanted = np.zeros((400, 2))
    zmp = wanted.copy()
    worst = int(np.argmin(np.abs(time - at[1] + 0.03)))
    zmp[worst] = 0.02
    record = ZmpRecord(time, zmp, wanted, wanted)
    trial = Trial("none", 1.0, 5e-4, None, (20.0, 20.0), record, (0.02, 0.03, 0.04))
    monkeypatch.setattr(measures_springs, "trial_of", lambda *_: trial)
    assert landing(bench, "paper-poppy12", "none", "lead", 100.0) == pytest.approx(0.03)
    assert landing(bench, "paper-poppy12", "none", "order", 100.0) == "before"
    assert landing(bench, "paper-poppy12", "none", "peak", 100.0) == pytest.approx(time[worst] - at[1])
    monkeypatch.setattr(
        measures_springs, "trial_of", lambda *_: Trial("none", 1.0, 5e-4, 0.1, (1.0, 1.0), record)
    )
    with pytest.raises(InputError, match="no landings"):
        landing(bench, "paper-poppy12", "none", "lead", 100.0)
