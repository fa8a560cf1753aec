"""Inputs of the workloads: arrays made once from a seed or a walk, and given alike to every contestant."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import screwkin as sk
from screwkin.analysis.ik_targets import random_targets, walking_path, walking_targets
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.model.robot import Limb, Robot

Array = Any


@dataclass(frozen=True, eq=False)
class Motion:
    """W1, B states and what is imposed: world axes, SI units, twists [omega; v of the frame's own origin].

    Attributes:
        T_world_base: (B, 4, 4).
        q: (B, n).
        waist: (B, 6).
        tips: (B, 6) for every leg, (B, 3) velocities for every arm, by tip in the order of the limbs.
    """

    T_world_base: Array
    q: Array
    waist: Array
    tips: Mapping[str, Array]

    @property
    def flat(self) -> Array:
        """(B, inputs): columns of R, p, q, waist, tips."""
        columns = self.T_world_base[:, :3].swapaxes(1, 2).reshape(-1, 12)
        return np.concatenate([columns, self.q, self.waist, *self.tips.values()], axis=1)


@dataclass(frozen=True, eq=False)
class Reach:
    """W2: tip poses (B, 4, 4) of one limb in the base frame; guess (n,); whether samples follow a path."""

    limb: Limb
    chain: SerialChain
    target: Array
    guess: Array
    follows: bool


@dataclass(frozen=True, eq=False)
class Stance:
    """W3: targets in the world, poses (B, 4, 4) of base and legs, positions (B, 3) of arms; guess (n,)."""

    T_world_base: Array
    tips: Mapping[str, Array]
    guess: Array


@dataclass(frozen=True, eq=False)
class Dynamic:
    """W4, W8: T samples of states, rates, accelerations; twists of the base, world axes; feet in contact."""

    T_world_base: Array
    q: Array
    qd: Array
    qdd: Array
    twist: Array
    acceleration: Array
    contact: Array


def size(given: Motion | Reach | Stance | Dynamic) -> int:
    """Samples of inputs."""
    return len(given.target if isinstance(given, Reach) else given.T_world_base)


def first(given: Any, count: int) -> Any:
    """The same inputs, but only so many samples of them."""
    samples = size(given)

    def cut(value: Any) -> Any:
        if isinstance(value, Mapping):
            return {name: cut(each) for name, each in value.items()}
        batch = isinstance(value, np.ndarray) and value.ndim > 1 and len(value) == samples
        return value[:count] if batch else value

    return type(given)(**{field.name: cut(getattr(given, field.name)) for field in fields(given)})


def motion(robot: Robot, count: int, seed: int = 1) -> Motion:
    """W1: states around the home posture, base turned and moved at random, every body in motion."""
    rng = np.random.default_rng(seed)
    home = sk.home(robot)
    T = np.tile(np.eye(4), (count, 1, 1))
    T[:, :3, :3] = Rotation.from_rotvec(rng.uniform(-0.5, 0.5, (count, 3))).as_matrix()
    T[:, :3, 3] = rng.uniform(-1, 1, (count, 3))
    q = home.q + rng.uniform(-0.3, 0.3, (count, len(home.q)))
    tips = {limb.tip: rng.uniform(-1, 1, (count, 6 if limb.kind == "leg" else 3)) for limb in robot.limbs}
    return Motion(T, q, rng.uniform(-1, 1, (count, 6)), tips)


def first_leg(robot: Robot) -> Limb:
    """The limb of W2 and W6."""
    return next(limb for limb in robot.limbs if limb.kind == "leg")


def gait_reach(robot: Robot, count: int) -> Reach:
    """W2 along a walk (750 poses at most), sole kept level."""
    limb = first_leg(robot)
    chain = SerialChain.of(robot, limb.name)
    target = walking_targets(chain, walking_path(chain))[:count]
    return Reach(limb, chain, target, _home(robot, chain), True)


def random_reach(robot: Robot, count: int) -> Reach:
    """W2 at random joint positions inside the limits."""
    limb = first_leg(robot)
    chain = SerialChain.of(robot, limb.name)
    return Reach(limb, chain, random_targets(chain, count, 1), _home(robot, chain), False)


def _home(robot: Robot, chain: SerialChain) -> Array:
    return sk.home(robot).q[list(chain.joints)]


def walked(robot: Robot, count: int) -> sk.Trajectory:
    """A walk of eight steps with at least so many samples."""
    gait = sk.load_gait("walk")
    duration = sk.walk(robot, gait.replace(rate=10.0)).time[-1]
    return sk.walk(robot, gait.replace(rate=max(10.0, float(np.ceil(count / duration)))))


def stance(robot: Robot, trajectory: sk.Trajectory, count: int) -> Stance:
    """W3: what a walk wants of waist, feet and hands."""
    tips = {}
    for limb in robot.limbs:
        pose = trajectory.T_world_tip[limb.tip][:count]
        tips[limb.tip] = pose if limb.kind == "leg" else np.ascontiguousarray(pose[:, :3, 3])
    return Stance(trajectory.T_world_base[:count], tips, sk.home(robot).q)


def dynamic(trajectory: sk.Trajectory, count: int) -> Dynamic:
    """W4, W8: the walk with its rates and accelerations."""
    arrays = (trajectory.T_world_base, trajectory.q, trajectory.qd, trajectory.qdd)
    moving = (*arrays, trajectory.base_twist, trajectory.base_acceleration, trajectory.contact)
    return Dynamic(*(a[:count] for a in moving))
