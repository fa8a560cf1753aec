"""How far a swinging tip sinks under the robot's weight, all over its workspace, in single support.

The stance leg stands still in a posture of its own; the swing leg takes every place of its workspace.

Source: paper B, section 4 and its appendix.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.analysis.workspace import WorkspaceMap
from screwkin.compliance.springs import StiffnessChoice, joint_stiffness
from screwkin.compliance.stiffness import Method, static_deflection
from screwkin.errors import InputError
from screwkin.model.robot import Robot
from screwkin.model.state import State

BLOCK = 65_536
"""Points computed together, between two calls of ``progress``."""


@dataclass(frozen=True, eq=False)
class DeflectionMap:
    """Deflection of a tip over its workspace at one height.

    Attributes:
        place: the workspace, with its grid.
        support: tip that stands still.
        method: linear or nonlinear.
        joint_names: of all joints.
        stiffness: (n,) theirs [N m/rad].
        change: (X, Y, 6) rotation vector [rad] and translation [m] of the swinging tip, axes of the unloaded
            waist; NaN where it is not reachable or where the joints are too soft for any equilibrium.
        base_change: (X, Y, 6) of the waist.
    """

    place: WorkspaceMap
    support: str
    method: Method
    joint_names: tuple[str, ...]
    stiffness: Array
    change: Array
    base_change: Array

    @property
    def translation(self) -> Array:
        """Deflection (X, Y, 3) of the tip [m]."""
        return self.change[..., 3:]

    @property
    def magnitude(self) -> Array:
        """Length (X, Y) of the deflection [m]."""
        return np.linalg.norm(self.translation, axis=-1)

    @property
    def common_stiffness(self) -> float | None:
        """The stiffness if all joints have the same, else None."""
        first = float(self.stiffness[0])
        return first if (self.stiffness == first).all() else None

    def summary(self) -> dict[str, Any]:
        """Median, largest and ranges of the deflection [mm], samples that collapse; and at unit stiffness.

        ``unit_`` values are times the stiffness [mm N m/rad], which does not change them to first order; None
        for the equilibrium, or where joints differ.
        """
        length = 1e3 * self.magnitude[np.isfinite(self.magnitude)]
        none = not len(length)
        middle, most = (np.nan, np.nan) if none else (float(np.median(length)), float(length.max()))
        summary: dict[str, Any] = {"median_mm": middle, "max_mm": most}
        for k, axis in enumerate("xyz"):
            values = 1e3 * self.translation[..., k]
            summary[f"{axis}_mm"] = (
                [np.nan] * 2 if none else [float(np.nanmin(values)), float(np.nanmax(values))]
            )
        summary["collapsed"] = int((self.place.reachable & np.isnan(self.magnitude)).sum())
        unit = self.common_stiffness if self.method == "linear" else None
        summary["unit_median"] = None if unit is None else middle * unit
        summary["unit_max"] = None if unit is None else most * unit
        return summary


def other_leg(robot: Robot, limb: str) -> str:
    """Tip of the first leg that is not this limb.

    Raises:
        InputError: there is none to stand on.
    """
    own = robot.limb(limb).name
    for candidate in robot.limbs:
        if candidate.kind == "leg" and candidate.name != own:
            return candidate.tip
    raise InputError(f"{robot.name} has no leg but {own} to stand on; name a support")


def stiffness_maps(
    robot: Robot,
    places: Sequence[WorkspaceMap],
    stiffness: StiffnessChoice = None,
    method: Method = "linear",
    support: str | None = None,
    posture: str | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> list[DeflectionMap]:
    """Deflection of a tip all over its workspace, while another tip stands still.

    Args:
        robot: n joints; upright where nothing deflects.
        places: maps of the swinging limb's workspace.
        stiffness: see ``joint_stiffness``.
        method: linear, or nonlinear (the true equilibrium).
        support: tip that stands still; default: the other leg's.
        posture: of all other joints, by name; default: the zero pose, as in paper B.
        progress: called with the share done.

    Raises:
        InputError, UnknownNameError: support, posture or stiffness is wrong.
    """
    k = joint_stiffness(robot, stiffness)
    by_name = dict(zip(robot.joint_names, k.tolist(), strict=True))
    q = np.zeros(len(robot.joints)) if posture is None else np.array(robot.posture(posture).q, dtype=float)
    maps = []
    for number, place in enumerate(places):
        limb = robot.limb(place.limb)
        stand = other_leg(robot, place.limb) if support is None else support
        if robot.frame(stand)[0] == limb.link:
            raise InputError(f"{stand} cannot support the robot and be moved about; name another support")
        own = list(robot.path_to(limb.link))
        rows, columns = np.nonzero(place.reachable)
        change = np.full((*place.cause.shape, 2, 6), np.nan)
        for begin in range(0, len(rows), BLOCK):
            here = rows[begin : begin + BLOCK], columns[begin : begin + BLOCK]
            posed = np.tile(q, (len(here[0]), 1))
            posed[:, own] = place.q[here]
            bent = static_deflection(robot, State(np.eye(4), posed), stand, by_name, method)
            both = np.stack([bent.of(limb.tip), bent.of("base")], axis=1)
            # To first order springs of any stiffness bend, and only scale; an equilibrium must also last.
            lasting = bent.converged & (bent.stable | (method == "linear"))
            change[here] = np.where(lasting[:, None, None], both, np.nan)
            progress((number + (begin + len(posed)) / len(rows)) / len(places))
        maps.append(DeflectionMap(place, stand, method, robot.joint_names, k, *np.moveaxis(change, -2, 0)))
    return maps
