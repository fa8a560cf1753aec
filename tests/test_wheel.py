"""What a user installs: the wheel, built from the source archive, with robots, gaits, types and command."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from email import message_from_bytes
from email.message import Message
from importlib.metadata import distribution
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import screwkin
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


def files_below(*folders: str) -> set[str]:
    return {
        path.relative_to(CHECKOUT).as_posix()
        for folder in folders
        for path in (CHECKOUT / folder).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }


def data_files() -> set[str]:
    return files_below("robots", "trajectories", "papers")


def test_the_wheel_holds_package_data_and_types_and_nothing_else(archives):
    (wheel,) = archives.glob("*.whl")
    names = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert {f"screwkin/data/{name}" for name in data_files()} | files_below("screwkin") == names
    assert "screwkin/py.typed" in names
    assert any(name.startswith("screwkin/motors/models/") for name in names)
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
        "hatch_build.py",
        "requirements-small.txt",
        "tests/conftest.py",
        "screwkin/py.typed",
    }
    assert needed | data_files() <= names


@pytest.fixture(scope="module")
def metadata(archives) -> Message:
    """What the wheel says of itself."""
    (wheel,) = archives.glob("*.whl")
    with zipfile.ZipFile(wheel) as opened:
        (name,) = [name for name in opened.namelist() if name.endswith(".dist-info/METADATA")]
        return message_from_bytes(opened.read(name))


def test_the_wheel_runs_on_every_python_and_asks_for_pybullet_only_where_it_has_wheels(metadata):
    assert metadata["Requires-Python"] == ">=3.11"
    classifiers = metadata.get_all("Classifier")
    assert {f"Programming Language :: Python :: 3.{minor}" for minor in range(11, 15)} <= set(classifiers)
    core = [Requirement(text) for text in metadata.get_all("Requires-Dist") if "extra ==" not in text]
    anywhere = {r.name for r in core if r.marker is None}
    assert anywhere == {
        *("numpy", "scipy", "sympy", "jax", "mujoco", "pyserial", "dynamixel-sdk", "typer", "pydantic"),
        *("defusedxml", "matplotlib", "pillow", "platformdirs"),
    }
    assert {r.name: str(r.marker) for r in core if r.marker} == {"pybullet": 'python_version < "3.12"'}


def test_the_long_description_leads_nowhere_outside_the_repository(metadata):
    text = metadata.get_payload()
    assert text.startswith("# screwkin")
    assert "Read on" in text
    links = re.findall(r"\]\(([^)]*)\)", text)
    assert all(link.startswith(("https:", "http:")) for link in links), links


def test_the_version_is_one_everywhere(metadata):
    cited = re.search(
        r"^version: (\S+)$", (CHECKOUT / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE
    )
    newest = re.search(r"^## (\S+)", (CHECKOUT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert {metadata["Version"], cited[1], newest[1]} == {screwkin.__version__}


SMALL = CHECKOUT / "requirements-small.txt"
LEFT_OUT = {"sympy", "jax", "mujoco", "pybullet", "pyserial", "dynamixel-sdk", "matplotlib"}


def small() -> list[Requirement]:
    lines = SMALL.read_text(encoding="utf-8").splitlines()
    return [Requirement(line) for line in lines if not line.startswith("#")]


def test_a_small_installation_has_all_requirements_but_seven():
    project = tomllib.loads((CHECKOUT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    all_of_them = [Requirement(line) for line in project["dependencies"]]
    assert {r.name for r in all_of_them} - {r.name for r in small()} == LEFT_OUT
    assert {str(r) for r in small()} <= {str(r) for r in all_of_them}


def test_a_small_installation_takes_at_most_300_megabytes():
    waiting, sizes = [r.name for r in small()], {}
    while waiting:
        name = canonicalize_name(waiting.pop())
        if name in sizes:
            continue
        installed = distribution(name)
        paths = [Path(str(file.locate())) for file in installed.files or ()]
        sizes[name] = sum(path.stat().st_size for path in paths if path.is_file())
        needs = [Requirement(text) for text in installed.requires or ()]
        waiting += [r.name for r in needs if r.marker is None or r.marker.evaluate({"extra": ""})]
    assert "pydantic-core" in sizes
    assert not LEFT_OUT & sizes.keys()
    assert 50e6 < sum(sizes.values()) < 300e6, sizes


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
    found = json.loads(run(sys.executable, "-P", "-c", code, cwd=installed.parent, PYTHONPATH=str(installed)))
    inside = str(installed / "screwkin")
    assert found["home"].startswith(inside)
    assert all(path.startswith(inside) for path in found["paths"])
    assert tuple(name for name, _ in found["robots"]) == robot_names() != ()
    assert tuple(name for name, _ in found["gaits"]) == gait_names() != ()


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
