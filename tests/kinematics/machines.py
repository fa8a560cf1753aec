"""Robots made by programs: random trees, random closed mechanisms, small chains, by seed."""

from __future__ import annotations

import os
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

from screwkin.algebra.screws import INFINITE, Screw
from screwkin.algebra.se3 import IDENTITY, Pose, Rotation, Twist, Vector, X, Z, exp, rotate, vector_from_array
from screwkin.kinematics.positions import link_displacements
from screwkin.model.library import find_robot
from screwkin.model.robot import Closure, Inertia, Joint, Limb, Link, Posture, Robot
from screwkin.model.state import State

seeds = st.integers(0, 10_000 if os.environ.get("HYPOTHESIS_PROFILE") == "many" else 11)
"""Of random robots: few, so that tests share them and their programs, unless many are asked for."""
TYPES = ("revolute", "revolute", "revolute", "prismatic", "helical")
SPATIAL = ("px", "py", "pz", "rx", "ry", "rz")


def unit(rng: np.random.Generator) -> Vector:
    """A direction, every fourth time along an axis."""
    if rng.random() < 0.25:
        axis = [0, 0, 0]
        axis[rng.integers(3)] = int(rng.choice([-1, 1]))
        return Vector(*axis)
    v = rng.normal(size=3)
    return vector_from_array(v / np.linalg.norm(v))


def point(rng: np.random.Generator, size: float = 0.3) -> Vector:
    return vector_from_array(rng.uniform(-size, size, 3))


def pose(rng: np.random.Generator, size: float = 0.3) -> Pose:
    return exp(Twist(vector_from_array(rng.uniform(-1.5, 1.5, 3)), point(rng, size)))


def inertia(rng: np.random.Generator, mass: float) -> Inertia:
    """Of four point masses, so that the triangle inequality holds."""
    p = rng.normal(size=(4, 3)) * 0.1
    p -= p.mean(axis=0)
    J = mass / 4 * sum(np.dot(x, x) * np.eye(3) - np.outer(x, x) for x in p)
    return Inertia(J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2])


def body(rng: np.random.Generator, name: str) -> Link:
    mass = float(rng.uniform(0.2, 2.0))
    return Link(name, mass, point(rng), inertia(rng, mass), pose(rng))


def joint(rng: np.random.Generator, i: int, parent: str, kind: str) -> Joint:
    pitch: Any = {"revolute": 0, "prismatic": INFINITE, "helical": float(rng.uniform(-0.2, 0.2))}[kind]
    screw = Screw(unit(rng), point(rng), pitch)
    return Joint(f"joint_{i}", parent, f"link_{i}", kind, screw, -10.0, 10.0, 5.0, 5.0)  # type: ignore[arg-type]


def machine(
    links: list[Link],
    joints: list[Joint],
    base: str = "fixed",
    limbs: tuple[Limb, ...] = (),
    closures: tuple[Closure, ...] = (),
    home: Any = None,
) -> Robot:
    """A Robot of these parts, with its posture ``home``."""
    q = tuple(float(x) for x in (np.zeros(len(joints)) if home is None else home))
    return Robot(
        "machine", "", "", base, links[0].name, tuple(links), tuple(joints), limbs, (), closures,
        (Posture("home", 0.0, q),),
    )  # fmt: skip


@cache
def random_tree(seed: int, joints: int = 7, branching: bool = True, base: str = "floating") -> Robot:
    """Revolute, prismatic and helical joints in a random tree of heavy links."""
    rng = np.random.default_rng(seed)
    parents = ["base"]
    rows = []
    for i in range(1, joints + 1):
        parent = parents[rng.integers(len(parents))] if branching else parents[-1]
        rows.append(joint(rng, i, parent, str(rng.choice(TYPES))))
        parents.append(f"link_{i}")
    home = rng.uniform(-0.8, 0.8, joints)
    links = [body(rng, name) for name in parents]
    links[0] = replace(links[0], frame=IDENTITY)  # it is called base, and so is the base frame
    return machine(links, rows, base, home=home)


