"""All public robots that Pinocchio reads are read, and move, weigh and answer as there.

The files are those of example-robot-data (the extra ``robots``, or a folder named by ``SCREWKIN_ROBOTS``) and
of pybullet_data: ``python -m pytest -m robots tests/oracles/test_public_robots.py``.
"""

from __future__ import annotations

import os
import sysconfig
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import screwkin as sk
from screwkin.anatomy.humanoid import anatomy
from screwkin.model.urdf_in import load_urdf, parse_urdf
from tests.model.as_pinocchio import assert_agrees, model_of
from tests.model.there_and_back import assert_walks_equally, there_and_back

pytestmark = pytest.mark.robots


def folders() -> list[Path]:
    """Where robots are: without a trace of them there are none to test."""
    share = Path(sysconfig.get_path("purelib"), "cmeel.prefix", "share", "example-robot-data", "robots")
    found = [Path(os.environ.get("SCREWKIN_ROBOTS", share))]
    bullet = find_spec("pybullet_data")
    if bullet is not None and bullet.submodule_search_locations:
        found.append(Path(bullet.submodule_search_locations[0]))
    return [folder for folder in found if folder.is_dir()]


def files() -> list[Path]:
    """URDF files, but for the thousand random objects of pybullet_data."""
    found = [file for folder in folders() for file in sorted(folder.rglob("*.[uU][rR][dD][fF]"))]
    return [file for file in found if "random_urdfs" not in file.parts]


@pytest.mark.parametrize("file", files(), ids=lambda file: "/".join(file.parts[-3:]))
def test_a_robot_that_pinocchio_reads_is_read_and_agrees(file: Path) -> None:
    text = file.read_text(encoding="utf-8", errors="replace")
    try:
        model_of(text, floating=True)
    except (ValueError, RuntimeError) as wrong:
        pytest.skip(f"Pinocchio does not read it: {wrong}")
    robot = parse_urdf(text, str(file)).robot
    assert_agrees(robot, model_of(text, robot.base == "floating"), np.random.default_rng(3))


@pytest.mark.parametrize("name", ["talos_reduced", "icub"])
def test_an_imported_humanoid_walks_equally_after_both_files_and_a_table_and_both_again(
    name: str, tmp_path: Path
) -> None:
    found = [file for file in files() if file.stem == name]
    if not found:
        pytest.skip(f"no {name}.urdf: install example-robot-data, or name its folder in SCREWKIN_ROBOTS")
    robot = anatomy(load_urdf(found[0]).robot).robot
    assert_walks_equally(there_and_back(robot, tmp_path), robot, sk.fitting_gait(robot))
