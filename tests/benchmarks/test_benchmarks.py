"""The benchmarks run, and their contestants agree. Times are measured there, never judged here."""

from __future__ import annotations

import json
import platform
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import screwkin as sk
from benchmarks import __main__ as command
from benchmarks import agreement, cases, machine, ours, workloads
from benchmarks.alternatives.elimination import choose_pivots, solve
from benchmarks.alternatives.formulas import limb_works, unpacked
from benchmarks.alternatives.record import public
from benchmarks.cases import Case, Sizes
from benchmarks.contest import Contestant
from benchmarks.peers import pinocchio_python
from benchmarks.report import markdown, time_told
from benchmarks.run import run, run_case
from benchmarks.timing import Elapsed, interleaved
from screwkin.model.robot import Robot

TINY = Sizes((1, 5), 6, 12, (6,), 8, 4.0, 300, 4)
DEV = {"pinocchio-python", "mujoco"}
"""Peers that development installs anyway."""
PUBLIC = f"{ours.NAME}, public functions"


@pytest.fixture(scope="module")
def robot() -> Robot:
    return sk.load_robot("bioloid")


PEERS = {
    "W1": {"Pinocchio, Python", "MuJoCo, Python"},
    "W2": {"Pinocchio, Python"},
    "W3": set(),
    "W4": {"Pinocchio, Python", "MuJoCo, Python", "Pinocchio, rneaInParallel"},
    "W5": set(),
    "W6": set(),
}


@pytest.mark.parametrize(
    "workload",
    [pytest.param(name, marks=() if name in {"W1", "W5"} else pytest.mark.slow) for name in PEERS],
)
def test_all_contestants_agree_on_every_workload(robot: Robot, workload: str) -> None:
    """Slow where several long programs are compiled by the system's compiler and by XLA."""
    pytest.importorskip("pinocchio")
    pytest.importorskip("mujoco")
    found = run(robot, TINY, {workload}, DEV, say=lambda line: None)
    assert {case["workload"] for case in found["cases"]} == {workload}
    for case in found["cases"]:
        assert set(case["contestants"]) >= PEERS[workload]
        for row in case["contestants"].values():
            assert row["best_s"] <= row["median_s"]
            assert row.get("agreement", {}).get("solved", 1.0) > 0.5


def test_a_wrong_result_is_refused_before_anything_is_timed(robot: Robot) -> None:
    """A joint rate off by a millionth is found."""
    given = workloads.motion(robot, 1)
    honest = ours.rates(robot, given)
    calls = []

    def wrong() -> dict[str, np.ndarray]:
        calls.append(1)
        result = honest[PUBLIC].result(honest[PUBLIC].run())
        return {**result, "rates": result["rates"] * (1 + 1e-6)}

    liar = {"liar": Contestant(wrong)}
    case = Case("W1", "rates", 1, "sample", {"screwkin": lambda: honest, "liar": lambda: liar})
    with pytest.raises(AssertionError, match="W1, liar: differs by"):
        run_case(case)
    assert len(calls) == 1


def test_a_tip_beside_its_target_is_refused(robot: Robot) -> None:
    given = workloads.gait_reach(robot, 4)
    contestant = ours.reach(robot, given)[PUBLIC]
    result = dict(contestant.result(contestant.run()))
    assert agreement.reached(given)(result)["solved"] == 1.0
    result["q"] = result["q"] + 1e-3
    with pytest.raises(AssertionError, match="a tip is off by"):
        agreement.reached(given)(result)


def test_a_peer_that_is_not_installed_is_told_and_fails_nothing(robot: Robot) -> None:
    def lacking() -> dict[str, Contestant]:
        raise ImportError("no such library")

    given = workloads.motion(robot, 1)
    providers = {"screwkin": lambda: ours.rates(robot, given), "other": lacking, "third": dict}
    found = run_case(Case("W1", "rates", 1, "sample", providers, rounds=1))
    assert found["not_installed"] == ["other", "third"]
    told = markdown({"machine": machine.description(()), "robot": "x", "cases": [found]})
    assert "Not installed: other, third." in told


def test_slow_engines_get_the_first_samples_and_their_own_count(robot: Robot) -> None:
    given = workloads.random_reach(robot, 9)
    short = workloads.first(given, 4)
    np.testing.assert_array_equal(short.target, given.target[:4])
    np.testing.assert_array_equal(short.guess, given.guess)
    offered = cases.few(ours.reach, robot, given, 4)
    told = {(c.few, c.note.split("; ")[-1]) for c in offered.values()}
    assert told == {(4, "timed on the first 4")}


def test_contestants_take_turns_and_other_processes_tell_their_own_time() -> None:
    order: list[str] = []
    runs = {
        "a": lambda: order.append("a") or Elapsed(1.0, 2.0),
        "b": lambda: order.append("b") or Elapsed(3.0, 4.0),
    }
    found = interleaved(runs, 4)
    assert order == list("ab" + "ab" + "ba" + "ab" + "ba")  # once to see how long each takes
    assert (found["a"].median, found["a"].cpu, found["b"].best) == (1.0, 2.0, 3.0)
    assert len(found["a"].wall) == 4


def test_the_command_writes_json_and_markdown_without_names_of_the_machine(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in machine.THREADS:  # the command sets these for its process
        monkeypatch.setenv(name, "1")
    monkeypatch.setattr(cases, "QUICK", replace(TINY, rates=(1,)))
    assert command.main(["--quick", "--only", "W1", "--peers", "", "-o", str(tmp_path)]) == 0
    told = (tmp_path / "benchmarks.md").read_text()
    held = json.loads((tmp_path / "benchmarks.json").read_text())
    assert "screwkin, public functions" in told
    assert held["cases"][0]["workload"] == "W1"
    for text in (told, json.dumps(held)):
        assert str(Path.cwd()) not in text
        assert platform.node() not in text
    assert "W1" in capsys.readouterr().out


def test_times_are_told_in_units_that_suit() -> None:
    assert [time_told(ns) for ns in (53.2, 1234.0, 5.6e6, 7.89e9)] == [
        "53.2 ns",
        "1.23 µs",
        "5.6 ms",
        "7.89 s",
    ]


def test_unrolled_elimination_solves_the_rates_that_the_library_finds(robot: Robot) -> None:
    x, readable = public(robot, 6)
    wanted = readable()[:, -len(robot.joints) :]
    for work in limb_works(robot, *unpacked(robot, list(np.ascontiguousarray(x.T)))):
        rates = solve(work.A, work.b, choose_pivots(work.A, 6))
        np.testing.assert_allclose(np.stack(rates, axis=1), wanted[:, list(work.joints)], rtol=0, atol=1e-11)


def test_pinocchios_joints_may_be_scattered() -> None:
    assert pinocchio_python.as_slice([6, 7, 8]) == slice(6, 9)
    assert pinocchio_python.as_slice([6, 8, 7]) == [6, 8, 7]
