"""What a robot's own loops admit: rates of the joints that follow from those of the joints that drive.

The loops are a closed mechanism of their own, whose base rests and which has no virtual chains: its network
matrix N (Davies) says which joint rates go together. A formula solves it block by block, by least squares, so
that planar loops, which have more equations than unknowns, are loops like any other.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from screwkin.algebra.linear import Orthogonal, definite, product
from screwkin.algebra.scalar import Scalar, is_traced, plus, times
from screwkin.algebra.screws import at
from screwkin.algebra.se3 import (
    IDENTITY,
    NO_TWIST,
    ZERO,
    Twist,
    Vector,
    cross,
    norm,
    pose_from_array,
    unstack,
)
from screwkin.compiler.program import kept
from screwkin.errors import InputError, SingularError, one_of
from screwkin.mechanism.choice import RANK_TOLERANCE, closed_mechanism
from screwkin.mechanism.closure import closure_errors
from screwkin.mechanism.holds import refuse_on_floor
from screwkin.mechanism.least_values import least_values
from screwkin.mechanism.linkages import motor_joints
from screwkin.mechanism.mechanism import Mechanism
from screwkin.mechanism.network import coupling_twists, network_blocks, twist_rates
from screwkin.mechanism.rates import flat
from screwkin.mechanism.scaling import characteristic_length, weighed
from screwkin.mechanism.singularity import refuse_singular
from screwkin.model.robot import Robot
from screwkin.model.state import State, reference_posture

OPEN = 1e-6
"""Gap of a closure, in sizes of the robot, beyond which a state is not one of its closed mechanism."""


@kept
def loops_of(robot: Robot) -> Mechanism:
    """The loops of a robot alone: joints that drive are primary, joints that follow secondary.

    Raises:
        InputError: a closure is open at the home posture.
    """
    return closed_mechanism(
        replace(robot, base="fixed", limbs=(), soles=(), closures=robot.loops, text="", path="")
    )


def driving_joints(robot: Robot) -> tuple[str, ...]:
    """Names of the joints whose rates are independent, in table order: all but those that loops determine."""
    if not robot.loops:
        return robot.joint_names
    primary = set(loops_of(robot).primary)
    return tuple(name for name in robot.joint_names if name in primary)


@dataclass(frozen=True)
class Admitted:
    """Rates of all joints (n) per unit rate of each joint that drives (d), at one position.

    Attributes:
        driving: indices in q of the joints that drive.
        columns: d columns of n: the motions that N admits.
    """

    mechanism: Mechanism
    driving: list[int]
    columns: list[list[Scalar]]
    twists: list[Twist]
    systems: list[_Block]

    @classmethod
    def at(cls, robot: Robot, q: Sequence[Scalar]) -> Admitted:
        """The admitted motions at joint positions q."""
        mechanism = loops_of(robot)
        twists = coupling_twists(mechanism, IDENTITY, q)
        rows = network_blocks(mechanism, twists)
        systems = [_Block.of(mechanism, twists, rows, k) for k in range(len(mechanism.blocks))]
        driving = [robot.joint_names.index(name) for name in driving_joints(robot)]
        columns = []
        for j in driving:
            column: list[Scalar] = [0] * len(robot.joints)
            column[j] = 1
            place = mechanism.position[robot.joint_names[j]]
            for system in systems:
                wanted = system.equations([-rows[c][place] for c in system.circuits])
                _place(robot, column, system, wanted)
            columns.append(column)
        return cls(mechanism, driving, columns, twists, systems)

    def motion(
        self, robot: Robot, qd: Sequence[Scalar], qdd: Sequence[Scalar]
    ) -> tuple[list[Scalar], list[Scalar]]:
        """Rates and accelerations of all joints; of qd and qdd those of the joints that drive are read.

        N q'' = -N' q', with N' from the brackets of the screws.
        """
        rates = self.combined([qd[j] for j in self.driving])
        changes = self.combined([qdd[j] for j in self.driving])
        moving = self.along(robot, rates)
        for system in self.systems:
            bias = [_sum(-t * s for t, s in zip(moving, signs, strict=True) if s) for signs in system.signs]
            extra: list[Scalar] = [0] * len(rates)
            _place(robot, extra, system, system.equations(bias))
            changes = [plus(a, b) for a, b in zip(changes, extra, strict=True)]
        return rates, changes

    def along(self, robot: Robot, rates: Sequence[Scalar]) -> list[Twist]:
        """What the screws' own motion adds to the acceleration of every edge."""
        by_name = dict(zip(robot.joint_names, rates, strict=True))
        edges = [by_name[name] for name in self.mechanism.couplings]
        edges += [times(by_name[joint.leader], joint.ratio) for joint in robot.coupled]
        changing = twist_rates(self.mechanism, self.twists, edges)
        return [dS * rate for dS, rate in zip(changing, edges, strict=True)]

    def combined(self, values: Sequence[Scalar]) -> list[Scalar]:
        """Rates of all joints from those of the joints that drive."""
        return [product(row, values) for row in zip(*self.columns, strict=True)]

    def generalised(self, efforts: Sequence[Scalar]) -> list[Scalar]:
        """Efforts at the joints that drive which do the work of some at all joints (virtual power)."""
        return [product(column, efforts) for column in self.columns]

    def reduced(self, M: Sequence[Sequence[Scalar]]) -> list[list[Scalar]]:
        """Mass matrix for [base twist; rates of the joints that drive] from that for all joints."""
        columns = [[0] * k + [1] + [0] * (5 + len(self.columns[0]) - k) for k in range(6)]
        columns += [[0] * 6 + column for column in self.columns]
        momenta = [[product(row, column) for row in M] for column in columns]
        found: list[list[Scalar]] = [[0] * len(columns) for _ in columns]
        for i, column in enumerate(columns):
            for j in range(i + 1):
                found[i][j] = found[j][i] = product(column, momenta[j])
        return found

    def efforts(self, wanted: Sequence[Scalar], actuated: Sequence[int]) -> list[Scalar]:
        """Efforts of all joints, 0 but at those with motors, that do the work of some at those that drive.

        Where motors are more than the motions, the sum of the squares of their efforts is least.
        """
        efforts: list[Scalar] = [0] * len(self.columns[0]) if self.columns else []
        if list(actuated) == self.driving:
            values = list(wanted)
        else:
            shares = [[column[a] for a in actuated] for column in self.columns]
            power = definite([[product(a, b) for b in shares] for a in shares], wanted)
            values = [product(row, power) for row in zip(*shares, strict=True)]
        for a, value in zip(actuated, values, strict=True):
            efforts[a] = value
        return efforts


