"""Legs of public robots without closed form: ``SCREWKIN_ROBOTS=FOLDER pytest -m robots -s`` and this file."""

from __future__ import annotations

import os
import time
from pathlib import Path

import numpy as np
import pytest

import screwkin as sk
from screwkin.anatomy.humanoid import anatomy
from screwkin.compiler.run import compile_program
from screwkin.ik.all_branches import branch_programs, by_relative, has_branches
from screwkin.ik.closed import recognised
from screwkin.ik.methods import solve_limb_arrays
from screwkin.ik.numeric import IkSettings
from screwkin.ik.solutions import LimbSolutions
from screwkin.kinematics.serial_chain import SerialChain
from tests.ik.legs import apart
from tests.ik.test_others_branches import poses_of

POSES, BATCH = 10_000, 2_000


def files() -> list[Path]:
    """URDF files in the folder ``SCREWKIN_ROBOTS``."""
    folder = os.environ.get("SCREWKIN_ROBOTS")
    return sorted(Path(folder).rglob("*.urdf")) if folder else []


def first_leg(file: Path) -> SerialChain:
    """The first leg, if it has six joints, no closed form, and none but for rounding."""
    try:
        robot = anatomy(sk.load_robot(file)).robot
    except sk.ScrewkinError as error:
        pytest.skip(str(error).splitlines()[0])
    for limb in robot.limbs:
        if limb.kind == "leg" and len(robot.path_to(limb.link)) == 6:
            chain = SerialChain.of(robot, limb.name)
            if not recognised(chain) and has_branches(chain) and not by_relative(chain):
                return chain
    pytest.skip("no leg of six joints without closed form")


@pytest.mark.robots
@pytest.mark.parametrize("file", files(), ids=lambda file: file.name)
def test_the_own_branch_of_random_poses_within_limits_is_found(file: Path) -> None:
    chain = first_leg(file)
    for program in branch_programs(chain):
        compile_program(program)
    q = np.random.default_rng(0).uniform(chain.lower, chain.upper, (POSES, 6))
    T = poses_of(chain, q)
    own, times = [], []

    def solved(part: slice) -> LimbSolutions:
        start = time.process_time()
        found = solve_limb_arrays(chain, T[part], "auto", np.zeros(6), IkSettings(), True)
        times.append(time.process_time() - start)
        return found

    for start in range(0, POSES, BATCH):
        part = slice(start, start + BATCH)
        found = solved(part)
        own.append(((apart(found.q, q[part, None]) < 1e-10) & found.valid).any(axis=1))
    share = float(np.mean(own))
    print(f"{file.name}: own branch {share:.2%}, {1e6 * min(times) / BATCH:.1f} us a pose")
    assert share >= 0.999
