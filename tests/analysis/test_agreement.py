"""Several verdicts become one, the worst of them; a verdict that a finer solver turns is none."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import screwkin as sk
from screwkin.analysis.agreement import agreed, settled
from screwkin.analysis.engines import Refinement, SimulatedCompliance, engines_for, opened
from screwkin.analysis.validate import Validation, judged, validate
from screwkin.analysis.verdict import Criteria
from screwkin.errors import InputError, MissingDependencyError
from screwkin.sim.compliant import Compliance
from screwkin.sim.kinematic import KinematicBackend
from screwkin.sim.run import simulate


@pytest.fixture(scope="module")
def robot() -> sk.Robot:
    return sk.load_robot("bioloid")


@pytest.fixture(scope="module")
def walk(robot: sk.Robot) -> sk.Trajectory:
    return sk.walk(robot, sk.load_gait("walk").replace(Tc=1.0), steps=1)


@pytest.fixture(scope="module")
def perfect(robot: sk.Robot, walk: sk.Trajectory) -> Validation:
    """A verdict that passes, in the name of an engine with forces."""
    run = simulate(robot, walk, KinematicBackend(robot, dt=0.01))
    pressed = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 16.0], (len(run.time), 1))
    return judged(robot, walk, replace(run, engine="pybullet", ground_wrench=pressed), Criteria())


def named(check: Validation, engine: str, **changes: Any) -> Validation:
    return replace(
        check, engine=engine, engine_settings={engine: {"dt": 1.0}}, engines={engine: {}}, **changes
    )


def test_numbers_of_two_engines_are_the_worst_and_both_must_pass(perfect: Validation) -> None:
    one = named(perfect, "pybullet", end_error_mm=1.0, min_base_height=0.15, zmp_rms_xy_mm=(0.1, 0.4))
    other = named(
        perfect,
        "mujoco",
        passed=False,
        reasons=("a stance foot slips",),
        end_error_mm=3.0,
        distance=0.4,
        min_base_height=0.14,
        fell=True,
        fell_at=1.5,
        zmp_rms_xy_mm=(0.2, 0.3),
        torque_use=dict.fromkeys(perfect.torque_use, 0.9),
    )
    for both in (agreed([one, other]), agreed([other, one])):
        assert not both.passed
        assert both.reasons == ("mujoco: a stance foot slips",)
        assert (both.end_error_mm, both.min_base_height, both.fell, both.fell_at) == (3.0, 0.14, True, 1.5)
        assert both.distance == 0.4
        assert both.zmp_rms_xy_mm == (0.2, 0.4)
        assert set(both.torque_use.values()) == {0.9}
        assert set(both.engines) == set(both.engine_settings) == {"pybullet", "mujoco"}
        assert both.trajectory_sha256 == perfect.trajectory_sha256
    assert agreed([one, other]).engine == "pybullet+mujoco"
    assert agreed([one, named(perfect, "mujoco")]).passed


def test_what_one_engine_could_not_measure_is_not_known(perfect: Validation) -> None:
    one = named(perfect, "pybullet", zmp_rms_mm=0.2)
    assert agreed([one, named(perfect, "mujoco", zmp_rms_mm=None)]).zmp_rms_mm is None


def failed(check: Validation) -> tuple[str, ...]:
    return ("too far",) if check.end_error_mm > 10.0 else ()


@pytest.mark.parametrize(
    ("usual", "finer", "undecided"),
    [
        (2.0, (2.1, 1.9), False),
        (9.5, (9.6, 9.5), False),
        (9.0, (7.0, 9.0), True),  # 9 + 2 would fail
        (9.0, (11.0, 9.0), True),  # one fails
        (30.0, (31.0, 29.0), False),
        (11.0, (12.5, 11.0), True),  # 11 - 1.5 would pass
    ],
)
def test_a_verdict_within_its_own_scatter_is_undecided_and_has_not_passed(
    perfect: Validation, usual: float, finer: tuple[float, float], undecided: bool
) -> None:
    def judge(error: float) -> Validation:
        check = named(perfect, "mujoco", end_error_mm=error)
        return replace(check, passed=not failed(check), reasons=failed(check))

    ways = dict(zip(("half the step", "twice the iterations"), map(judge, finer), strict=True))
    found = settled(judge(usual), ways, failed)
    assert found.undecided is undecided
    assert found.passed is (usual <= 10.0 and not undecided)
    assert found.solver is not None
    assert found.solver["mujoco"]["spread"]["end_error_mm"] == [min(usual, *finer), max(usual, *finer)]
    if undecided:
        assert "undecided" in found.reasons[0]


def test_auto_is_every_installed_engine_that_can_simulate_what_is_asked(
    robot: sk.Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    none, soles = SimulatedCompliance(), SimulatedCompliance(sole_stiffness=2e4)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: name)
    assert engines_for("auto", robot, none) == ("pybullet", "mujoco")
    assert engines_for("auto", robot, soles) == ("pybullet",)
    assert engines_for("auto", sk.load_robot("linkages/four-bar"), none) == ("pybullet", "mujoco")
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == "pybullet" else name)
    assert engines_for("auto", robot, none) == ("mujoco",)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert engines_for("auto", robot, none) == ("mujoco",)
    assert engines_for("pybullet", robot, none) == ("pybullet",)


def test_auto_without_any_engine_says_what_to_install(
    robot: sk.Robot, walk: sk.Trajectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("pybullet", "mujoco"):
        monkeypatch.setitem(__import__("sys").modules, name, None)
    with pytest.raises(MissingDependencyError, match="pip install mujoco"):
        validate(robot, walk, servo="rigid")


def test_elastic_soles_are_refused_where_they_cannot_be_simulated(robot: sk.Robot) -> None:
    with pytest.raises(InputError, match="engine mujoco has no elastic soles; use pybullet"):
        opened(robot, "mujoco", SimulatedCompliance(sole_stiffness=2e4))


@pytest.mark.parametrize("engine", ["pybullet", "mujoco"])
def test_a_finer_solver_takes_parts_of_the_step_and_more_iterations(robot: sk.Robot, engine: Any) -> None:
    pytest.importorskip(engine)
    springs = SimulatedCompliance(Compliance(100.0))
    for compliance in (SimulatedCompliance(), springs):
        usual, finer = (opened(robot, engine, compliance, finer=f) for f in (None, Refinement(2, 2)))
        assert finer.dt == usual.dt / 2
        assert finer.settings["iterations"] == 2 * usual.settings["iterations"]
        usual.close()
        finer.close()


def test_a_walk_passes_at_every_setting_of_the_solver(robot: sk.Robot, walk: sk.Trajectory) -> None:
    pytest.importorskip("mujoco")
    shares: list[float] = []
    check = validate(robot, walk, "mujoco", servo="rigid", check_solver=True, progress=shares.append)
    assert check.passed
    assert not check.undecided
    assert check.solver is not None
    low, high = check.solver["mujoco"]["spread"]["zmp_rms_mm"]
    assert 0.0 < low <= high < 1.0
    assert len(check.solver["mujoco"]["passed"]) == 3
    assert np.all(np.diff(shares) > 0)
    assert shares[-1] <= 1.0


def test_self_collisions_that_one_engine_did_not_look_for_are_unknown(perfect: Validation) -> None:
    one, other = named(perfect, "pybullet"), named(perfect, "mujoco")
    assert agreed([one, other]).self_collisions == ()
    assert agreed([one, replace(other, self_collisions=None)]).self_collisions is None
    assert agreed([replace(one, self_collisions=None), other]).self_collisions is None
