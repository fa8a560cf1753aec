"""``screwkin stiffness`` of one posture: how joints and links yield to loads, how stiff a frame is there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.cli.loads import first_posture, loads_of
from screwkin.cli.output import aligned, print_json, say
from screwkin.compliance.cartesian import cartesian_compliance, cartesian_stiffness
from screwkin.compliance.stiffness import Deflection, static_deflection
from screwkin.errors import SingularError
from screwkin.model.robot import Robot
from screwkin.model.state import State, home

AXES = ("x", "y", "z")


def stiffness_at(
    robot: Robot,
    posture: str | None,
    support: Sequence[str] | None,
    k: float | None,
    load: Sequence[str],
    frame: str | None,
    as_json: bool,
) -> int:
    """Loaded equilibrium and Cartesian stiffness in a posture, printed."""
    name = posture or first_posture(robot)
    state, supports, loads = home(robot, name), list(support or posture_standing(robot)), loads_of(load)
    deflection = static_deflection(robot, state, supports, k, loads=loads)
    deflection.raise_on_failure()
    seen = frame or next(x for x in (*deflection.frames, robot.link_names[-1]) if x not in supports)
    C = cartesian_compliance(robot, state, supports, seen, k, loads=loads)
    K = _stiffness(robot, state, supports, seen, k, loads)
    if as_json:
        print_json(_data(robot, name, deflection, seen, C, K))
    else:
        say(_text(robot, name, deflection, seen, C, K))
    return 0


def posture_standing(robot: Robot) -> tuple[str, ...]:
    """What a robot stands on: its base where that is fixed, else the tips of its legs, else its base."""
    legs = tuple(limb.tip for limb in robot.limbs if limb.kind == "leg")
    return legs if legs and robot.base == "floating" else ("base",)


def _stiffness(
    robot: Robot, state: State, supports: Sequence[str], frame: str, k: float | None, loads: dict[str, Any]
) -> Array | None:
    """Cartesian stiffness of a frame; None where it is rigid in some direction."""
    try:
        return cartesian_stiffness(robot, state, supports, frame, k, loads=loads)
    except SingularError:
        return None


def _data(
    robot: Robot, posture: str, deflection: Deflection, frame: str, C: Array, K: Array | None
) -> dict[str, Any]:
    return {
        "robot": robot.name,
        "posture": posture,
        "support": list(deflection.supports),
        "theta": dict(zip(robot.joint_names, deflection.theta, strict=True)),
        "efforts": dict(zip(robot.joint_names, deflection.torque, strict=True)),
        "links": dict(zip(deflection.bending, deflection.links, strict=True)),
        "change": {name: deflection.of(name) for name in deflection.frames},
        "wrenches": dict(zip(deflection.supports, deflection.wrenches, strict=True)),
        "iterations": deflection.iterations,
        "residual": deflection.residual,
        "frame": frame,
        "compliance": C,
        "cartesian_stiffness": K,
    }


def _text(robot: Robot, posture: str, deflection: Deflection, frame: str, C: Array, K: Array | None) -> str:
    sliding = {joint.name for joint in robot.joints if joint.screw.is_translation}
    joints = [("joint", "yields by", "effort")]
    for name, theta, torque in zip(robot.joint_names, deflection.theta, deflection.torque, strict=True):
        by = f"{_rounded(1e3 * theta)} mm" if name in sliding else f"{_rounded(np.degrees(theta))} deg"
        joints.append((name, by, f"{_rounded(torque)} {'N' if name in sliding else 'N m'}"))
    moved = [("frame", "turns by x, y, z [deg]", "shifts by x, y, z [mm]")]
    rows = [(name, deflection.of(name)) for name in deflection.frames if name not in deflection.supports]
    rows += [(f"{name} (bends)", six) for name, six in zip(deflection.bending, deflection.links, strict=True)]
    moved += [(name, _three(np.degrees(six[:3])), _three(1e3 * six[3:])) for name, six in rows]
    ground = [("support", "force x, y, z [N]", "moment x, y, z [N m]")]
    for name, wrench in zip(deflection.supports, deflection.wrenches, strict=True):
        ground.append((name, _three(wrench[3:]), _three(wrench[:3])))
    parts = [f"{robot.name} at {posture} on {', '.join(deflection.supports)}: loaded equilibrium"]
    parts += [aligned(table, "  ") for table in (joints, moved, ground) if len(table) > 1]
    matrix, what = (C, "compliance of") if K is None else (K, "stiffness of")
    units = "rad and m per N m and N" if K is None else "N m and N per rad and m"
    parts.append(f"{what} {frame} there, [m; f] and [rotation; translation], world axes [{units}]")
    sizes = np.sqrt(np.abs(np.diagonal(matrix)))
    clean = np.where(np.abs(matrix) > 1e-9 * np.outer(sizes, sizes), matrix, 0.0)
    parts.append(aligned([[f"{x:.5g}" for x in row] for row in clean], "  "))
    if K is None:
        parts.append(f"{frame} is rigid in some direction, so that its stiffness is infinite there")
    return "\n".join(parts)


def _three(values: Array) -> str:
    return "  ".join(f"{_rounded(x):>9}" for x in values)


def _rounded(x: float) -> str:
    return f"{round(float(x), 4) + 0.0:.4f}"