@dataclass(frozen=True)
class _Block:
    """One system of loops: its circuits with their points, its joints, and their screws made orthogonal."""

    circuits: list[int]
    signs: list[list[int]]
    names: list[str]
    points: list[Vector]
    length: float
    screws: Orthogonal

    @classmethod
    def of(
        cls, mechanism: Mechanism, twists: Sequence[Twist], rows: Sequence[Sequence[Twist]], k: int
    ) -> _Block:
        circuits, inside = mechanism.blocks[k]
        signs = [mechanism.circuit_matrix[c].tolist() for c in circuits]
        points = [_middle([t for t, s in zip(twists, own, strict=True) if s]) for own in signs]
        columns = [mechanism.secondary_columns[i] for i in inside]
        length = characteristic_length(mechanism.robot)
        names = [mechanism.couplings[c] for c in columns]
        block = cls(circuits, signs, names, points, length, Orthogonal([], [], 1))
        system = [block.equations([rows[c][column] for c in circuits]) for column in columns]
        return replace(block, screws=Orthogonal.of(system))

    def equations(self, twists: Sequence[Twist]) -> list[Scalar]:
        """Twists of every circuit, from the base origin to the circuit's point, velocities over the size."""
        moved = [at(point, twist) for point, twist in zip(self.points, twists, strict=True)]
        return [x for twist in moved for x in weighed(twist, self.length)]


