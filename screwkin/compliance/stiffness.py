"""Elastic joints and links: how a robot deflects under its weight and loads (virtual joint method).

Every joint is a rigid drive q followed by a spring with deflection theta, the virtual joint; a link that
bends has six. The robot stands on one frame; its weight bends the springs until they carry it: k theta +
gravity torques = 0. Single support needs no chains of its own: the stance leg's springs carry all that stands
on them, force and moment, and their deflection moves pelvis and swing leg rigidly, because the tree is walked
from the support. What else holds the robot, as its second foot, is a constraint with a wrench of its own.

Source: paper B, section 4, eq. 12-16; docs/papers.md says how they are read.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.pytrees import pytree
from screwkin.compliance.balance import Loaded
from screwkin.compliance.deflection import frames
from screwkin.compliance.elastic import TURNS_FIRST, elastic
from screwkin.compliance.equilibrium import SETTLED, Deflected, balances, equilibrium, first_order
from screwkin.compliance.laws import Spring, checked_springs, refuse_beyond, spring_effort
from screwkin.compliance.springs import SpringChoice, spring_stiffness
from screwkin.errors import InputError, NoSolutionError, ShapeError, UnknownNameError, one_of
from screwkin.kinematics.arrays import one_batch
from screwkin.kinematics.body import center_of_mass, frame_pose
from screwkin.kinematics.mass import GRAVITY
from screwkin.mechanism.loads import sorted_loads
from screwkin.model.robot import Robot
from screwkin.model.state import State

Method = Literal["linear", "nonlinear"]


@dataclass(frozen=True, eq=False)
@pytree("frames", "method", "supports", "bending")
class Deflection:
    """How a robot deflects under its weight and loads; B stands for any leading dimensions.

    Attributes:
        frames: ``base`` and the tips, the order of ``change``.
        method: linear or nonlinear.
        supports: frames that stand still, the order of ``wrenches``.
        bending: links with a spring, the order of ``links``.
        theta: (B, n) deflection of each joint: it stands at q + theta [rad or m].
        torque: (B, n) of the springs on the joints [N m or N]: -k theta.
        state: base and joints of the deflected robot; its support stands where it stood. Where links bend,
            frames lie where ``change`` says, and not where these joints would take rigid links.
        change: (B, frames, 6) rotation vector [rad] and translation of the frame's origin [m], world axes;
            to first order for the linear method.
        links: (B, bending, 6) rotations [rad] about x, y, z and translations [m] of the springs in links.
        wrenches: (B, supports, 6) of the ground on each support [m about its origin; f], world axes.
        residual: (B,) norm of theta + torque / k at the deflected posture, 0 in equilibrium.
        iterations: (B,) Newton steps; 0 for the linear method.
        stable: (B,) bool: springs and weight together resist every further deflection; for the linear method
            as they do at the commanded posture.

    Where ``converged`` is False there is no equilibrium: theta and what follows from it are the last ones
    that were tried.
    """

    frames: tuple[str, ...]
    method: Method
    supports: tuple[str, ...]
    bending: tuple[str, ...]
    theta: Array
    torque: Array
    state: State
    change: Array
    links: Array
    wrenches: Array
    residual: Array
    iterations: Array
    stable: Array

    def of(self, frame: str) -> Array:
        """Change (B, 6) of one frame."""
        if frame not in self.frames:
            raise UnknownNameError("frame", frame, self.frames)
        return self.change[..., self.frames.index(frame), :]

    @property
    def converged(self) -> Array:
        """(B,) bool: equilibrium reached; for the linear method, which seeks none, a finite residual."""
        return (self.residual <= SETTLED) if self.method == "nonlinear" else np.isfinite(self.residual)

    def raise_on_failure(self) -> None:
        """Raise for the first sample without a stable equilibrium.

        Raises:
            NoSolutionError: the springs are too soft for what loads them.
        """
        bad = np.flatnonzero(~(self.converged & self.stable))
        if len(bad):
            raise NoSolutionError(
                f"sample {bad[0]}: no stable equilibrium; {len(bad)} of {self.converged.size} samples "
                "collapse. The joints are too soft for the robot's weight and loads; raise the stiffness"
            )


def static_deflection(
    robot: Robot,
    state: State,
    support: str | Sequence[str],
    stiffness: SpringChoice = None,
    method: Method = "nonlinear",
    gravity: float = GRAVITY,
    *,
    loads: Mapping[str, Any] | None = None,
    springs: Mapping[str, Spring] | None = None,
) -> Deflection:
    """Deflection of elastic joints and links under weight and loads while frames stand still.

    Args:
        robot: n joints; of its links those with a ``spring`` bend.
        state: the commanded configuration, T_world_base (..., 4, 4) and q (..., n), closed.
        support: the frame that stands still: a foot's tip, a link, or ``base``; or several that do, such as
            both feet, where the state has them.
        stiffness: of the joints [N m/rad or N/m]: one number, or by name with ``default``, an array (...)
            where it changes along the batch; default: the table's. Joints without a motor are free unless
            they are named, or have a spring of their own in the table.
        method: ``linear`` takes the forces at the commanded posture; ``nonlinear`` solves for the posture
            where all forces are in balance, by Newton's method from the commanded one.
        gravity: [m/s^2], along -z of the world.
        loads: by name of a link, tip or frame: a force (..., 3) at its origin [N], or a wrench (..., 6) [m
            about the world's origin; f] at the commanded posture, world axes: it goes along with the frame,
            as a weight does. By name of a joint: an effort (...) [N m or N].
        springs: by joint name, laws in place of a stiffness: tables of (deflection, effort), or functions of
            deflections (...) that return efforts (...) and their slopes (...).

    Returns:
        Deflection; its ``converged`` and ``stable`` mark samples that collapse.

    Raises:
        InputError: stiffness, springs or method are wrong, or nothing loads the robot.
        ShapeError: wrong shape, or NaN.
        UnknownNameError: no such frame or joint.
        LimitError: a deflection beyond the end of a spring's table.

    Example:
        >>> import screwkin as sk
        >>> robot = sk.load_robot(sk.robot_names()[0])
        >>> feet = [limb.tip for limb in robot.limbs if limb.kind == "leg"]
        >>> pushed = sk.static_deflection(robot, sk.home(robot), feet, 20.0, loads={"base": [5, 0, 0]})
        >>> pushed.raise_on_failure()
        >>> bool(pushed.of("base")[3] > 0.001), round(float(pushed.wrenches[:, 3].sum()), 9)
        (True, -5.0)

    Source: paper B, eq. 13 (given the load, find theta) and eq. 16 with the links' weights added; Klimchik,
    Chablat and Pashkevich (2014) for loads, closed loops and links.
    """
    one_of("method", method, ("linear", "nonlinear"))
    loaded, supports, batch = loaded_robot(robot, state, support, stiffness, gravity, loads, springs)
    if not (gravity and robot.mass > 0) and not loaded.loads and loaded.efforts is None:
        raise InputError(f"{robot.name} has no mass and no loads, so that nothing bends it; give it one")
    solved = first_order(loaded) if method == "linear" else equilibrium(loaded)
    n = len(robot.joints)
    deflection = Deflection(
        frames(robot),
        method,
        supports,
        elastic(robot).bending,
        solved.theta[:, :n].reshape(*batch, n),
        -_efforts(loaded, solved.theta)[:, :n].reshape(*batch, n),
        State(solved.T_world_base.reshape(*batch, 4, 4), (loaded.q + solved.theta)[:, :n].reshape(*batch, n)),
        solved.change.reshape(*batch, *solved.change.shape[1:]),
        solved.theta[:, n:].reshape(*batch, -1, 6)[..., TURNS_FIRST],
        support_wrenches(loaded, solved, supports).reshape(*batch, -1, 6),
        solved.residual.reshape(batch),
        solved.iterations.reshape(batch),
        solved.stable.reshape(batch),
    )
    for i, law in loaded.laws.items():
        if not callable(law):
            refuse_beyond(
                robot.joint_names[i], law[:, 0], deflection.theta[..., i][deflection.converged], "yields by"
            )
    return deflection


def _efforts(loaded: Loaded, theta: Array) -> Array:
    """Efforts (B, n) of the joints' springs, and of nothing behind them."""
    efforts = loaded.stiffness * theta
    for i, law in loaded.laws.items():
        efforts[:, i] = spring_effort(law, theta[:, i])[0]
    return np.asarray(efforts)


def loaded_robot(
    robot: Robot,
    state: State,
    support: str | Sequence[str],
    stiffness: SpringChoice,
    gravity: float,
    loads: Mapping[str, Any] | None,
    springs: Mapping[str, Spring] | None,
) -> tuple[Loaded, tuple[str, ...], tuple[int, ...]]:
    """What the arguments of ``static_deflection`` stand for, checked; names of the supports; the batch."""
    laws = checked_springs(robot, springs)
    k = spring_stiffness(robot, stiffness, [robot.joint_names[i] for i in laws])
    bodily, efforts = sorted_loads(robot, loads or {})
    supports = (support,) if isinstance(support, str) else tuple(support)
    for name in supports:
        robot.frame(name)
    if not supports or len(set(supports)) < len(supports):
        raise InputError(f"support is {support!r}; name one frame that stands still, or several, each once")
    given = {f"loads[{name!r}]": (x, 1) for name, x in bodily.items()}
    given |= {f"loads[{name!r}]": (x, 0) for name, x in efforts.items()}
    T, q, batch = _flat(robot, state, {"stiffness": (k, 1), **given})
    model = elastic(robot)
    n, added = len(robot.joints), 6 * len(model.bending)
    at_rest = {name: _at_frame(robot, State(T, q), name, _flat_rows(x, batch)) for name, x in bodily.items()}
    own, relaxed = _own_springs(robot, q, {*laws, *(stiffness if isinstance(stiffness, Mapping) else ())})
    k, pushed = k + own, None
    if efforts or relaxed.any():
        pushed = np.pad(relaxed, [(0, 0), (0, added)])
        for name, effort in efforts.items():
            pushed[:, robot.joint_names.index(name)] += np.broadcast_to(effort, batch).reshape(-1)
    loaded = Loaded(
        model.robot,
        supports[0],
        T,
        np.concatenate([q, np.zeros((len(q), added))], axis=1),
        np.pad(k if k.ndim == 1 else _flat_rows(k, batch), [*[(0, 0)] * (k.ndim > 1), (0, added)]),
        gravity,
        laws,
        {n + 6 * i: K for i, K in enumerate(model.stiffness)},
        at_rest,
        pushed,
        (*((name, None) for name in supports[1:]), *model.loops),
    )
    return loaded, supports, batch


def _own_springs(robot: Robot, q: Array, others: set[int | str]) -> tuple[Array, Array]:
    """Stiffness (n,) of springs that the table gives to passive joints; their efforts (B, n) as commanded.

    A joint that is asked about by its name, or by its index as one with a law, has no other spring.
    """
    k = np.array(
        [0.0 if {i, one.name} & others else one.stiffness for i, one in enumerate(robot.joints)], dtype=float
    )
    return k, k * (np.array([joint.rest for joint in robot.joints]) - q)


def _at_frame(robot: Robot, state: State, name: str, load: Array) -> Array:
    """A load as [m about the frame's origin; f] (B, 6)."""
    if load.shape[-1] == 3:
        return np.concatenate([np.zeros(load.shape), load], axis=-1)
    p = frame_pose(robot, state, name)[..., :3, 3]
    return np.concatenate([load[..., :3] - np.cross(p, load[..., 3:]), load[..., 3:]], axis=-1)


def support_wrenches(loaded: Loaded, solved: Deflected, supports: Sequence[str]) -> Array:
    """Wrenches (B, supports, 6) of the ground [m about the support's origin; f], world axes."""
    robot, state = loaded.robot, State(solved.T_world_base, loaded.q + solved.theta)
    grounded = [(k, frame) for k, (frame, other) in enumerate(loaded.held) if not isinstance(other, str)]
    held = np.zeros((len(state.q), len(loaded.held), 6))
    if grounded:
        for rows, here in balances(loaded, solved.theta):
            held[rows] = here.wrenches
    wrenches = np.concatenate([np.zeros((len(state.q), 1, 6)), held[:, : len(supports) - 1]], axis=1)
    places = {*supports, *loaded.loads, *(frame for _, frame in grounded)}
    origin = {name: frame_pose(robot, state, name)[:, :3, 3] for name in places}
    others = [(origin[frame], held[:, k]) for k, frame in grounded]
    others += [(origin[name], load) for name, load in loaded.loads.items()]
    if loaded.gravity and robot.mass:
        weight = np.zeros((len(state.q), 6))
        weight[:, 5] = -loaded.gravity * robot.mass
        others.append((center_of_mass(robot, state), weight))
    for p, wrench in others:
        arm = p - origin[supports[0]]
        wrenches[:, 0, :3] -= wrench[:, :3] + np.cross(arm, wrench[:, 3:])
        wrenches[:, 0, 3:] -= wrench[:, 3:]
    return wrenches


def _flat(
    robot: Robot, state: State, others: Mapping[str, tuple[Array, int]]
) -> tuple[Array, Array, tuple[int, ...]]:
    """Base poses (B, 4, 4), positions (B, n) and the batch's shape of a checked state and of other arrays."""
    T, q = np.asarray(state.T_world_base, dtype=float), np.asarray(state.q, dtype=float)
    n = len(robot.joints)
    if T.shape[-2:] != (4, 4) or q.shape[-1:] != (n,):
        raise ShapeError(f"state has shapes {T.shape} and {q.shape}, expected (..., 4, 4) and (..., {n})")
    if not (np.isfinite(T).all() and np.isfinite(q).all()):
        raise ShapeError("state holds NaN or infinity; every number must be finite")
    batch = one_batch({"T_world_base": (T, 2), "q": (q, 1), **others})
    return np.broadcast_to(T, (*batch, 4, 4)).reshape(-1, 4, 4), _flat_rows(q, batch), batch


def _flat_rows(x: Array, batch: tuple[int, ...]) -> Array:
    """(B, k) of an array (..., k)."""
    return np.broadcast_to(x, (*batch, x.shape[-1])).reshape(-1, x.shape[-1])
