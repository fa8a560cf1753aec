"""Which soles carry the weight in a preview gait, and how far these lean sideways.

A leg without a roll axis at its ankle cannot keep its sole level against its shank. A rigid sole that leans
stands on its edge, wherever in it the ZMP was planned, and the robot tips about that edge until the sole is
level. So it is the sole with the weight that a plan keeps level, and the other one that leans.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.scalar import Scalar
from screwkin.algebra.se3 import Vector, as_array, cross, pose_from_array, twist_from_array, unstack
from screwkin.dynamics.newton_euler import Bodies, link_accelerations, link_twists
from screwkin.gait.footsteps import swing_side
from screwkin.gait.motion import Motion
from screwkin.gait.plan import Plan
from screwkin.gait.realise import free_rotations
from screwkin.gait.record import Gait
from screwkin.gait.stance import Stance
from screwkin.mechanism.mechanism import Mechanism
from screwkin.model.robot import Robot


def supports(gait: Gait, stance: Stance, steps: int) -> list[tuple[float, str, int | None]]:
    """When the weight begins to go to a foot [phases], that foot, "" for both, and the swing meanwhile.

    Before the first swing of a waist that leans it goes to the foot that swings, and after the last one to
    the foot that swung, for half a phase: so the first lean is no larger than the next ones.

    Args:
        gait: of kind ``preview`` or ``footsteps``.
        stance: feet of the robot.
        steps: number of swings.
    """
    swinging = [stance.foot(swing_side(gait, n)).name for n in range(steps)]
    standing = [stance.foot(-swing_side(gait, n)).name for n in range(steps)]
    alternate: list[tuple[float, str, int | None]] = [(n + 1.0, foot, n) for n, foot in enumerate(standing)]
    if gait.lateral != "lean":
        return [(0.0, "", None), *alternate, (steps + 1.0, "", None)]
    first, last = (0.5, swinging[0], None), (steps + 1.0, swinging[-1], None)
    return [(0.0, "", None), first, *alternate, last, (steps + 1.5, "", None)]


def bearing(mechanism: Mechanism, gait: Gait, stance: Stance, steps: int, time: Array) -> Motion | None:
    """Shares (T, feet) of the weight on the feet, by quintics in double support.

    None where soles need no such care: where the waist does not lean, or ankles roll.

    Args:
        mechanism: of a robot whose joints follow from base and tips.
        gait: of kind ``preview`` or ``footsteps``.
        stance: feet of the robot.
        steps: number of swings.
        time: (T,) since the first phase [s].
    """
    free, names = free_rotations(mechanism), [foot.name for foot in stance.feet]
    if gait.lateral != "lean" or not all("rx" in free.get(name, ()) for name in names):
        return None
    begins, feet, _ = zip(*supports(gait, stance, steps), strict=True)
    share = np.array([[float(foot == name) if foot else 0.5 for name in names] for foot in feet])
    phase = time / gait.Tc - (gait.numbers.get("stand", 1.0) - 1)
    number = np.maximum(np.searchsorted(begins, phase + 1e-9, side="right") - 1, 0)
    dsp = gait.numbers["dsp"]
    s = np.clip((phase - np.array(begins)[number]) / dsp, 0.0, 1.0)[:, None]
    before = share[np.maximum(number - 1, 0)]
    by, speed = share[number] - before, 1 / (dsp * gait.Tc)
    return Motion(
        before + by * s**3 * (10 - 15 * s + 6 * s**2),
        by * 30 * s**2 * (1 - s) ** 2 * speed,
        by * 60 * s * (1 - s) * (1 - 2 * s) * speed**2,
    )


def leans_of(robot: Robot, planned: Plan, q: Array, qd: Array, qdd: Array) -> Motion:
    """How far soles lean sideways, (T, feet), as sines, positive to the left; rates and accelerations.

    Args:
        robot: that follows the plan.
        planned: T samples of base motion; its order of feet.
        q: (T, n), with qd and qdd its derivatives.
        qd: (T, n).
        qdd: (T, n).
    """
    bodies = Bodies.of(robot, pose_from_array(planned.T_world_base).R, unstack(q))
    rates: list[Scalar] = unstack(qd)
    twists = link_twists(bodies, rates, twist_from_array(planned.base_twist))
    base = twist_from_array(planned.base_acceleration)
    pushed = link_accelerations(bodies, twists, rates, unstack(qdd), base)
    columns = []
    for foot in planned.feet:
        limb = robot.limb(foot)
        left = bodies.poses[robot.link_names.index(limb.link)].R @ limb.frame.R.y
        omega, alpha = twists[limb.link].omega, pushed[limb.link].omega
        speed = cross(omega, left)
        parts = left.z, speed.z, (cross(alpha, left) + cross(omega, speed)).z
        columns.append(as_array(Vector(*parts), (len(q),)))
    return Motion(*np.stack(columns, axis=1).transpose(2, 0, 1))


def borne(leans: Motion, shares: Motion) -> Motion:
    """Sum (T,) of what every foot does (T, feet), each by its share of the weight."""
    x, v, a = leans.value, leans.rate, leans.acceleration
    w, dw, ddw = shares.value, shares.rate, shares.acceleration
    return Motion(
        (w * x).sum(axis=1), (dw * x + w * v).sum(axis=1), (ddw * x + 2 * dw * v + w * a).sum(axis=1)
    )


def on_inner_edges(planned: Plan, level: Plan, stance: Stance, leans: Motion) -> Plan:
    """The plan with the inner edges of soles, which lean inwards if they lean, as high as level soles are.

    Args:
        planned: T samples.
        level: the same feet, as if their soles did not lean.
        stance: soles of the robot.
        leans: (T, feet) of the soles, as sines.
    """
    poses, twists, pushed = dict(level.T_world_tip), dict(level.tip_twist), dict(level.tip_acceleration)
    for k, name in enumerate(planned.feet):
        foot = next(foot for foot in stance.feet if foot.name == name)
        inner = foot.side * min(foot.side * y for _, y in foot.sole)
        for arrays, at, lean in (
            (poses, (slice(None), 2, 3), leans.value),
            (twists, (slice(None), 5), leans.rate),
            (pushed, (slice(None), 5), leans.acceleration),
        ):
            arrays[name] = arrays[name].copy()
            arrays[name][at] -= inner * lean[:, k]
    return replace(planned, T_world_tip=poses, tip_twist=twists, tip_acceleration=pushed)
