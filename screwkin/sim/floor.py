"""The floor in the simulators: a plane, and the blocks of a terrain."""

from __future__ import annotations

import math
from typing import Any

from screwkin.dynamics.terrain import Terrain
from screwkin.sim.loops import quat_xyzw

BOUNCES = 0.02
"""Speed [m/s] from which contacts in PyBullet bounce that are to do so."""


def floor_in_pybullet(p: Any, here: Any, terrain: Terrain) -> tuple[int, ...]:
    """Bodies of a terrain, none of which moves.

    Args:
        p: the module pybullet.
        here: names the client.
        terrain: what to build.
    """
    p.setPhysicsEngineParameter(restitutionVelocityThreshold=BOUNCES, **here)
    T = terrain.T_world_plane
    shapes = [(p.createCollisionShape(p.GEOM_PLANE, **here), T)]
    for pose, edges in terrain.boxes():
        half = (0.5 * edges).tolist()
        shapes.append((p.createCollisionShape(p.GEOM_BOX, halfExtents=half, **here), pose))
    bodies = []
    for shape, pose in shapes:
        place = {"basePosition": pose[:3, 3].tolist(), "baseOrientation": quat_xyzw(pose[:3, :3])}
        body: int = p.createMultiBody(0.0, shape, **place, **here)
        # The coefficients of the two bodies are multiplied: the floor takes 1, the robot what is wanted.
        p.changeDynamics(body, -1, lateralFriction=1.0, frictionAnchor=1, restitution=1.0, **here)
        bodies.append(body)
    return tuple(bodies)


def bounce_in_pybullet(restitution: float) -> dict[str, float]:
    """Arguments of ``changeDynamics`` for what bounces on the floor.

    PyBullet brakes what is about to touch within the step, which takes most of a bounce away; where it
    acts on what has touched alone, a bounce is right within .04.
    """
    return {"restitution": restitution, "contactProcessingThreshold": 0.0} if restitution else {}


def floor_in_mujoco(mj: Any, spec: Any, terrain: Terrain, **touch: Any) -> None:
    """Add the geometry of a terrain to the world.

    Args:
        mj: the module mujoco.
        spec: of the model.
        terrain: what to build.
        touch: how its contacts are.
    """
    kinds = mj.mjtGeom
    geoms = [("floor", kinds.mjGEOM_PLANE, [0.0, 0.0, 1.0], terrain.T_world_plane)]
    for i, (pose, edges) in enumerate(terrain.boxes()):
        geoms.append((f"block {i + 1}", kinds.mjGEOM_BOX, (0.5 * edges).tolist(), pose))
    for name, kind, size, pose in geoms:
        x, y, z, w = quat_xyzw(pose[:3, :3])
        spec.worldbody.add_geom(name=name, type=kind, size=size, pos=pose[:3, 3], quat=[w, x, y, z], **touch)


def contact_spring(contact_time: float, dt: float, restitution: float) -> list[float]:
    """Time constant [s] and damping ratio of MuJoCo's contacts that give back such a share of the speed.

    They are springs and dampers, of natural frequency w and damping ratio z, that push and never pull. What
    falls on one leaves it when their force falls to zero, with exp(-2 z acos(z) / sqrt(1 - z^2)) of its
    speed: .135 at z = 1, less with acosh beyond.

    Args:
        contact_time: time constant of contacts that are not to bounce [s].
        dt: of a step [s]; a bounce takes some fifteen of them at least.
        restitution: that share, below 1; 0 for contacts as they are.
    """
    if not restitution:
        return [contact_time, 1.0]
    low, high = math.log(1e-3), math.log(1e3)
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _given_back(math.exp(middle)) > restitution else (low, middle)
    ratio = math.exp(low)
    return [max(contact_time, 5.0 * dt) / ratio, ratio]


def _given_back(z: float) -> float:
    angle = math.acos(z) / math.sqrt(1.0 - z * z) if z < 1.0 else 1.0
    return math.exp(-2.0 * z * (math.acosh(z) / math.sqrt(z * z - 1.0) if z > 1.0 else angle))
