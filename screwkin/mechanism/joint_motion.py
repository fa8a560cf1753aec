"""Rates and accelerations of all joints from the motions of base, tips and primary joints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import Twist, as_array, pose_from_array, unstack
from screwkin.compiler.records import identifier
from screwkin.compiler.run import run
from screwkin.errors import InputError
from screwkin.mechanism.least_values import least_values
from screwkin.mechanism.mechanism import WAIST, Mechanism
from screwkin.mechanism.network import blend
from screwkin.mechanism.rates import secondary_accelerations, solve_rates
from screwkin.mechanism.tip_motion import motion_program, solvable_limbs
from screwkin.mechanism.virtual_motion import primary_motion


@dataclass(frozen=True, eq=False)
class JointMotion:
    """Joint rates and accelerations (T, n), and the least singular value of every block (T, blocks)."""

    qd: Array
    qdd: Array
    sigma: Array


def joint_motion(
    mechanism: Mechanism,
    T_world_base: Array,
    q: Array,
    twists: Mapping[str, Twist],
    accelerations: Mapping[str, Twist],
    joints: Mapping[str, tuple[Array, Array]] | None = None,
) -> JointMotion:
    """What all joints do when the bodies of the imposing virtual chains move as given.

    Args:
        mechanism: any choice of primary couplings.
        T_world_base: (T, 4, 4).
        q: closed positions (T, n) [rad or m].
        twists: by virtual chain (``waist`` and the tips), [omega; v of the body's origin], world axes, of
            components (T,). Where only translations are primary, omega does not matter.
        accelerations: their time derivatives.
        joints: rate and acceleration (T,) of primary joints by name [rad/s or m/s, and per second]; joints
            that are not named rest.

    Returns:
        JointMotion; blocks whose ``sigma`` is below ``RANK_TOLERANCE`` are singular, their values mean
        nothing.

    Raises:
        InputError: a joint in ``joints`` is not primary.
    """
    robot, count, given = mechanism.robot, len(q), joints or {}
    for name in given:
        if name not in mechanism.primary or name not in robot.joint_names:
            raise InputError(f"{name} is no primary joint; its rate cannot be imposed")
    limbs = _limbs(mechanism)
    own = sorted(i for name in limbs for i in robot.path_to(robot.limb(name).link))
    solved = {robot.joint_names[i] for i in own}
    if solved | set(mechanism.primary) >= set(robot.joint_names):
        qd, qdd = np.zeros((2, count, len(robot.joints)))
        for name, (rate, acceleration) in given.items():
            qd[:, robot.joint_names.index(name)] = rate
            qdd[:, robot.joint_names.index(name)] = acceleration
    else:
        qd, qdd = _by_couplings(mechanism, T_world_base, q, twists, accelerations, given)
    if own:
        inputs = {"T_world_base": T_world_base, "q": q}
        for kind, moved in (("twist", twists), ("acceleration", accelerations)):
            base = moved.get(WAIST)
            inputs[f"base_{kind}"] = np.zeros(6) if base is None else as_array(base, (count,))
            for name in limbs:
                tip, whole = robot.limb(name).tip, len(robot.path_to(robot.limb(name).link)) == 6
                inputs[identifier(kind, tip)] = as_array(moved[tip] if whole else moved[tip].v, (count,))
        result = run(motion_program(robot, True, limbs), inputs)
        qd[:, own], qdd[:, own] = result["qd"], result["qdd"]
    return JointMotion(qd, qdd, least_values(mechanism, T_world_base, q))


def _limbs(mechanism: Mechanism) -> tuple[str, ...]:
    """Limbs that a program solves: their base and tip have given motions."""
    if any(name.startswith(f"{WAIST}.") for name in mechanism.secondary):
        return ()
    return solvable_limbs(mechanism.robot, mechanism.secondary)


def _by_couplings(
    mechanism: Mechanism,
    T_world_base: Array,
    q: Array,
    twists: Mapping[str, Twist],
    accelerations: Mapping[str, Twist],
    joints: Mapping[str, tuple[Array, Array]],
) -> tuple[Array, Array]:
    """The same for any mechanism, through the rates of its virtual couplings."""
    T, scalars, batch = pose_from_array(T_world_base), unstack(q), (len(q),)
    columns = mechanism.primary_columns, mechanism.secondary_columns

    def imposed(order: int) -> Array:
        second = accelerations if order else None
        moving = {name: given[order] for name, given in joints.items()}
        moving |= primary_motion(mechanism, T, scalars, twists, second)
        return np.asarray(as_array([moving.get(name, 0.0) for name in mechanism.primary], batch))

    primary, driven = imposed(0), imposed(1)
    following = solve_rates(mechanism, T_world_base, q, primary).values
    rates = blend(columns[0], primary, columns[1], following)
    bent = secondary_accelerations(mechanism, T_world_base, q, rates, driven).values
    changes = blend(columns[0], driven, columns[1], bent)
    real = [mechanism.position[name] for name in mechanism.robot.joint_names]
    return rates[:, real], changes[:, real]
