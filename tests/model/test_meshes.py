"""Meshes of every format, and where a robot's file may mean them to be."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from screwkin.errors import InputError, MissingDependencyError
from screwkin.model.mesh_files import find_mesh, full_path, short_path
from screwkin.model.meshes import load_mesh, upward_axis
from tests.model.meshes import CORNERS, write_dae, write_obj, write_stl


def in_order(points: np.ndarray) -> np.ndarray:
    return points[np.lexsort(points.T)]


@pytest.mark.parametrize("write", [write_stl, write_obj, write_dae])
def test_corners_of_a_mesh_are_those_of_its_file(tmp_path, write):
    mesh = load_mesh(write(tmp_path / f"a.{write.__name__[-3:].upper()}"))
    np.testing.assert_allclose(in_order(np.unique(mesh.corners, axis=0)), in_order(CORNERS), atol=1e-7)
    assert len(mesh.faces) == 4
    np.testing.assert_array_equal(mesh.turn, np.eye(3))


@pytest.mark.parametrize(
    ("up", "turned"),
    [
        ("Z_UP", lambda x, y, z: (x, y, z)),
        ("Y_UP", lambda x, y, z: (x, -z, y)),
        ("X_UP", lambda x, y, z: (-y, -z, x)),
    ],
)
def test_collada_says_which_axis_is_up_and_in_which_unit(tmp_path, up, turned):
    mesh = load_mesh(write_dae(tmp_path / "a.dae", up=up, unit=0.01))
    assert upward_axis(tmp_path / "a.dae") == up[0]
    wanted = 0.01 * np.array([turned(*corner) for corner in CORNERS])
    found = np.unique(mesh.corners @ mesh.turn.T, axis=0)
    np.testing.assert_allclose(in_order(found), in_order(wanted), atol=1e-9)
    assert np.linalg.det(mesh.turn) == pytest.approx(1)


def test_a_flat_mesh_has_all_its_corners(tmp_path):
    flat = CORNERS * [1, 1, 0]
    assert len(load_mesh(write_obj(tmp_path / "flat.obj", flat)).corners) == 3


def test_a_mesh_is_read_anew_when_its_file_changes(tmp_path):
    path = write_stl(tmp_path / "a.stl")
    assert load_mesh(path) is load_mesh(path)
    write_stl(path, 1000 * CORNERS)
    assert load_mesh(path).corners.max() == 3000


@pytest.mark.parametrize(
    ("name", "text"), [("a.stl", "not a mesh"), ("a.dae", "<COLLADA/>"), ("a.mesh", "x"), ("a.obj", "")]
)
def test_a_damaged_mesh_is_an_error_that_names_it(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(InputError, match=rf"mesh .*{name}: (cannot be read|holds no triangles)"):
        load_mesh(path)
    with pytest.raises(InputError, match="cannot be read"):
        load_mesh(tmp_path / "none.stl")


def test_a_mesh_without_trimesh_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(MissingDependencyError, match="pip install trimesh"):
        load_mesh(write_stl(tmp_path / "a.stl"))


@pytest.mark.parametrize(
    ("uri", "file"),
    [
        ("a.stl", "pkg/urdf/a.stl"),
        ("../meshes/a.stl", "pkg/meshes/a.stl"),
        ("meshes\\left foot\\a.stl", "pkg/meshes/left foot/a.stl"),
        ("package://pkg/meshes/a.stl", "pkg/meshes/a.stl"),
        ("package:///pkg/meshes/a.stl", "pkg/meshes/a.stl"),
        ("package://other_name/meshes/left%20foot/a.stl", "pkg/meshes/left foot/a.stl"),
        ("package://brother/meshes/a.stl", "brother/meshes/a.stl"),
        ("model://brother/meshes/a.stl", "brother/meshes/a.stl"),
        ("package://known/meshes/a.stl", "ros/known/meshes/a.stl"),
        ("package://shared/meshes/a.stl", "ament/share/shared/meshes/a.stl"),
        ("http://pkg/meshes/a.stl", None),
        ("package://pkg/meshes/b.stl", None),
        ("\0", None),
    ],
)
def test_a_mesh_is_looked_for_where_packages_are(tmp_path, monkeypatch, uri, file):
    for place in (
        "pkg/urdf", "pkg/meshes", "pkg/meshes/left foot", "brother/meshes", "ros/known/meshes",
        "ament/share/shared/meshes",
    ):  # fmt: skip
        (tmp_path / place).mkdir(parents=True, exist_ok=True)
        (tmp_path / place / "a.stl").touch()
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "ros"))
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "ament"))
    found = find_mesh(uri, tmp_path / "pkg" / "urdf")
    assert found == (None if file is None else tmp_path / file)


def test_an_absolute_uri_names_its_very_file(tmp_path):
    path = write_stl(tmp_path / "a.stl")
    assert find_mesh(f"file://{path}", Path("/nowhere")) == path
    assert find_mesh(str(path), Path("/nowhere")) == path


def test_a_table_names_meshes_near_it_by_short_paths_that_read_back(tmp_path):
    folder = tmp_path / "pkg" / "tables"
    for file in ("pkg/tables/a.stl", "pkg/meshes/a.stl", "elsewhere/a.stl"):
        path = str(tmp_path / file)
        assert full_path(short_path(path, folder), folder) == path
    assert short_path(str(tmp_path / "pkg/meshes/a.stl"), folder) == "../meshes/a.stl"
    assert short_path(str(tmp_path / "elsewhere/a.stl"), folder) == str(tmp_path / "elsewhere/a.stl")
    assert full_path("package://pkg/a.stl", folder) == "package://pkg/a.stl"
