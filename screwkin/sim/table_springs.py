"""Springs and dampers of passive joints in the engines: their efforts, and steps that are too long for them.

MuJoCo has them; PyBullet takes their efforts at the start of a step, which is stable on an inertia I while
k dt^2 + 2 d dt < 4 I (semi-implicit Euler).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.dynamics.loops import Admitted
from screwkin.dynamics.quantities import mass_matrix
from screwkin.errors import InputError
from screwkin.model.robot import Robot
from screwkin.model.state import State, reference_posture


@dataclass(frozen=True, eq=False)
class TableSprings:
    """Of all joints in table order, each (n,): stiffness [N m/rad or N/m], rest [rad or m], damping."""

    stiffness: Array
    rest: Array
    damping: Array

    @classmethod
    def of(cls, robot: Robot) -> TableSprings:
        """Those of a robot's table."""
        rows = np.array([(j.stiffness, j.rest, j.damping) for j in robot.joints], float).reshape(-1, 3)
        return cls(*rows.T)

    def efforts(self, q: Array, qd: Array) -> Array:
        """Of springs and dampers on the joints (n,) at positions and rates (n,)."""
        return np.asarray(self.stiffness * (self.rest - q) - self.damping * qd)


def check_spring_steps(robot: Robot, dt: float) -> None:
    """Refuse a step in which a spring of the table would swing up what it moves.

    Raises:
        InputError: names the joint, and the longest step.
    """
    springs = TableSprings.of(robot)
    for i in np.flatnonzero((springs.stiffness > 0) | (springs.damping > 0)):
        k, d, inertia = springs.stiffness[i], springs.damping[i], _inertia_at(robot, int(i))
        if k * dt**2 + 2 * d * dt >= 4 * inertia:
            longest = (np.sqrt(d**2 + 4 * k * inertia) - d) / k if k else 2 * inertia / d
            raise InputError(
                f"{robot.name}: a step of {1e3 * dt:g} ms is too long for the spring of "
                f"{robot.joint_names[i]}, {k:g} and {d:g} on an inertia of {inertia:.3g}; take less than "
                f"{1e3 * longest:.3g} ms, or a softer spring"
            )


def _inertia_at(robot: Robot, joint: int) -> float:
    """What a joint moves [kg m^2 or kg] where all that loops leave free is free, at the reference posture."""
    held = () if not robot.closures else tuple(c for c in robot.closures if not c.on_floor)
    free = replace(robot.with_inertia_floor(), closures=held)
    q = np.array(reference_posture(free), float)
    M = mass_matrix(free, State(np.eye(4), q))
    row = (
        np.eye(len(q))[joint]
        if not free.loops
        else np.array(Admitted.at(free, q.tolist()).columns, float)[:, joint]
    )
    fixed = 6 if free.base == "fixed" else 0
    column = np.concatenate([np.zeros(6 - fixed), row])
    return float(1 / (column @ np.linalg.solve(M[fixed:, fixed:], column)))
