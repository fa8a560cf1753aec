"""At every rate that ``send`` accepts, what virtual servos then did passes as a walk of its own.

Verdicts are on the table's servos: commands allow for them, and the virtual ones bend under the plan. Plays
are simulated at the lowest accepted rate, at the usual one and at those at which a bus has hardly time to
read; in MuJoCo, some minutes:

    python -m pytest -m slow tests/cases/test_rates.py
"""

from __future__ import annotations

from pathlib import Path

import pytest

import screwkin as sk
from screwkin.analysis.readiness import ready
from screwkin.cli import run
from screwkin.errors import SafetyError
from screwkin.gait.lengths import fitted
from screwkin.model.library import gait_names
from screwkin.servo.player import PlaySettings
from tests.verdicts import passing

GAITS = [name for name in gait_names() if "poppy" not in name and name != "auto"]
RATES = (*range(1, 51), 60, 80, 100, 150, 200, 250, 300)


@pytest.fixture(scope="module", params=GAITS)
def walked(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A walk slow enough for the servos."""
    folder: Path = tmp_path_factory.mktemp(request.param)
    robot = sk.load_robot("bioloid")
    gait = fitted(sk.load_gait(request.param), robot)
    walk = sk.walk(robot, gait.replace(Tc=max(gait.Tc, 1.5)))
    return passing(walk.save(folder / "trajectory.npz"), servo="table")


def is_accepted(path: Path, rate: int) -> bool:
    try:
        return ready(path, settings=PlaySettings(rate=rate)).deviation >= 0
    except SafetyError:
        return False


@pytest.mark.slow
def test_what_is_accepted_passes_when_it_was_played(
    walked: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    accepted = [rate for rate in RATES if is_accepted(walked, rate)]
    assert set(accepted) >= {rate for rate in RATES if rate >= 50}
    for rate in (*accepted[:2], 50, 100, 200, 300):
        out = tmp_path / str(rate)
        words = ["send", str(walked), "--rate", str(rate), "--virtual", "--go", "-o", str(out)]
        assert run(words) == 0, rate
        words = ["validate", str(walked), "--log", str(out / "play.npz"), "--no-plots", "--engine", "mujoco"]
        assert run(words) == 0, (rate, capsys.readouterr())