def random_state(robot: Robot, seed: int, batch: tuple[int, ...] = ()) -> State:
    """Base anywhere within a metre, joints within 1 rad or m."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(-1, 1, (*batch, len(robot.joints)))
    T = np.empty((*batch, 4, 4))
    for index in np.ndindex(batch):
        T[index] = array_of(pose(rng, 1.0))
    return State(T, q)


def array_of(p: Pose) -> Any:
    """(4, 4), written out so that it shares nothing with ``as_array``."""
    rows = [[p.R.x.x, p.R.y.x, p.R.z.x, p.p.x], [p.R.x.y, p.R.y.y, p.R.z.y, p.p.y]]
    return np.array([*rows, [p.R.x.z, p.R.y.z, p.R.z.z, p.p.z], [0, 0, 0, 1]], dtype=float)


def serial_limb(robot: Robot, chain: tuple[str, ...] = SPATIAL) -> Robot:
    """The robot with a limb that ends on its last link."""
    home = Pose(Rotation(Vector(0, 1, 0), Vector(0, 0, 1), Vector(1, 0, 0)), Vector(0.1, 0.2, 0.3))
    limb = Limb("arm", "arm", robot.links[-1].name, "hand", home, chain)
    return replace(robot, limbs=(limb,))


def closed(robot: Robot, pairs: list[tuple[str, str]], seed: int) -> Robot:
    """The robot with these links joined, at its home posture, wherever they then are."""
    rng = np.random.default_rng(seed)
    D = dict(zip(robot.link_names, link_displacements(robot, list(robot.posture("home").q)), strict=True))
    closures = []
    for i, (a, b) in enumerate(pairs):
        frame = pose(rng)
        closures.append(Closure(f"loop_{i}", a, frame, b, D[b].inverse @ D[a] @ frame))
    return replace(robot, closures=tuple(closures))


@cache
def random_mechanism(seed: int) -> Robot:
    """Closed at home: one loop, or two loops, or a floating base with a limb and a loop."""
    kind = seed % 3
    if kind == 0:
        return closed(random_tree(seed, 8, branching=False, base="fixed"), [("link_8", "base")], seed)
    if kind == 1:
        tree = random_tree(seed, 8, branching=False, base="fixed")
        rng = np.random.default_rng(seed + 1)
        side = [joint(rng, i, "link_2" if i == 9 else f"link_{i - 1}", "revolute") for i in range(9, 16)]
        links = [*tree.links, *(body(rng, f"link_{i}") for i in range(9, 16))]
        home = [*tree.posture("home").q, *rng.uniform(-0.8, 0.8, 7)]
        both = machine(links, [*tree.joints, *side], home=home)
        return closed(both, [("link_8", "base"), ("link_15", "link_6")], seed)
    tree = random_tree(seed, 9, branching=False, base="floating")
    return serial_limb(closed(tree, [("link_8", "base")], seed))


def planar_arm(height: float = 0.1, chain: tuple[str, ...] = ("px", "py", "rz")) -> Robot:
    """Three links of 0.3 m with vertical axes at a height; the hand's frame is yawed by 0.25 and rolled."""
    names = ["base", "link_1", "link_2", "link_3"]
    links = [Link(name, 0, Vector(0, 0, 0), Inertia(0, 0, 0), IDENTITY) for name in names]
    rows = [
        Joint(
            f"joint_{i}", names[i - 1], names[i], "revolute",
            Screw(Vector(0, 0, 1), Vector(0.3 * (i - 1), 0, height)), -3.0, 3.0, 5.0, 5.0,
        )
        for i in (1, 2, 3)
    ]  # fmt: skip
    hand = Pose(rotate(Z, 0.25) @ rotate(X, 1.2), Vector(0.9, 0.0, height))
    limb = Limb("arm", "arm", "link_3", "hand", hand, chain)
    return machine(links, rows, limbs=(limb,), home=(0.4, 0.7, -0.3))


def spherical_wrist(center: tuple[float, float, float] = (0.3, -0.1, 0.2)) -> Robot:
    """Roll, pitch, roll axes through one point, where the hand's frame is; its chain is spherical."""
    names = ["base", "link_1", "link_2", "link_3"]
    links = [Link(name, 0, Vector(0, 0, 0), Inertia(0, 0, 0), IDENTITY) for name in names]
    axes = (Vector(1, 0, 0), Vector(0, 1, 0), Vector(1, 0, 0))
    rows = [
        Joint(
            f"joint_{i}", names[i - 1], names[i], "revolute",
            Screw(axes[i - 1], Vector(*center)), -3.0, 3.0, 5.0, 5.0,
        )
        for i in (1, 2, 3)
    ]  # fmt: skip
    hand = Pose(Rotation(Vector(0, 1, 0), Vector(0, 0, 1), Vector(1, 0, 0)), Vector(*center))
    limb = Limb("arm", "arm", "link_3", "hand", hand, ("rx", "ry", "rz"))
    return machine(links, rows, limbs=(limb,), home=(0.3, 0.9, -0.4))


@cache
def random_loops(seed: int, loops: int, base: str = "fixed", planar: bool = False) -> Robot:
    """So many loops at home, each of a chain that starts at a link and is joined to an earlier one.

    A chain has one joint more than closes its loop: seven in space, four where all axes are parallel.
    """
    rng = np.random.default_rng([seed, loops, planar])
    names, rows, pairs = ["base"], [], []
    for loop in range(loops):
        start, end = (names[rng.integers(len(names))] for _ in range(2)) if loop else ("base", "base")
        for _ in range(4 if planar else 7):
            i = len(names)
            kind = "revolute" if planar else str(rng.choice(TYPES))
            one = joint(rng, i, start, kind)
            if planar:
                one = replace(one, screw=Screw(Vector(0, 0, 1), point(rng, 0.5)))
            rows.append(one)
            names.append(start := one.child)
        pairs.append((start, end))
    links = [body(rng, name) for name in names]
    links[0] = replace(links[0], frame=IDENTITY)
    return closed(machine(links, rows, base, home=rng.uniform(-0.8, 0.8, len(rows))), pairs, seed)


def heavy_four_bar(**lengths: float) -> Robot:
    """The bundled four-bar with bars that weigh."""
    bars = {
        "crank": (0.2, "crank/2", 0.06),
        "coupler": (0.5, "crank + coupler/2", 0.18),
        "rocker": (0.4, "ground + rocker/2", 0.14),
    }
    text = Path(find_robot("linkages/four-bar")).read_text(encoding="utf-8")
    for name, (mass, x, length) in bars.items():
        bare = f'[[link]]\nname = "{name}"\nmass = 0\n'
        assert bare in text
        heavy = f'[[link]]\nname = "{name}"\nmass = {mass}\ncom = ["{x}", 0, 0]\n'
        text = text.replace(bare, f"{heavy}inertia = {{ box = [{length}, 0.01, 0.01] }}\n")
    return Robot.from_text(text).replace(**lengths)
