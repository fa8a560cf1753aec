"""The floor in the simulators: a plane, and the blocks of a terrain."""

from __future__ import annotations

from typing import Any

from screwkin.dynamics.terrain import Terrain
from screwkin.sim.loops import quat_xyzw


def floor_in_pybullet(p: Any, here: Any, terrain: Terrain) -> tuple[int, ...]:
    """Bodies of a terrain, none of which moves.

    Args:
        p: the module pybullet.
        here: names the client.
        terrain: what to build.
    """
    T = terrain.T_world_plane
    shapes = [(p.createCollisionShape(p.GEOM_PLANE, **here), T)]
    for pose, edges in terrain.boxes():
        half = (0.5 * edges).tolist()
        shapes.append((p.createCollisionShape(p.GEOM_BOX, halfExtents=half, **here), pose))
    bodies = []
    for shape, pose in shapes:
        place = {"basePosition": pose[:3, 3].tolist(), "baseOrientation": quat_xyzw(pose[:3, :3])}
        body: int = p.createMultiBody(0.0, shape, **place, **here)
        # The coefficients of the two bodies are multiplied: the floor takes 1, the robot the wanted friction.
        p.changeDynamics(body, -1, lateralFriction=1.0, frictionAnchor=1, **here)
        bodies.append(body)
    return tuple(bodies)


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
