"""The audit of a robot: every damage is named with place, level and advice; sound robots have no errors."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.algebra.se3 import Vector
from screwkin.analysis.audit import added_by_pybullet, audit
from screwkin.cli import run
from screwkin.model.robot import Inertia, Robot

NAMES = [name for name in sk.robot_names() if "/" not in name]


@pytest.fixture(scope="module")
def robot() -> Robot:
    return sk.load_robot("bioloid")


def with_link(robot: Robot, name: str, **changes) -> Robot:
    links = tuple(replace(link, **changes) if link.name == name else link for link in robot.links)
    return replace(robot, links=links)


def with_joint(robot: Robot, name: str, **changes) -> Robot:
    joints = tuple(replace(joint, **changes) if joint.name == name else joint for joint in robot.joints)
    return replace(robot, joints=joints)


def remarks_at(robot: Robot, place: str) -> str:
    return " ".join(str(remark) for remark in audit(robot) if remark.place == place)


@pytest.mark.parametrize("name", [*NAMES, "linkages/four-bar", "linkages/stewart"])
def test_bundled_robots_have_no_errors_and_no_warnings(name):
    assert [str(remark) for remark in audit(sk.load_robot(name)) if remark.level != "info"] == []


def test_a_com_or_an_inertia_in_millimetres_is_seen(robot):
    thigh = robot.link("right_thigh")
    far = with_link(robot, "right_thigh", com=thigh.com * 1000)
    assert "CoM lies" in remarks_at(far, "link right_thigh")
    i = thigh.inertia
    large = with_link(robot, "right_thigh", inertia=Inertia(i.xx * 1e6, i.yy * 1e6, i.zz * 1e6))
    assert "warning" in remarks_at(large, "link right_thigh")
    assert "radius of gyration" in remarks_at(large, "link right_thigh")


def test_impossible_and_absent_inertias_are_warnings(robot):
    broken = with_link(robot, "torso", inertia=Inertia(1e-3, 1e-3, 3e-3))
    assert "triangle inequality" in remarks_at(broken, "link torso")
    none = with_link(robot, "torso", inertia=Inertia(0, 0, 0))
    assert "no moment of inertia" in remarks_at(none, "link torso")


def test_a_robot_without_mass_is_an_error(robot):
    weightless = replace(
        robot, links=tuple(replace(link, mass=0.0, inertia=Inertia(0, 0, 0)) for link in robot.links)
    )
    assert audit(weightless)[0].level == "error"
    assert audit(weightless)[0].place == "masses"


def test_a_joint_without_range_is_named(robot):
    at = robot.posture("home").q[robot.joint_names.index("right_elbow")]
    stiff = replace(
        with_joint(replace(robot, postures=(robot.posture("home"),)), "right_elbow", lower=at, upper=at)
    )
    assert "no range" in remarks_at(stiff, "joint right_elbow")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"lower": -float("inf"), "upper": float("inf")}, "no limits"),
        ({"velocity": 500.0}, "speed is 500"),
        ({"effort": 1e6}, "effort is 1e+06"),
        ({"effort": float("inf")}, "no effort is given"),
    ],
)
def test_doubtful_limits_are_named(robot, changes, said):
    assert said in remarks_at(with_joint(robot, "right_elbow", **changes), "joint right_elbow")


def test_left_and_right_that_differ_are_named(robot):
    heavier = with_link(robot, "left_calf", mass=2 * robot.link("left_calf").mass)
    assert any("left_calf" in remark.place and "mass" in remark.what for remark in audit(heavier))
    weaker = with_joint(robot, "left_knee", effort=0.5)
    assert any("left_knee" in remark.place and "effort" in remark.what for remark in audit(weaker))


def test_a_missing_sole_is_an_error_and_a_stand_on_unequal_heights_a_warning(robot):
    bare = replace(robot, soles=robot.soles[:1])
    assert any(remark.level == "error" and remark.what == "missing" for remark in audit(bare))
    home = robot.posture("home")
    q = list(home.q)
    q[robot.joint_names.index("left_knee")] += 0.3
    crooked = replace(robot, postures=(replace(home, q=tuple(q)),))
    assert "leans by" in remarks_at(crooked, f"sole {robot.limb('left_foot').name}")
    assert "heights at home differ" in remarks_at(crooked, "soles")


def test_the_mass_that_pybullet_adds_is_said_in_kilograms():
    assert "40.53 -> 66.53 kg" in added_by_pybullet(26, 40.53).what
    assert added_by_pybullet(0, 1.0) is None


def test_the_verb_prints_remarks_and_leaves_with_3_for_an_error(tmp_path, capsys, robot):
    assert run(["check", "bioloid", "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["passed"]
    assert {"level", "place", "what", "advice"} == {*data["remarks"][0]}
    text = "\n".join(
        line for line in robot.text.splitlines() if not line.startswith(("mass =", "com =", "inertia ="))
    ).replace("[[link]]", "[[link]]\nmass = 0")
    path = tmp_path / "light.toml"
    path.write_text(text)
    assert run(["check", str(path)]) == 3
    assert "error: masses: no link has a mass" in capsys.readouterr().out


def test_what_is_printed_repeats_nothing_and_leaves_nothing_out(tmp_path, capsys):
    """A URDF without limbs, whose joints have no speed: many alike, those on limbs with one advice."""
    path = tmp_path / "robot.urdf"
    assert run(["convert", "poppy12", str(path)]) == 0
    path.with_suffix(".srdf").unlink()
    capsys.readouterr()
    assert run(["check", str(path), "--json"]) == 0
    remarks = json.loads(capsys.readouterr().out)["remarks"]
    assert run(["check", str(path)]) == 0
    *lines, count = capsys.readouterr().out.splitlines()
    text = " ".join(" ".join(lines).split())
    assert count.endswith(f"0 errors, 0 warnings, {len(remarks)} remarks")
    assert ".." not in text
    for remark in remarks:
        assert remark["place"] in text
        assert text.count(remark["what"]) == 1
        assert text.count(remark["advice"]) == 1


def test_servos_that_no_bus_can_play_to_are_warnings_and_missing_files_are_errors(robot):
    def on(**servos):
        return replace(robot, servos={**robot.servos, **servos})

    for changed, key in (({"baud": 777_777}, "baud"), ({"protocol": 2.0}, "protocol")):
        (remark,) = (remark for remark in audit(on(**changed)) if remark.place == f"[servos] {key}")
        assert remark.level == "warning"
        assert "send refuses" in remark.advice
    assert "error: [servos]: unknown servo model file 'mine.toml'" in remarks_at(
        on(model="mine.toml"), "[servos]"
    )
    simulated = replace(robot, servos={"model": "AX-12A"})
    assert [remark.level for remark in audit(simulated) if "servos" in remark.place] == ["info"]
    assert not [remark for remark in audit(replace(robot, servos={})) if "servos" in remark.place]


@pytest.mark.parametrize("off", [-0.05, -0.003, 0.003, 0.195])
@pytest.mark.parametrize("name", NAMES)
def test_a_home_whose_soles_leave_the_floor_is_a_warning_with_the_height_that_stands(name, off):
    robot = sk.load_robot(name)

    def raised(by):
        return replace(
            robot, postures=tuple(replace(p, base_height=p.base_height + by) for p in robot.postures)
        )

    said = remarks_at(raised(off), "posture home")
    assert f"{1e3 * abs(off):.3g} mm {'above' if off > 0 else 'below'} the floor" in said
    right = float(said.split("Write base_height = ")[1])
    assert right == pytest.approx(robot.posture("home").base_height, abs=2e-4)
    assert remarks_at(raised(off / 1000), "posture home") == ""


@pytest.mark.parametrize("factor", [1.2, 10.0])
@pytest.mark.parametrize(("key", "unit"), [("effort", "N m"), ("velocity", "rad/s")])
def test_joints_beyond_the_data_sheet_of_their_servo_are_warnings(robot, key, unit, factor):
    sheet = {"effort": 1.5, "velocity": 59 * 2 * math.pi / 60}[key]  # of the maker, at 12 V
    eager = with_joint(robot, "left_knee", **{key: factor * sheet})
    said = remarks_at(eager, "joint left_knee")
    assert (
        f"warning: joint left_knee: its {key} is {factor * sheet:.4g} {unit}, its AX-12A has {sheet:.3g}"
        in said
    )
    at_14 = replace(eager, servos={**eager.servos, "voltage": 12.0 * factor})
    assert "AX-12A" not in remarks_at(at_14, "joint left_knee")
    assert "AX-12A" not in remarks_at(replace(eager, servos={}), "joint left_knee")


@pytest.mark.parametrize("degrees", [13, 45, 130, 180, 360])
def test_limits_in_degrees_are_warnings_and_those_of_a_joint_that_turns_twice_are_not(robot, degrees):
    forgotten = with_joint(robot, "left_hip_yaw", lower=-float(degrees), upper=float(degrees))
    assert "warning: joint left_hip_yaw: its limits are" in remarks_at(forgotten, "joint left_hip_yaw")
    for limit in (math.radians(degrees), 2 * math.pi):
        meant = with_joint(robot, "left_hip_yaw", lower=-limit, upper=limit)
        assert "warning" not in remarks_at(meant, "joint left_hip_yaw")


@pytest.mark.parametrize("seed", range(5))
def test_a_bracket_whose_axes_cross_has_no_size_to_compare_its_inertia_with(robot, seed):
    """Two servos back to back: the axes meet, the CoM lies beside them, and no shape says how large it is."""
    rng = np.random.default_rng(seed)
    name, size = "right_hip_roll_link", rng.uniform(0.01, 0.05)
    link = robot.link(name)
    axes = [joint for joint in robot.joints if name in (joint.parent, joint.child)]
    point = axes[0].screw.s0
    for joint, s in zip(axes, ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), strict=False):
        screw = replace(joint.screw, s=Vector(*s), s0=point)
        robot = with_joint(robot, joint.name, screw=screw)
    com = point + Vector(*rng.uniform(-0.02, 0.02, 3).tolist())
    moment = float(link.mass) * size**2
    bare = {"boxes": (), "shapes": (), "com": com}
    bracket = with_link(robot, name, inertia=Inertia(moment, moment, moment), **bare)
    assert "gyration" not in remarks_at(bracket, f"link {name}")
    assert "outside" not in remarks_at(bracket, f"link {name}")
