"""A plan turned with the floor it walks on."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.gait.plan import Plan, read_only


def tilted(plan: Plan) -> Plan:
    """The plan in the world, from the floor's frame; itself on a level floor.

    Joints do not notice: base, feet and hands turn together.
    """
    if not plan.terrain.slopes:
        return plan
    R = plan.terrain.R

    def pose(T: Array) -> Array:
        turned = np.array(T)
        turned[:, :3] = R @ T[:, :3]
        return read_only(turned)

    def vector(v: Array) -> Array:
        """Vectors (T, 3), or twists (T, 6), in the world's axes."""
        return read_only((v.reshape(len(v), -1, 3) @ R.T).reshape(v.shape))

    def each(turn: Callable[[Array], Array], of: Mapping[str, Array]) -> Mapping[str, Array]:
        return MappingProxyType({name: turn(value) for name, value in of.items()})

    return replace(
        plan,
        T_world_base=pose(plan.T_world_base),
        base_twist=vector(plan.base_twist),
        base_acceleration=vector(plan.base_acceleration),
        T_world_tip=each(pose, plan.T_world_tip),
        tip_twist=each(vector, plan.tip_twist),
        tip_acceleration=each(vector, plan.tip_acceleration),
        hand_position=each(vector, plan.hand_position),
        hand_velocity=each(vector, plan.hand_velocity),
        hand_acceleration=each(vector, plan.hand_acceleration),
    )