def _place(robot: Robot, values: list[Scalar], system: _Block, wanted: Sequence[Scalar]) -> None:
    """Rates that follow, unless nothing is wanted of this system by its structure."""
    if any(type(x) is not int or x for x in wanted):
        for name, value in zip(system.names, system.screws.solve(wanted), strict=True):
            values[robot.joint_names.index(name)] = value


def _middle(twists: Iterable[Twist]) -> Vector:
    """A point amid some axes: the mean of those points on them that are nearest to the base origin."""
    points = [cross(t.omega, t.v) for t in twists if t.omega is not ZERO]
    return sum(points, ZERO) * (1 / len(points)) if points else ZERO


def _sum(twists: Iterable[Twist]) -> Twist:
    return sum(twists, NO_TWIST)


@kept
def actuated_joints(robot: Robot, names: tuple[str, ...] | None) -> tuple[int, ...]:
    """Indices in q of the joints that have motors, by default ``motor_joints``; and those on springs.

    Raises:
        UnknownNameError: no such joint. InputError: named twice, or too few for the motions.
        SingularError: at the home posture there is a motion that they cannot drive.
    """
    driving = driving_joints(robot)
    if names is None and robot.loops:
        names = motor_joints(robot)
    if names is None:
        return tuple(robot.joint_names.index(name) for name in driving)
    names = (*names, *(joint.name for joint in robot.joints if joint.stiffness and joint.name not in names))
    chosen = [one_of("joint", name, robot.joint_names) for name in names]
    if len(set(chosen)) < len(chosen):
        raise InputError("actuated names a joint twice; give every joint once")
    if len(chosen) < len(driving):
        raise InputError(
            f"{len(chosen)} actuated joints for {len(driving)} independent motions; those of "
            f"{', '.join(driving)} would do"
        )
    indices = tuple(robot.joint_names.index(name) for name in robot.joint_names if name in chosen)
    if robot.loops:
        motions = Admitted.at(robot, list(reference_posture(robot))).columns
        G = np.array(motions, dtype=float).T[list(indices)]
        if np.linalg.svd(G, compute_uv=False)[-1] < RANK_TOLERANCE:
            raise SingularError(
                f"{', '.join(chosen)} cannot drive every motion of {robot.name} at its home posture; those "
                f"of {', '.join(driving)} would do"
            )
    return indices


def refuse_held(robot: Robot, what: str) -> None:
    """Refuse a robot that closures hold on the floor where the floor's wrenches are not asked for.

    Raises:
        InputError: names the closures.
    """
    refuse_on_floor(robot, what, "contact_forces shares out the floor's wrenches, at rest static_forces does")


def refuse_loops(robot: Robot, state: State) -> None:
    """Refuse states at which a robot's own loops are open or singular; traced JAX arrays are not looked at.

    Raises:
        InputError: a closure is open. SingularError: joints that drive do not determine those that follow.
    """
    if not robot.loops or robot.is_symbolic or is_traced(state.q):
        return
    mechanism, q = loops_of(robot), np.asarray(state.q, dtype=float)
    q = q.reshape(-1, q.shape[-1])
    columns = dict(zip(robot.joint_names, unstack(q), strict=True))
    still = np.broadcast_to(np.eye(4), (len(q), 4, 4))
    gaps = closure_errors(mechanism, [columns[name] for name in mechanism.couplings], pose_from_array(still))
    for closure, gap in zip(robot.loops, gaps, strict=True):
        apart = np.asarray(norm(gap.omega)) + np.asarray(norm(gap.v)) / characteristic_length(robot)
        apart = np.broadcast_to(apart, len(q))
        if (apart > OPEN).any():
            sample = int(np.argmax(apart > OPEN))
            raise InputError(
                f"{robot.name}: closure {closure.name} is open in sample {sample}, by {apart[sample]:.3g} of "
                "the robot's size; close_loops closes it"
            )
    singular = least_values(mechanism, still, q) < RANK_TOLERANCE
    refuse_singular(mechanism, flat(still, 2, (len(q),)), q, singular)
