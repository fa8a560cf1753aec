"""Whole-body positions of a batch, with a status for every limb."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.pytrees import pytree
from screwkin.errors import LimitError, SingularError, UnreachableError
from screwkin.kinematics.limits import limited_joints
from screwkin.kinematics.status import Status
from screwkin.model.robot import Joint, Robot
from screwkin.model.state import State


@dataclass(frozen=True, eq=False)
@pytree("limbs")
class PoseSolution:
    """Positions of a batch, with a status for every limb.

    Attributes:
        state: T_world_base (..., 4, 4) and q (..., n).
        limbs: names of the limbs that had a target.
        status: (..., limbs) ``Status`` values.
        residual: (..., limbs) closure error [m and rad, norm].
        distance: (..., limbs) how far the tip is from its target [m].
        angle: (..., limbs) how far it is turned from its target [rad]; 0 for a position-only target.
        iterations: (..., limbs).
        worst_joint: (..., limbs) index of the joint furthest beyond its limits.
    """

    state: State
    limbs: tuple[str, ...]
    status: Array
    residual: Array
    distance: Array
    angle: Array
    iterations: Array
    worst_joint: Array

    @property
    def ok(self) -> bool:
        """Every limb of every sample converged."""
        return bool((self.status == Status.CONVERGED).all())

    def raise_on_failure(self, robot: Robot, time: Array | None = None) -> None:
        """Raise for the first sample that did not converge, naming limb, sample and how far.

        Raises:
            UnreachableError, SingularError, LimitError: as the status says.
        """
        if self.ok:
            return
        failed = np.argwhere(self.status.reshape(-1, len(self.limbs)) != Status.CONVERGED)
        sample, limb = (int(i) for i in failed[0])
        flat = {
            name: getattr(self, name).reshape(-1, len(self.limbs))
            for name in ("status", "distance", "angle", "worst_joint")
        }
        status, name = Status(int(flat["status"][sample, limb])), self.limbs[limb]
        where = f"{name}, sample {sample}" + ("" if time is None else f" (t = {float(time[sample]):.3f} s)")
        more = f"; {len(failed)} of {flat['status'].size} limb positions fail" if len(failed) > 1 else ""
        if status is Status.UNREACHABLE:
            far, turned = float(flat["distance"][sample, limb]), float(flat["angle"][sample, limb])
            by = f"{1e3 * far:.3g} mm" + (f" and {np.degrees(turned):.2g} deg" if turned > 1e-9 else "")
            raise UnreachableError(f"{where}: out of reach by {by}; {status.help}{more}", name, sample, far)
        if status is Status.SINGULAR:
            raise SingularError(f"{where}: singular; {status.help}{more}", name, sample)
        worst = int(flat["worst_joint"][sample, limb])
        q = float(np.reshape(self.state.q, (-1, len(robot.joints)))[sample, worst])
        message = f"{where}: {_beyond(limited_joints(robot)[worst], q)}; {status.help}{more}"
        raise LimitError(message, name, sample)


def _beyond(joint: Joint, q: float) -> str:
    """A joint's position and limits, in degrees or millimetres."""
    factor, unit = (1e3, "mm") if joint.type == "prismatic" else (180 / np.pi, "deg")
    lower, upper = factor * joint.lower, factor * joint.upper
    return f"{joint.name} at {factor * q:.1f} {unit}, limits {lower:.1f} to {upper:.1f} {unit}"
