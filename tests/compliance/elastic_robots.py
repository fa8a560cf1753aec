"""Random robots whose links bend, what loads them, and their energy by positions alone."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

import screwkin as sk
from screwkin.compliance.elastic import elastic
from screwkin.model.records import LinkSpring
from screwkin.model.robot import Robot
from tests.kinematics.machines import point, random_state, random_tree


def random_stiffness(rng: np.random.Generator) -> tuple[tuple[float, ...], ...]:
    """Some 1000 N m/rad and 20,000 N/m, coupled."""
    A = rng.normal(size=(6, 6))
    size = np.sqrt([1e3] * 3 + [2e4] * 3)
    K = (A @ A.T / 6 + 0.3 * np.eye(6)) * np.outer(size, size)
    return tuple(map(tuple, ((K + K.T) / 2).tolist()))


@cache
def bending_tree(seed: int, joints: int = 7, branching: bool = True) -> Robot:
    """A random tree of which two links bend."""
    rng = np.random.default_rng(seed + 77)
    tree = random_tree(seed, joints, branching)
    chosen = rng.choice(np.arange(1, len(tree.links)), 2, replace=False)
    links = [
        replace(link, spring=LinkSpring(point(rng), point(rng), random_stiffness(rng)))
        if i in chosen
        else link
        for i, link in enumerate(tree.links)
    ]
    return replace(tree, links=tuple(links))


@dataclass(frozen=True)
class Case:
    """A robot, a commanded state, what stands still, springs and loads: the arguments of a deflection."""

    robot: Robot
    state: sk.State
    support: Any
    stiffness: Any
    loads: dict[str, Any]
    springs: dict[str, Any]

    @property
    def arguments(self) -> tuple[Any, ...]:
        return self.robot, self.state, self.support, self.stiffness

    @property
    def options(self) -> dict[str, Any]:
        return {"loads": self.loads, "springs": self.springs}


def hardening(x):
    """Effort and slope of 400 x + 2000 x^3."""
    return 400 * x + 2000 * x**3, 400 + 6000 * x**2


def random_case(seed: int, supports: int = 1, moments: bool = False, branching: bool = True) -> Case:
    """Forces on two links, an effort on a joint, a spring that hardens."""
    rng = np.random.default_rng(seed + 5)
    robot = bending_tree(seed, 7, branching)
    names = list(robot.link_names)
    support = [names[-1], *rng.choice(names[1:-2], supports - 1, replace=False).tolist()]
    loads: dict[str, Any] = {
        str(name): rng.normal(size=3) * 5 for name in rng.choice(names, 2, replace=False)
    }
    if moments:
        loads[names[2]] = rng.normal(size=6) * 3
    loads[robot.joint_names[1]] = float(rng.normal())
    k = dict(zip(robot.joint_names, rng.uniform(300, 600, len(robot.joints)).tolist(), strict=True))
    state = random_state(robot, seed)
    return Case(
        robot, state, support if supports > 1 else support[0], k, loads, {robot.joint_names[3]: hardening}
    )


def energy(case: Case, x: np.ndarray, root: str) -> float:
    """Of springs, weight and forces at deflections of joints and links, the root held."""
    model = elastic(case.robot)
    n = len(case.robot.joints)
    T = standing(case, x, root)
    state = sk.State(T, np.concatenate([case.state.q, np.zeros(len(x) - n)]) + x)
    total = float(model.robot.mass) * 9.81 * float(sk.center_of_mass(model.robot, state)[2])
    for i, name in enumerate(case.robot.joint_names):
        curved = name in case.springs
        total += 200 * x[i] ** 2 + 500 * x[i] ** 4 if curved else 0.5 * case.stiffness[name] * x[i] ** 2
        total -= case.loads.get(name, 0.0) * x[i]
    for k, K in enumerate(model.stiffness):
        six = x[n + 6 * k : n + 6 * k + 6]
        total += 0.5 * six @ K @ six
    for name, force in case.loads.items():
        if name not in case.robot.joint_names:
            total -= force @ sk.frame_pose(model.robot, state, name)[:3, 3]
    return total


def standing(case: Case, x: np.ndarray, root: str) -> np.ndarray:
    """Pose of the base at deflections, the root where it was commanded."""
    model, n = elastic(case.robot), len(case.robot.joints)
    q = np.concatenate([case.state.q, np.zeros(len(x) - n)])
    here, there = (sk.frame_pose(model.robot, sk.State(np.eye(4), y), root) for y in (q, q + x))
    return np.asarray(case.state.T_world_base @ here @ np.linalg.inv(there))


def coordinates(deflection: Any) -> np.ndarray:
    """Deflections of joints and links as coordinates of the elastic robot."""
    links = deflection.links[..., [3, 4, 5, 0, 1, 2]]
    return np.concatenate([deflection.theta, links.reshape(*links.shape[:-2], -1)], axis=-1)
