"""The compliance experiment: sums done right on made-up trials, and real walks on springs."""

from __future__ import annotations

import pytest

import screwkin as sk
from screwkin.analysis.compliance import Conditions, Trial, compliance_study, summarised
from screwkin.errors import InputError
from screwkin.gait.compensation import compensate_walk
from screwkin.sim.pybullet import Physics, PyBulletBackend
from screwkin.sim.run import Schedule, simulate


@pytest.fixture(scope="module")
def robot() -> sk.Robot:
    return sk.load_robot("poppy12")


@pytest.fixture(scope="module")
def gait() -> sk.Gait:
    return sk.load_gait("paper-poppy12")


def test_medians_ranges_and_cuts_leave_fallen_runs_out() -> None:
    trials = [
        Trial("none", 0.8, 5e-4, None, (60.0, 80.0)),
        Trial("none", 1.0, 5e-4, 3.5, (500.0, 900.0)),
        Trial("none", 0.8, 4e-4, None, (70.0, 100.0)),
        Trial("swing", 0.8, 5e-4, None, (26.0, 45.0)),
        Trial("swing", 1.0, 5e-4, None, (13.0, 9.0)),
        Trial("swing", 0.8, 4e-4, None, (20.0, 10.0)),
    ]
    none, swing = summarised(trials)
    assert (none.treatment, none.runs, none.fallen) == ("none", 3, 1)
    assert none.median_mm == (65.0, 90.0)
    assert none.range_mm == ((60.0, 70.0), (80.0, 100.0))
    assert none.cut == (0.0, 0.0)
    assert (swing.runs, swing.fallen) == (3, 0)
    assert swing.median_mm == (20.0, 10.0)
    assert swing.cut == pytest.approx((1 - 20 / 65, 1 - 10 / 90))
    assert swing.trials == tuple(trials[3:])


def test_where_all_runs_fell_there_is_no_median_and_nothing_to_compare_with() -> None:
    trials = [Trial("none", 1.0, 5e-4, 2.0, (90.0, 90.0)), Trial("joint", 1.0, 5e-4, None, (9.0, 9.0))]
    none, joint = summarised(trials)
    assert (none.fallen, none.median_mm, none.range_mm, none.cut) == (1, None, None, None)
    assert joint.median_mm == (9.0, 9.0)
    assert joint.cut is None


def test_a_short_walk_on_springs_is_truer_with_compensation(robot: sk.Robot, gait: sk.Gait) -> None:
    walked = sk.walk(robot, gait, steps=2)
    shares: list[float] = []
    one = Conditions(frictions=(1.0,), steps=(5e-4,), schedule=Schedule(settle=0.3, hold=0.1, aftermath=0.0))
    rows = compliance_study(robot, walked, 250.0, conditions=one, progress=shares.append)
    none, swing, joint, dynamic = rows
    assert [row.fallen for row in rows] == [0, 0, 0, 0]
    assert shares == [0.25, 0.5, 0.75, 1.0]
    assert max(none.median_mm) > 40.0
    assert max(swing.cut) > 0.4
    assert max(joint.median_mm) < 0.6 * max(none.median_mm)
    assert max(dynamic.median_mm) < 0.2 * max(none.median_mm)


def test_a_robot_too_soft_for_its_weight_is_told_to_have_fallen(robot: sk.Robot, gait: sk.Gait) -> None:
    walked = sk.walk(robot, gait, steps=1)
    one = Conditions(frictions=(1.0,), steps=(5e-4,))
    (row,) = compliance_study(robot, walked, 5.0, ("none",), one)
    assert (row.runs, row.fallen, row.median_mm) == (1, 1, None)
    assert row.trials[0].fell_at is not None


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"treatments": ("none", "magic")}, "unknown treatment 'magic'; valid: none, swing, joint, dynamic"),
        ({"treatments": ()}, "no treatment; valid"),
        ({"conditions": Conditions(frictions=())}, "no conditions; give at least one"),
        ({"stiffness": 0.0}, "stiffness is 0.0; it must be a positive number"),
        ({"passes": 0, "treatments": ("swing",)}, "passes is 0"),
    ],
)
def test_impossible_studies_are_refused(
    robot: sk.Robot, gait: sk.Gait, change: dict[str, object], message: str
) -> None:
    walked = sk.walk(robot, gait, steps=1)
    with pytest.raises(InputError, match=message):
        compliance_study(robot, walked, **{"stiffness": 100.0, **change})  # type: ignore[arg-type]


def test_a_walk_is_not_compensated_twice(robot: sk.Robot, gait: sk.Gait) -> None:
    walked = compensate_walk(robot, sk.walk(robot, gait, steps=1), 100.0)
    with pytest.raises(InputError, match="compensated already"):
        compliance_study(robot, walked, 100.0)


@pytest.mark.slow
def test_on_soft_joints_only_compensated_walks_stand_and_joint_commands_beat_the_foot_s_correction(
    robot: sk.Robot, gait: sk.Gait
) -> None:
    """Rigid soles, k = 100 N m/rad. Statics make the ankle hold a CoM that it does not stand under.

    The walk's own torques do not, and beat both.
    """
    none, swing, joint, dynamic = compliance_study(robot, sk.walk(robot, gait), 100.0)
    assert none.fallen == none.runs == 4
    assert [row.fallen for row in (swing, joint, dynamic)] == [0, 0, 0]
    for i in range(2):
        assert joint.median_mm[i] < 0.9 * swing.median_mm[i]
        assert dynamic.median_mm[i] < 0.3 * joint.median_mm[i]


@pytest.mark.slow
def test_where_the_uncompensated_walk_stands_compensation_halves_its_largest_zmp_error(
    robot: sk.Robot, gait: sk.Gait
) -> None:
    """Rigid soles, k = 250 N m/rad."""
    none, swing, joint, dynamic = compliance_study(robot, sk.walk(robot, gait), 250.0)
    assert [row.fallen for row in (none, swing, joint, dynamic)] == [0, 0, 0, 0]
    for row in (swing, joint, dynamic):
        assert min(row.cut) >= 0.5, row
    assert max(joint.median_mm) < 0.9 * max(swing.median_mm)
    assert max(dynamic.median_mm) < 0.5 * max(joint.median_mm)


@pytest.mark.slow
def test_on_elastic_soles_the_walk_s_own_torques_beat_both_static_remedies(
    robot: sk.Robot, gait: sk.Gait
) -> None:
    soles = Conditions(steps=(5e-4,), sole_stiffness=2e4)
    treatments = ("swing", "joint", "dynamic")
    rows = compliance_study(robot, sk.walk(robot, gait), 100.0, treatments, soles)
    assert [row.fallen for row in rows] == [0, 0, 0]
    for i in range(2):
        assert rows[2].median_mm[i] < 0.8 * min(row.median_mm[i] for row in rows[:2])


@pytest.mark.slow
def test_the_naive_plan_falls_on_elastic_soles_and_the_true_one_stands(robot: sk.Robot) -> None:
    gait = sk.load_gait("paper-poppy12")
    fell = {}
    for com in ("waist", "true"):
        backend = PyBulletBackend(robot, Physics(sole_stiffness=2e4))
        fell[com] = simulate(robot, sk.walk(robot, gait.replace(com=com)), backend).fallen_at
        backend.close()
    assert fell["true"] is None
    assert fell["waist"] is not None
    assert 2.0 < fell["waist"] < 6.0
