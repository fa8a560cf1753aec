"""An audit of a robot: masses, inertias, limits, axes, symmetry, soles, loops, servos, what simulators do.

Nothing is mended here: every remark says where, what and what to do about it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array
from screwkin.analysis.audit_body import body_remarks
from screwkin.analysis.audit_servos import servo_remarks
from screwkin.analysis.remark import LEVELS, Level, Remark
from screwkin.errors import expect
from screwkin.model.inertias import impossible, inertia_matrix
from screwkin.model.records import LIMIT_TOLERANCE, Joint, Link
from screwkin.model.robot import Robot
from screwkin.model.shapes import link_points

ADDED = 1.0
"""Mass that PyBullet gives each link of a URDF that has no inertia [kg]."""
_HEAVY = 0.7  # share of the robot's mass in one of several links
_FAST = 100.0  # rad/s or m/s: beyond any joint of a robot
_STRONG = 50.0  # times the torque that would hold all of the robot at arm's length of its own size
_OUTSIDE = 1.5  # times the size of a link: its CoM or radius of gyration beyond it is in other units
_BARE = 0.1  # times the largest link: distances of axes below it are no size of a link without shapes
_POINT = 0.02  # times the size of a link: radii of gyration of bodies are larger
_TURN = 2 * math.pi
_DEGREES = 2 * _TURN
"""Beyond it a limit is one in degrees [rad]: two turns are more than any joint of a robot has."""
_GRAVITY = 9.81


def audit(robot: Robot) -> tuple[Remark, ...]:
    """All remarks on a robot, worst first.

    Args:
        robot: of numbers, from a table or a URDF.

    Returns:
        Remarks of levels ``error`` (dynamics or walks cannot be believed), ``warning`` and ``info``.
    """
    expect(robot, Robot, "robot", 'load_robot("NAME")')
    seen = link_points(robot)
    places = {link.name: _places(robot, link, seen.points.get(link.name)) for link in robot.links}
    sizes = {name: _size(points) for name, points in places.items()}
    bare = _BARE * max(sizes.values(), default=0.0)  # axes that cross say nothing of the size of their link
    for name, size in sizes.items():
        if name not in seen.points and size < bare:
            places[name] = np.zeros((0, 3))
    remarks = [
        *_masses(robot),
        *(remark for link in robot.links for remark in _link(link, places[link.name])),
        *(remark for joint in robot.joints for remark in _joint(robot, joint)),
        *(
            Remark("info", "shapes", text, "Give the file, or go without its picture")
            for text in seen.remarks
        ),
        *body_remarks(robot),
        *servo_remarks(robot),
    ]
    return tuple(sorted(remarks, key=lambda remark: LEVELS.index(remark.level)))


def added_by_pybullet(massless: int, mass: float) -> Remark | None:
    """What PyBullet makes of a URDF with links without inertia, none where there are none.

    Args:
        massless: their number.
        mass: of the robot [kg].
    """
    if not massless:
        return None
    what = (
        f"{massless} links without inertia: PyBullet gives each {ADDED:g} kg when it reads the URDF itself:"
        f" {mass:.2f} -> {mass + ADDED * massless:.2f} kg"
    )
    return Remark("warning", "masses", what, "screwkin simulates the mass that is written; so does its URDF")


def _masses(robot: Robot) -> Iterator[Remark]:
    total = float(robot.mass)
    if not total > 0:
        level: Level = "error" if robot.base == "floating" else "info"
        yield Remark(level, "masses", "no link has a mass", "Give masses: without them no forces are known")
        return
    moved = {joint.child for joint in robot.joints}
    massless = [link.name for link in robot.links if not float(link.mass) and link.name in moved]
    if massless:
        what = f"{', '.join(massless)} move without mass"
        advice = "MuJoCo refuses them and PyBullet makes them 1 kg each; screwkin gives both a milligram"
        yield Remark("info", "masses", what, advice)
    for link in robot.links:
        if len(robot.links) > 3 and float(link.mass) > _HEAVY * total:
            share = 100 * float(link.mass) / total
            what = f"{float(link.mass):.4g} kg are {share:.0f} % of the robot's"
            yield Remark("info", f"link {link.name}", what, "Check the units of masses")


def _places(robot: Robot, link: Link, points: Array | None) -> Array:
    """Points (k, 3) that a link reaches, zero pose [m]: its shape, else where its axes pass its CoM."""
    if points is not None and len(points):
        return points
    axes = [joint.screw for joint in robot.joints if link.name in (joint.parent, joint.child)]
    com = as_array(link.com).astype(float)
    feet = []
    for screw in axes:
        if not screw.is_translation:
            s, s0 = as_array(screw.s).astype(float), as_array(screw.s0).astype(float)
            feet.append(s0 + s * (s @ (com - s0)))
    return np.array(feet) if len(feet) > 1 else np.zeros((0, 3))


def _size(points: Array) -> float:
    """The diagonal of a box around points (k, 3)."""
    return float(np.linalg.norm(np.ptp(points, axis=0))) if len(points) else 0.0


def _link(link: Link, places: Array) -> Iterator[Remark]:
    where, mass = f"link {link.name}", float(link.mass)
    moments = np.linalg.eigvalsh(inertia_matrix(link.inertia))
    if mass > 0 and not moments.any():
        what = f"{mass:.4g} kg have no moment of inertia"
        yield Remark("warning", where, what, "Give its inertia, or box = [lx, ly, lz] to compute it from")
    elif wrong := impossible(link.inertia):
        advice = "No body has such an inertia; screwkin convert --repair writes the nearest possible one"
        yield Remark("warning", where, f"inertia with {wrong}", advice)
    if not mass > 0 or len(places) < 2:
        return
    low, high = places.min(axis=0), places.max(axis=0)
    size = _size(places)
    com = as_array(link.com).astype(float)
    away = float(np.linalg.norm(np.maximum(np.maximum(low - com, com - high), 0.0)))
    if away > _OUTSIDE * size:
        what = f"its CoM lies {away:.3g} m outside a link of {size:.3g} m"
        yield Remark("warning", where, what, "Check units and frame of the CoM")
    gyration = math.sqrt(max(float(moments[2]), 0.0) / mass)
    if gyration > _OUTSIDE * size:
        what = f"its radius of gyration is {gyration:.3g} m in a link of {size:.3g} m"
        yield Remark("warning", where, what, "Check the units of its inertia, and the point it is about")
    elif 0 < gyration < _POINT * size:
        what = f"its radius of gyration is {1e3 * gyration:.3g} mm in a link of {1e3 * size:.3g} mm"
        yield Remark("info", where, what, "Check the units of its inertia: bodies spread more")


def _joint(robot: Robot, joint: Joint) -> Iterator[Remark]:
    where, unit = f"joint {joint.name}", "m" if joint.type == "prismatic" else "rad"
    if joint.lower == joint.upper:
        what = f"its limits leave no range: both are {joint.lower:.4g} {unit}"
        yield Remark("warning", where, what, "Write its limits, or make it part of its parent link")
    elif not math.isfinite(joint.upper - joint.lower):
        yield Remark("info", where, "it has no limits", "Nothing will keep a motion from winding it up")
    elif joint.type != "prismatic" and max(abs(joint.lower), abs(joint.upper)) > _DEGREES:
        what = f"its limits are {joint.lower:.4g} and {joint.upper:.4g} rad, {joint.upper / _TURN:.3g} turns"
        yield Remark("warning", where, what, 'Limits are in rad; write "130*deg" for degrees')
    elif joint.type != "prismatic" and joint.upper - joint.lower > _TURN + LIMIT_TOLERANCE:
        yield Remark("info", where, f"it turns by {joint.upper - joint.lower:.3g} rad", "Check its limits")
    for posture in robot.postures:
        q = posture.q[robot.joints.index(joint)]
        at = [limit for limit in (joint.lower, joint.upper) if abs(q - limit) <= LIMIT_TOLERANCE]
        if posture.name == "home" and at and joint.lower < joint.upper:
            what = f"home stands at its limit, {q:.4g} {unit}"
            yield Remark("info", where, what, "Motions from home can leave it one way only")
    for key, value in (("velocity", joint.velocity), ("effort", joint.effort)):
        if not math.isfinite(value):
            yield Remark("info", where, f"no {key} is given", f"Give it: no plan is refused for its {key}")
    if math.isfinite(joint.velocity) and joint.velocity > _FAST:
        yield Remark("warning", where, f"its speed is {joint.velocity:.4g} {unit}/s", "Check its units")
    size = max((float(np.linalg.norm(as_array(j.screw.s0).astype(float))) for j in robot.joints), default=0)
    most = _STRONG * float(robot.mass) * _GRAVITY * max(size, 0.1)
    if math.isfinite(joint.effort) and joint.effort > most > 0:
        what = f"its effort is {joint.effort:.4g}, where {most:.3g} would swing the whole robot about"
        yield Remark("warning", where, what, "Check its units")
