"""EAIK as judge: every branch that it finds is found."""

from __future__ import annotations

import os
import sysconfig
from collections.abc import Collection, Iterator
from pathlib import Path

import numpy as np
import pytest

import screwkin as sk
from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import Vector, as_array, pose_from_array, unstack
from screwkin.analysis.ik_others import offset_parameters
from screwkin.ik.methods import solve_limb_arrays
from screwkin.ik.numeric import IkSettings
from screwkin.kinematics.serial_chain import SerialChain, distance, forward, nearest_points, residual
from tests.ik.legs import (
    Leg,
    apart,
    backwards,
    nearly,
    offset_leg,
    random_parallel_leg,
    random_spherical_leg,
    spherical_leg,
    structured_leg,
)

SAME, EXACT, REGULAR = 1e-5, 1e-7, 1e-3
SOLVED_BY_BOTH = ("m012 p34", "m012 p45", "m012 m34", "m345 p12", "m345 p01", "m345 m12")
"""Three axes that meet at one end, and two others that meet or are parallel; see ``structured_leg``."""
STRUCTURES = (
    *SOLVED_BY_BOTH,
    *("m012", "m123", "m234", "m345", "m012 m45", "m345 m01", "m234 p01", "m123 p45", "m123 m45", "m234 m01"),
    *("p012", "p123", "p234", "p345", "p123 m45", "p234 m01", "p123 m01 m45", "p012 m45", "p345 m01"),
    *("m01 m23 m45", "p12 p34", "m01 m12 p34", "m012 m234", "m012 m345"),
)
NEARLY = (0.0, 1e-9, 1e-6, 1e-3)
"""By how much axes fail to be parallel [rad] and to meet."""


def compared(chain: SerialChain, poses: int) -> tuple[int, int]:
    """How many of EAIK's solutions are found, and how many missed; singular ones, of few digits, apart."""
    library = pytest.importorskip("eaik.IK_HP")
    try:
        other = library.HPRobot(*offset_parameters(chain))
    except RuntimeError:  # it takes some parallel axes for meeting ones
        return 0, 0
    if not other.hasKnownDecomposition():
        return 0, 0
    low, high = (np.where(np.isfinite(x), x, y) for x, y in ((chain.lower, -np.pi), (chain.upper, np.pi)))
    q = np.random.default_rng(0).uniform(low, high, (poses, 6))
    T = poses_of(chain, q)
    home = poses_of(chain, np.zeros((1, 6)))[0, :3, :3]
    found, counts = solve_limb_arrays(chain, T, "auto", np.zeros(6), IkSettings(), True), [0, 0]
    for k, pose in enumerate(T):
        wanted = pose.copy()
        wanted[:3, :3] = pose[:3, :3] @ home.T
        answer = other.IK(wanted)
        theirs = [np.asarray(x) for x, least in zip(answer.Q, answer.is_LS, strict=True) if not least]
        for x in theirs:
            if distance(chain, x[None], pose[None])[0] > EXACT or conditioning(chain, x) < REGULAR:
                continue
            near = apart(found.q[k], x) < SAME
            counts[0 if (near & found.valid[k]).any() else 1] += 1
    return counts[0], counts[1]


def assert_all_of_eaik_s_branches_are_found(chain: SerialChain) -> None:
    found, missed = compared(chain, 8)
    assert found > 8
    assert not missed


def poses_of(chain: SerialChain, q: np.ndarray) -> np.ndarray:
    return np.asarray(as_array(forward(chain.screws, unstack(q), chain.tip)[0], (len(q),)), dtype=float)


def conditioning(chain: SerialChain, q: np.ndarray) -> float:
    J = residual(chain, q[None], poses_of(chain, q[None]))[1][0]
    J[3:] /= chain.length
    values = np.linalg.svd(J, compute_uv=False)
    return float(values[-1] / values[0])


@pytest.mark.parametrize(
    "leg",
    [offset_leg(), spherical_leg(), random_parallel_leg(0), random_spherical_leg(1)],
)
def test_branches_of_special_legs(leg: Leg) -> None:
    assert_all_of_eaik_s_branches_are_found(leg.chain())
    assert_all_of_eaik_s_branches_are_found(backwards(leg, 1).chain())


@pytest.mark.parametrize("kind", SOLVED_BY_BOTH)
def test_branches_of_limbs_with_three_axes_that_meet(kind: str) -> None:
    found, missed = compared(structured_leg(kind, 0).chain(), 3)
    assert found
    assert not missed


