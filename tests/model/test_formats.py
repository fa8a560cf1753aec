"""``load_robot`` and ``robot_from_text``: one door for screw tables, URDF and DH tables."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

import screwkin as sk
from screwkin.errors import InputError, TableError, UnknownNameError
from screwkin.model.dh_csv import dh_text
from screwkin.model.table import load_robot, robot_from_text
from screwkin.model.urdf import urdf_from_robot
from tests.model.chains import limb_table

POPPY = load_robot("poppy12")


@pytest.mark.parametrize("suffix", [".urdf", ".URDF"])
def test_a_urdf_file_is_read_with_a_warning_of_what_it_cannot_say(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"biped{suffix}"
    path.write_text(urdf_from_robot(POPPY))
    with pytest.warns(UserWarning, match=r"biped.*the file names no limbs") as caught:
        robot = load_robot(path)
    assert caught[0].filename == __file__
    assert robot.joint_names == POPPY.joint_names
    assert robot.mass == pytest.approx(POPPY.mass)
    assert robot.text_matches
    assert load_robot_quietly(str(path)).joint_names == POPPY.joint_names


def load_robot_quietly(path: str) -> sk.Robot:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return load_robot(path)


def test_a_dh_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / "leg.csv"
    path.write_text(dh_text([limb_table(POPPY, "right_leg")]))
    robot = load_robot(path)
    assert robot.name == "leg"
    assert robot.tip_names == ("right_foot",)
    assert robot.text_matches
    q = np.linspace(-0.3, 0.4, len(robot.joints))
    state = sk.State(np.eye(4), np.zeros(12))
    state.q[[POPPY.joint_names.index(name) for name in robot.joint_names]] = q
    np.testing.assert_allclose(
        sk.frame_pose(robot, sk.State(np.eye(4), q), "right_foot"),
        sk.frame_pose(POPPY, state, "right_foot"),
        atol=1e-12,
    )


def test_a_text_is_read_whichever_it_is() -> None:
    assert robot_from_text(POPPY.text).joint_names == POPPY.joint_names
    assert robot_from_text(sk.load_robot("bioloid").text, symbolic=True).parameters["thigh"].is_Symbol
    with pytest.warns(UserWarning, match="^mine: "):
        robot = robot_from_text("\ufeff\n" + urdf_from_robot(POPPY).split("?>")[-1], "mine")
    assert robot.joint_names == POPPY.joint_names
    assert robot.path == "mine"


def test_what_cannot_be_read_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match=r"unknown robot file 'none\.urdf'"):
        load_robot("none.urdf")
    with pytest.raises(TableError, match="mine: "):
        robot_from_text("name = 3", "mine")
    with pytest.raises(InputError, match="text is a PosixPath, expected str"):
        robot_from_text(tmp_path)  # type: ignore[arg-type]
    path = tmp_path / "biped.urdf"
    path.write_text(urdf_from_robot(POPPY))
    for call in (
        lambda: load_robot(path, symbolic=True),
        lambda: robot_from_text(path.read_text(), symbolic=True),
    ):
        with pytest.raises(InputError, match="no parameters to keep as symbols"):
            call()


def test_xacro_is_refused_by_its_suffix_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("r.urdf.xacro").write_text('<robot xmlns:xacro="http://ros.org/wiki/xacro"><xacro:leg/></robot>')
    with pytest.raises(TableError, match="Run xacro first"):
        load_robot("r.urdf.xacro")


def test_a_folder_with_one_urdf_file_is_that_robot(tmp_path: Path) -> None:
    (tmp_path / "pkg" / "urdf").mkdir(parents=True)
    (tmp_path / "pkg" / "urdf" / "biped.urdf").write_text(urdf_from_robot(POPPY))
    assert load_robot_quietly(str(tmp_path / "pkg")).joint_names == POPPY.joint_names
    (tmp_path / "pkg" / "urdf" / "other.urdf").write_text("")
    with pytest.raises(UnknownNameError, match=r"biped\.urdf, .*other\.urdf"):
        load_robot(tmp_path / "pkg")


@pytest.mark.parametrize("name", ["r.urdf", "r.xml", "r.toml"])
@pytest.mark.parametrize("text", ["", " \n\n", "\ufeff"])
def test_an_empty_file_is_called_empty(name: str, text: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(TableError, match=rf"{name}: file: is empty"):
        load_robot(tmp_path / name)


def test_a_file_named_as_xml_without_a_tag_is_not_read_as_a_table(tmp_path: Path) -> None:
    (tmp_path / "r.urdf").write_text("version https://git-lfs.github.com/spec/v1\n")
    with pytest.raises(TableError, match=r"r\.urdf: file: begins with 'version'\. Expected XML"):
        load_robot(tmp_path / "r.urdf")
