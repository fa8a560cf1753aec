"""What carries a robot, and what its joints do about it, along any motion: ``contact_forces``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.scalar import is_jax, is_traced
from screwkin.algebra.se3 import as_array
from screwkin.dynamics.contact import ContactPatch, contact_distribution, contact_points, standing
from screwkin.dynamics.friction import Grip, limited, pyramids
from screwkin.errors import InputError, NoSolutionError, ShapeError, UnknownNameError, expect
from screwkin.kinematics.body import frame_pose
from screwkin.kinematics.mass import GRAVITY
from screwkin.mechanism.holds import on_floor
from screwkin.model.robot import Robot
from screwkin.model.state import State

SPREAD = 1e-9
"""Spread of the points in contact below which they are in line: they cannot bear every moment."""

Contacts = Iterable[str | ContactPatch] | Mapping[str | ContactPatch, Any]


@dataclass(frozen=True, eq=False)
class ContactForces:
    """Wrenches of contacts and joint efforts of a batch of motions.

    Attributes:
        tips: names of the tips, in the order of wrenches.
        wrenches: (..., tips, 6): [m; f] on each tip about its origin, world axes [N m, N].
        efforts: (..., n) [N m or N], in table order.
    """

    tips: tuple[str, ...]
    wrenches: Array
    efforts: Array

    def __getitem__(self, tip: str) -> Array:
        """The wrench (..., 6) on a tip."""
        if tip not in self.tips:
            raise UnknownNameError("tip in contact", tip, self.tips)
        return self.wrenches[..., self.tips.index(tip), :]


def contact_forces(
    robot: Robot,
    state: State,
    qd: Any,
    qdd: Any,
    contacts: Contacts | None = None,
    internal: Mapping[str, Any] | None = None,
    base_twist: Any = None,
    base_acceleration: Any = None,
    *,
    friction: float | None = None,
    gravity: float = GRAVITY,
    actuated: tuple[str, ...] | None = None,
) -> ContactForces:
    """Wrenches of feet and hands, and joint efforts, that a motion needs.

    The total is what Newton-Euler asks for. It is shared out so that the sum of the squares of the forces at
    the contacts' points (the corners of soles) is least, or nearest to wrenches of your choice. With friction
    the points push only, within friction, so that every centre of pressure lies inside its sole.

    Args:
        robot: n joints, with masses and a floating base.
        state: T_world_base (..., 4, 4) and q (..., n) [m, rad]; closed, where the robot has loops of its own.
        qd: joint rates (..., n) [rad/s or m/s].
        qdd: joint accelerations (..., n) [rad/s^2 or m/s^2].
        contacts: tips that are in contact, by name or as ``ContactPatch``; or a mapping from these to weights
            (...,): flags, or numbers, of which twice as much takes twice the load; default: all soles.
        internal: wrenches (..., 6) by tip [m; f], about the tip's origin, world axes [N m, N]: the
            distribution nearest to them is taken. They choose the internal forces; what contradicts the
            motion is changed.
        base_twist: (..., 6) [omega; v of the base origin], world axes; default: zero.
        base_acceleration: (..., 6) its time derivative; default: zero.
        friction: coefficient of friction of all contacts with a sole that name none of their own; default: no
            limits, so that the floor may pull too.
        gravity: [m/s^2], along -z of the world.
        actuated: joints that have motors, as for ``inverse_dynamics``.

    Returns:
        ContactForces; of JAX arrays in JAX arrays, where friction is not asked for.

    Raises:
        InputError: a fixed base, no contacts, a tip twice, a negative weight; friction of JAX arrays; or no
            contact where a closure holds a tip on the floor.
        UnknownNameError: no such tip.
        NoSolutionError: a sample has no contacts, or they cannot supply what its motion needs.
        ShapeError: a wrong shape, NaN or infinity, or a base pose that is not rigid.

    Example:
        >>> import numpy as np
        >>> import screwkin as sk
        >>> robot, rest = sk.load_robot(sk.robot_names()[0]), np.zeros(18)
        >>> forces = sk.contact_forces(robot, sk.home(robot), rest, rest)
        >>> float(round(forces.wrenches[:, 5].sum(), 3))           # both feet carry the weight
        16.677
    """
    expect(robot, Robot, "robot", 'load_robot("NAME")')
    expect(state, State, "state", "State(T_world_base, q)")
    chosen, weights = _chosen(robot, contacts)
    if friction is not None:
        soled = {robot.limb(sole.limb).tip for sole in robot.soles}
        own = {patch: patch.friction is None and patch.tip in soled for patch in chosen}
        chosen = tuple(replace(p, friction=float(friction)) if own[p] else p for p in chosen)
    rough = any(patch.friction is not None for patch in chosen)
    unlimited = tuple(replace(patch, friction=None) for patch in chosen)
    zero = np.zeros(6)
    motion = {
        "qd": qd,
        "qdd": qdd,
        "base_twist": zero if base_twist is None else base_twist,
        "base_acceleration": zero if base_acceleration is None else base_acceleration,
        "gravity": gravity,
        "patches": () if unlimited == standing(robot) else unlimited,
        "actuated": actuated,
    }
    by_tip = _weights(robot, chosen, weights)
    wished = _wished(robot, chosen, internal)
    shares: Any = contact_distribution(robot, state, weights=by_tip, internal=wished, **motion)
    if not is_traced(shares["spread"]):
        _refuse_unsupported(chosen, np.asarray(by_tip), shares["spread"][..., 0], robot)
    if rough and is_jax(shares["wrenches"]):
        raise InputError("contact_forces computes friction of NumPy arrays; leave it out, or give these")
    if rough:
        inside = _inside(robot, state, chosen, by_tip, shares["wrenches"])
        if (inside != shares["wrenches"]).any():
            every = np.zeros((*inside.shape[:-2], len(robot.limbs), 6))
            every[..., [robot.tip_names.index(patch.tip) for patch in chosen], :] = inside
            shares = contact_distribution(robot, state, weights=by_tip, internal=every, **motion)
    return ContactForces(tuple(patch.tip for patch in chosen), shares["wrenches"], shares["efforts"])


def _chosen(robot: Robot, contacts: Contacts | None) -> tuple[tuple[ContactPatch, ...], Sequence[Any]]:
    """The patches, checked, and their weights."""
    if contacts is None:
        contacts = standing(robot)
    if isinstance(contacts, str):
        raise InputError(f"contacts is the text {contacts!r}; give a list of tips, as [{contacts!r}]")
    pairs = dict(contacts) if isinstance(contacts, Mapping) else dict.fromkeys(contacts, 1.0)
    patches = []
    for named in pairs:
        patch = ContactPatch(named) if isinstance(named, str) else named
        expect(patch, ContactPatch, "a contact", "the name of a tip, or ContactPatch(tip, ...)")
        if patch.tip not in robot.tip_names:
            raise UnknownNameError("tip", patch.tip, robot.tip_names)
        patches.append(_checked(robot, patch))
    if not patches:
        raise InputError("no contacts; name the tips that carry the robot, as contacts=['right_foot']")
    tips = [patch.tip for patch in patches]
    if missing := [tip for tip in on_floor(robot) if tip not in tips]:
        raise InputError(
            f"closures hold {', '.join(missing)} of {robot.name} on the floor, which carries them too; name "
            "them in contacts, without a sole as ContactPatch(tip, points)"
        )
    if len(set(tips)) < len(tips):
        raise InputError(f"contacts names a tip twice: {', '.join(tips)}; give every tip one patch")
    return tuple(patches), list(pairs.values())


def _checked(robot: Robot, patch: ContactPatch) -> ContactPatch:
    """A patch of sound numbers, as a value that can be part of a program."""
    points: Any = tuple(tuple(float(x) for x in point) for point in patch.points)
    normal: Any = tuple(float(x) for x in patch.normal)
    sound = replace(patch, points=points, normal=normal)
    where = np.array(as_array(contact_points(robot, sound)), dtype=float)
    flat = len(where) > 1 and np.linalg.svd(where - where.mean(axis=0), compute_uv=False)[1] < 1e-9
    if any(len(point) != 3 for point in points) or not np.isfinite(where).all() or len(where) == 2 or flat:
        raise InputError(
            f"the points of {patch.tip}'s contact are {patch.points}; give one (x, y, z) or at least three "
            "that are not in line, in metres, in the frame of the tip"
        )
    if len(normal) != 3 or not abs(np.linalg.norm(normal) - 1) < 1e-6:
        raise InputError(f"the normal of {patch.tip}'s contact is {patch.normal}; give a unit vector")
    if patch.friction is not None and not 0 < patch.friction < np.inf:
        raise InputError(f"the friction of {patch.tip}'s contact is {patch.friction}; give a positive number")
    return sound


def _weights(robot: Robot, patches: Sequence[ContactPatch], weights: Sequence[Any]) -> Any:
    """Weights (..., tips) of all tips."""
    columns: list[Any] = [np.zeros(())] * len(robot.limbs)
    for patch, weight in zip(patches, weights, strict=True):
        column = weight if is_jax(weight) else np.asarray(weight, dtype=float)
        if not is_traced(column) and not (np.asarray(column) >= 0).all():
            raise InputError(f"a weight of {patch.tip} is negative or NaN; give flags or numbers from 0 on")
        columns[robot.tip_names.index(patch.tip)] = column
    if any(map(is_jax, columns)):
        import jax.numpy as jnp

        return jnp.stack(jnp.broadcast_arrays(*columns), axis=-1)
    return np.stack(np.broadcast_arrays(*columns), axis=-1)


def _wished(robot: Robot, patches: Sequence[ContactPatch], internal: Mapping[str, Any] | None) -> Any:
    """Wished wrenches (..., tips, 6) of all tips."""
    given = {} if internal is None else dict(internal)
    tips = tuple(patch.tip for patch in patches)
    rows: list[Any] = [np.zeros(6)] * len(robot.limbs)
    for tip, wrench in given.items():
        if tip not in tips:
            raise UnknownNameError("tip in contact", str(tip), tips)
        row = wrench if is_jax(wrench) else np.asarray(wrench, dtype=float)
        if np.shape(row)[-1:] != (6,):
            raise ShapeError(f"internal[{tip!r}] has shape {np.shape(row)}, expected (..., 6): [m; f]")
        patch = patches[tips.index(tip)]
        if len(contact_points(robot, patch)) == 1 and not is_jax(row) and _turns(robot, patch, row):
            raise InputError(
                f"internal[{tip!r}] has a moment, which a contact in one point cannot bear; give its patch "
                "at least three points, or the force alone"
            )
        rows[robot.tip_names.index(tip)] = row
    if any(map(is_jax, rows)):
        import jax.numpy as jnp

        return jnp.stack(jnp.broadcast_arrays(*rows), axis=-2)
    return np.stack(np.broadcast_arrays(*rows), axis=-2)


def _turns(robot: Robot, patch: ContactPatch, wrench: Array) -> bool:
    """Whether a wrench at a tip has a moment that no force in the tip itself has."""
    point = np.array(as_array(contact_points(robot, patch)[0]), dtype=float)
    return bool(not point.any() and np.abs(wrench[..., :3]).max(initial=0.0) > 0)


def _refuse_unsupported(patches: Sequence[ContactPatch], weights: Array, spread: Array, robot: Robot) -> None:
    """Raise for the first sample whose contacts cannot bear any wrench."""
    bad = ~(np.asarray(spread) > SPREAD)
    if not bad.any():
        return
    index = np.unravel_index(int(np.argmax(bad)), bad.shape)
    here = np.broadcast_to(weights, (*bad.shape, weights.shape[-1]))[index]
    on = [patch.tip for patch in patches if here[robot.tip_names.index(patch.tip)] > 0]
    where = f"sample {', '.join(str(int(i)) for i in index)}: " if index else ""
    if not on:
        raise NoSolutionError(f"{where}nothing is in contact, so nothing carries {robot.name}")
    raise NoSolutionError(
        f"{where}{', '.join(on)} touch in points that are in line and bear no moment about it; add "
        "a contact, or give a patch at least three points"
    )


def _inside(
    robot: Robot, state: State, patches: Sequence[ContactPatch], weights: Array, wrenches: Array
) -> Array:
    """The wrenches (..., contacts, 6) within friction nearest to given ones."""
    batch, places = wrenches.shape[:-2], [robot.tip_names.index(patch.tip) for patch in patches]
    poses = [
        np.broadcast_to(frame_pose(robot, state, patch.tip), (*batch, 4, 4)).reshape(-1, 4, 4)
        for patch in patches
    ]
    own = np.broadcast_to(weights[..., places], (*batch, len(places))).reshape(-1, len(places))
    grips = [_grip(robot, patch) for patch in patches]
    found, failing = limited(grips, poses, own, wrenches.reshape(-1, len(places), 6))
    if failing is not None:
        index = ", ".join(str(int(i)) for i in np.unravel_index(failing, batch)) if batch else ""
        raise NoSolutionError(
            f"{f'sample {index}: ' if batch else ''}no forces within friction at "
            f"{', '.join(patch.tip for patch in patches)} supply what the motion needs: it would slip, tip "
            "over or leave the floor"
        )
    return found.reshape(wrenches.shape)


def _grip(robot: Robot, patch: ContactPatch) -> Grip:
    points = np.array(as_array(contact_points(robot, patch)), dtype=float)
    limits = np.zeros((0, 3)) if patch.friction is None else pyramids(np.array(patch.normal), patch.friction)
    return Grip(points, limits)