def own_missed(chain: SerialChain, poses: int, seed: int) -> int:
    """How many random regular positions are not among the branches of their own poses."""
    q = np.random.default_rng(seed).uniform(-np.pi, np.pi, (poses, 6))
    found = solve_limb_arrays(chain, poses_of(chain, q), "auto", np.zeros(6), IkSettings(), True)
    own = ((apart(found.q, q[:, None]) < SAME) & found.valid).any(axis=1)
    return sum(conditioning(chain, x) > REGULAR for x in q[~own])


@pytest.mark.slow
@pytest.mark.parametrize("near", NEARLY)
@pytest.mark.parametrize("kind", STRUCTURES)
def test_branches_of_random_structures(kind: str, near: float) -> None:
    """Five limbs of every structure: what EAIK finds, and the own branch of every pose."""
    for seed in range(5):
        chain = nearly(structured_leg(kind, seed), near, seed).chain()
        assert compared(chain, 3)[1] == 0, seed
        assert own_missed(chain, 50, seed) == 0, seed


@pytest.mark.parametrize("name", ["bioloid", "poppy12"])
def test_branches_of_bundled_legs(name: str) -> None:
    robot = sk.load_robot(name)
    for limb in robot.limbs:
        if limb.kind == "leg":
            assert_all_of_eaik_s_branches_are_found(SerialChain.of(robot, limb.name))


def chains_of(file: Path) -> Iterator[SerialChain]:
    """The last six revolute joints above every leaf of a URDF file, by Pinocchio."""
    pin = pytest.importorskip("pinocchio")
    try:
        model = pin.buildModelFromUrdf(str(file))
    except (ValueError, RuntimeError):  # what Pinocchio does not read is no limb
        return
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    for leaf in range(1, model.njoints):
        path = list(model.supports[leaf])[1:][-6:]
        single = all(model.joints[j].nv == 1 and "R" in model.joints[j].shortname() for j in path)
        if len(model.children[leaf]) or len(path) < 6 or not single:
            continue
        screws = []
        for j in path:
            J = pin.getJointJacobian(model, data, j, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
            axis = J[3:, model.joints[j].idx_v]
            screws.append(Screw(Vector(*map(float, axis)), Vector(*map(float, data.oMi[j].translation))))
        yield chain_of(screws, f"{file.stem} {model.names[leaf]}")


def chain_of(screws: list[Screw], name: str) -> SerialChain:
    points = np.array([list(screw.s0) for screw in screws])
    tip = np.eye(4)
    tip[:3, 3] = points[-1] + [0.02, 0.01, -0.05]
    near = nearest_points(screws, pose_from_array(tip).p)
    size = np.linalg.norm(np.diff([list(screw.s0) for screw in near], axis=0), axis=1).sum()
    names, ends = tuple(f"{name} {k}" for k in range(6)), np.full(6, np.pi)
    turning, length = np.ones(6, dtype=bool), float(size) + 0.05
    return SerialChain(name, names, tuple(range(6)), near, pose_from_array(tip), -ends, ends, turning, length)


def robot_files() -> list[Path]:
    """URDF files of example-robot-data, or of the folder ``SCREWKIN_ROBOTS``."""
    share = Path(sysconfig.get_path("purelib"), "cmeel.prefix", "share", "example-robot-data", "robots")
    return sorted(Path(os.environ.get("SCREWKIN_ROBOTS", share)).rglob("*.urdf"))


def different(chains: Collection[SerialChain]) -> list[SerialChain]:
    """The limbs of one file without those that have the same axes and tip, as hands' many fingers have."""
    keys = (np.round([[*s.s, *(s.s0 - chain.tip.p)] for s in chain.screws], 6).tobytes() for chain in chains)
    return list(dict(zip(keys, chains, strict=True)).values())


@pytest.mark.robots
@pytest.mark.parametrize("file", robot_files(), ids=lambda file: file.name)
def test_branches_of_public_robots(file: Path) -> None:
    """All limbs and arms of a file; ``-s`` shows how many branches were compared."""
    chains = different(list(chains_of(file)))
    counts = {chain.limb: compared(chain, 5) for chain in chains}
    found, missed = np.sum([*counts.values(), (0, 0)], axis=0)
    print(f"{file.name}: {found + missed} branches of {len(chains)} limbs, {missed} missed")
    assert not missed, {limb: both for limb, both in counts.items() if both[1]}
