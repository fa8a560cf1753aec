"""What a user installs: the wheel, built from the source archive, with robots, gaits, types and command."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

from screwkin.model.library import gait_names, robot_names

CHECKOUT = Path(__file__).resolve().parent.parent


def run(*command: str | Path, cwd: Path, **environment: str) -> str:
    done = subprocess.run(
        [str(part) for part in command],
        cwd=cwd,
        env={**os.environ, **environment},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def archives(tmp_path_factory) -> Path:
    """A folder with the source archive and the wheel that was built from it."""
    folder = tmp_path_factory.mktemp("dist")
    run(sys.executable, "-m", "build", "--no-isolation", "--outdir", folder, CHECKOUT, cwd=folder)
    return folder


@pytest.fixture(scope="module")
def installed(archives, tmp_path_factory) -> Path:
    """A folder with the installed wheel, far from the checkout."""
    folder = tmp_path_factory.mktemp("site")
    (wheel,) = archives.glob("*.whl")
    install = ("-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--target", folder, wheel)
    run(sys.executable, *install, cwd=folder)
    return folder


def data_files() -> set[str]:
    return {
        path.relative_to(CHECKOUT).as_posix()
        for folder in ("robots", "trajectories")
        for path in (CHECKOUT / folder).rglob("*.toml")
    }


def test_the_wheel_holds_package_data_and_types_and_nothing_else(archives):
    (wheel,) = archives.glob("*.whl")
    names = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert {f"screwkin/data/{name}" for name in data_files()} <= names
    assert "screwkin/py.typed" in names
    strangers = {n for n in names if not n.startswith("screwkin/") or "__pycache__" in n or "/tests/" in n}
    assert not strangers


def test_the_source_archive_holds_what_tests_and_wheel_need(archives):
    (archive,) = archives.glob("*.tar.gz")
    with tarfile.open(archive) as opened:
        names = {name.partition("/")[2] for name in opened.getnames()}
    needed = {
        "pyproject.toml",
        "README.md",
        "LICENSE",
        "CHANGELOG.md",
        "tests/conftest.py",
        "screwkin/py.typed",
    }
    assert needed | data_files() <= names


def test_robots_and_gaits_are_found_and_loaded_from_an_installed_wheel(installed):
    code = """
import json
import screwkin
from screwkin.model.library import find_gait, find_robot, gait_names, robot_names
print(json.dumps({
    "home": screwkin.__file__,
    "paths": [*map(str, map(find_robot, robot_names())), *map(str, map(find_gait, gait_names()))],
    "robots": [[name, screwkin.load_robot(name).path] for name in robot_names()],
    "gaits": [[name, screwkin.load_gait(name).name] for name in gait_names()],
}))
"""
    told = json.loads(run(sys.executable, "-P", "-c", code, cwd=installed.parent, PYTHONPATH=str(installed)))
    inside = str(installed / "screwkin")
    assert told["home"].startswith(inside)
    assert all(path.startswith(inside) for path in told["paths"])
    assert tuple(name for name, _ in told["robots"]) == robot_names() != ()
    assert tuple(name for name, _ in told["gaits"]) == gait_names() != ()


@pytest.mark.parametrize(("verb", "names"), [("robots", robot_names), ("gaits", gait_names)])
def test_the_installed_command_lists_what_is_bundled(installed, verb, names):
    out = run(installed / "bin" / "screwkin", verb, "--json", cwd=installed.parent, PYTHONPATH=str(installed))
    assert json.loads(out)["names"] == list(names())


def test_the_module_runs_as_the_command_does(installed):
    module = run(
        sys.executable, "-P", "-m", "screwkin", "--help", cwd=installed.parent, PYTHONPATH=str(installed)
    )
    command = run(installed / "bin" / "screwkin", "--help", cwd=installed.parent, PYTHONPATH=str(installed))
    assert module == command
    assert "validate" in command
