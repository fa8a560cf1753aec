"""``new``: from a URDF to a table with limbs, soles and home, or a refusal with the reason."""

from pathlib import Path

from screwkin.model.table import load_robot
from tests.anatomy.bodies import biped

DH = """convention,limb,joint,type,alpha_deg,a_mm,d_mm,offset_deg
modified,left_leg,left_hip,revolute,90,19,0,0
modified,left_leg,left_foot,fixed,90,31,0,90
"""


def test_a_urdf_becomes_a_table_with_limbs_soles_and_home(cli):
    Path("body.urdf").write_text(biped().text(), encoding="utf-8")
    called = cli("new", "body.urdf", "-o", "mine.toml", "--json")
    assert called.code == 0, called.err
    data = called.data
    assert {"limbs", "soles", "home", "confidence", "remarks"} <= set(data)
    assert list(data["limbs"]) == ["right_leg", "left_leg", "right_arm", "left_arm"]
    assert len(data["soles"]["left_leg"]) == 4
    assert 0.8 < data["confidence"] <= 1
    robot = load_robot("mine.toml")
    assert robot.posture("home").base_height == data["home"]["base_height"]
    assert robot.text.startswith("# Limbs, soles and the posture home were read off")


def test_what_was_read_off_is_told_with_its_confidence(cli):
    Path("body.urdf").write_text(biped().text(), encoding="utf-8")
    called = cli("new", "body.urdf")
    assert called.code == 0
    assert "body.toml: body" in called.out
    assert "left_leg" in called.out
    assert Path("body.toml").exists()


def test_a_robot_without_two_legs_is_refused_with_the_reason(cli):
    Path("dog.urdf").write_text(biped(hips=(-0.2, 0.2), arm=()).text(), encoding="utf-8")
    called = cli("new", "dog.urdf", "-o", "dog.toml")
    assert called.code == 2
    assert "quadruped" in called.err
    assert not Path("dog.toml").exists()


def test_only_tables_are_written(cli):
    Path("body.urdf").write_text(biped().text(), encoding="utf-8")
    called = cli("new", "body.urdf", "-o", "body.urdf")
    assert called.code == 2
    assert "must end with .toml" in called.err


def test_a_dh_table_is_refused_with_what_it_lacks(cli):
    Path("leg.csv").write_text(DH, encoding="utf-8")
    called = cli("new", "leg.csv", "-o", "leg.toml")
    assert called.code == 2
    assert called.err.startswith("error: leg.csv is a DH table: it tells axes alone, and finding limbs needs")
    assert "masses, inertias, joint limits and feet" in called.err
    assert called.err.count("\n") == 1
    assert not Path("leg.toml").exists()
