"""Bundled files are found by name from a checkout and from a wheel, all others by their path."""

from __future__ import annotations

from pathlib import Path

import pytest

from screwkin.errors import TableError, UnknownNameError
from screwkin.model import library
from screwkin.model.table import load_robot


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An installed package in an empty place of its own."""
    monkeypatch.setattr(library, "files", lambda name: tmp_path / name)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "screwkin").mkdir()
    return tmp_path


def plant(folder: Path, *names: str) -> None:
    for name in names:
        path = folder / f"{name}.toml"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("")


def test_a_wheel_carries_its_tables_inside_the_package(package):
    plant(package / "screwkin/data/robots", "inside")
    plant(package / "robots", "outside")
    assert library.robot_names() == ("inside",)
    assert library.find_robot("inside") == package / "screwkin/data/robots/inside.toml"


def test_a_checkout_has_its_tables_beside_the_package(package):
    plant(package / "robots", "zeta", "alpha", "linkages/four-bar")
    plant(package / "trajectories", "walk")
    assert library.robot_names() == ("alpha", "zeta", "linkages/four-bar")
    assert library.gait_names() == ("walk",)
    assert library.find_robot("linkages/four-bar") == package / "robots/linkages/four-bar.toml"
    assert library.find_gait("walk") == package / "trajectories/walk.toml"


def test_an_unknown_name_lists_the_valid_ones(package):
    plant(package / "robots", "alpha", "linkages/four-bar")
    with pytest.raises(UnknownNameError) as caught:
        library.find_robot("aleph")
    assert (
        str(caught.value) == "unknown robot 'aleph'; valid: alpha, linkages/four-bar. Did you mean 'alpha'?"
    )
    assert caught.value.exit_code == 2
    with pytest.raises(UnknownNameError, match="unknown gait 'trot'; valid: none"):
        library.find_gait("trot")


@pytest.mark.parametrize("kind", [str, Path])
def test_a_path_works_wherever_a_name_does(package, kind):
    plant(package / "mine", "robot")
    plant(package, "here")
    assert library.find_robot(kind("mine/robot.toml")) == Path("mine/robot.toml")
    assert library.find_robot(kind(str(package / "mine/robot.toml"))) == package / "mine/robot.toml"
    assert library.find_gait(kind("here.toml")) == Path("here.toml")


def test_a_bundled_name_wins_over_a_folder_of_the_same_name(package):
    plant(package / "robots", "linkages/four-bar")
    (package / "linkages" / "four-bar").mkdir(parents=True)
    assert library.find_robot("linkages/four-bar").parts[-3] == "robots"


def test_a_bare_name_is_never_taken_for_a_file(package):
    (package / "alpha").write_text("")
    with pytest.raises(UnknownNameError):
        library.find_robot("alpha")


@pytest.mark.parametrize(
    "name", ["no/such.toml", "no.toml", "a\0b.toml", "x" * 5000 + ".toml", "../robots/alpha"]
)
def test_a_missing_file_is_told_with_the_bundled_names(package, name):
    plant(package / "robots", "alpha")
    with pytest.raises(UnknownNameError, match=r"unknown robot file .*; valid: alpha"):
        library.find_robot(name)


def test_a_folder_given_as_a_robot_is_refused_as_one(package):
    (package / "mine").mkdir()
    with pytest.raises(TableError, match="is a folder"):
        load_robot("mine/")


def test_every_bundled_robot_loads_under_its_own_name():
    names = library.robot_names()
    assert {"bioloid", "bioloid24"} <= set(names)
    for name in names:
        assert load_robot(name).name == name.rpartition("/")[2]
