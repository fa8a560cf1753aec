"""The true CoM of a plan led along a cart's motion: Newton's method on the waist, derivative by derivative.

The CoM of all links has no fixed place in the waist. Its rate is linear in the waist's while the feet move as
planned, and so is its acceleration, by the same share. The same holds of how far soles lean that are to stay
level.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array, pose_from_array, twist_from_array, unstack
from screwkin.dynamics.newton_euler import Bodies, total_momentum
from screwkin.dynamics.on_floor import ground_reaction
from screwkin.errors import NoSolutionError
from screwkin.gait.bearing import borne, leans_of, on_inner_edges
from screwkin.gait.plan import Plan
from screwkin.gait.preview import CartMotion
from screwkin.gait.realise import differentiate, positions
from screwkin.gait.stance import Stance
from screwkin.gait.steering import Steering
from screwkin.kinematics.mass import GRAVITY, mass_center
from screwkin.kinematics.positions import link_displacements
from screwkin.mechanism.mechanism import Mechanism
from screwkin.model.robot import Robot
from screwkin.model.state import State

TRACKED = 1e-9
"""How closely the CoM follows its reference [m]."""


@dataclass(frozen=True, eq=False)
class Tracked:
    """A plan with its joint positions (T, n), and how what is led moves with the waist (T, ways, ways)."""

    planned: Plan
    q: Array
    share: Array

    @classmethod
    def of(cls, mechanism: Mechanism, steering: Steering, planned: Plan) -> Tracked:
        """The plan as it stands.

        Args:
            mechanism: of a robot whose joints follow from base and tips.
            steering: how the waist moves the CoM.
            planned: T samples.
        """
        q = positions(mechanism, planned).state.q
        return cls(planned, q, _share(mechanism, steering, planned, q))


def com_over(mechanism: Mechanism, steering: Steering, now: Tracked, wanted: Array) -> tuple[Plan, Array]:
    """The plan with its waist moved until the CoM stands over ``wanted`` (T, 2), and its joint positions."""
    planned, q = now.planned, now.q
    for _ in range(20):
        error = _led(steering, wanted, 0.0) - _place(mechanism.robot, steering, planned, q)
        if np.abs(error).max() < TRACKED:
            return planned, q
        planned = steering.moved(planned, _solved(now.share, error))
        q = positions(mechanism, planned, q).state.q
    far = 1e3 * np.abs(error[:, :2]).max()
    raise NoSolutionError(f"the waist cannot bring the CoM to its reference; {far:.2g} mm are missing")


def com_along(mechanism: Mechanism, steering: Steering, now: Tracked, cart: CartMotion) -> Tracked:
    """The plan whose CoM of all links follows the cart, in all three derivatives."""
    planned, q = com_over(mechanism, steering, now, cart.com)
    share = _share(mechanism, steering, planned, q)
    none = np.zeros((len(q), steering.ways))
    velocity = _velocity(mechanism, steering, planned, q)
    planned = steering.driven(planned, _solved(share, _led(steering, cart.velocity, 0.0) - velocity), none)
    pushed = _led(steering, cart.acceleration, 0.0) - _acceleration(mechanism, steering, planned, q)
    return Tracked(steering.driven(planned, none, _solved(share, pushed)), q, share)


def on_edges(mechanism: Mechanism, now: Tracked, level: Plan, stance: Stance) -> Tracked:
    """The plan with the inner edges of soles that lean as high as the soles of a level plan are."""
    motion = differentiate(mechanism, now.planned, State(now.planned.T_world_base, now.q))
    leans = leans_of(mechanism.robot, now.planned, now.q, motion.qd, motion.qdd)
    planned = on_inner_edges(now.planned, level, stance, leans)
    return replace(now, planned=planned, q=positions(mechanism, planned, now.q).state.q)


def cart_heights(
    mechanism: Mechanism, steering: Steering, standing: Plan, q: Array
) -> tuple[tuple[float, float], float]:
    """Heights of carts with the robot's moments ahead and to the side; how the CoM moves aside with a lean.

    A cart of mass m at height h has the angular momentum m h v about a point of the floor below it. Of a
    robot that shifts, h is taken to be the height of its CoM; of one that leans, the sideways one follows
    from its own momentum.
    """
    robot, height = mechanism.robot, _com(mechanism.robot, standing, q)[0, 2]
    if steering.axis is None:
        return (height, height), 1.0
    pushed = steering.driven(standing, np.array([[0.0, 1.0]]), np.zeros((1, 2)))
    h = _momentum(mechanism, pushed, q)
    angular = np.cross(standing.T_world_base[0, :3, 3], h[0, 3:]) + h[0, :3]
    return (height, float(-angular[0] / h[0, 4])), float(h[0, 4] / robot.mass)


def beyond_carts(mechanism: Mechanism, now: Tracked, heights: tuple[float, float], begin: int) -> Array:
    """How far (T, 2) the ZMP of all links lies from that of carts with the same CoM, at the feet's level [m].

    It is what swinging limbs, and a waist that turns or rises, ask of the ground besides.
    """
    zmp, com, wrench, _ = _reaction(mechanism, now.planned, now.q)
    level = now.planned.T_world_base[:, 2:3, 3]
    at_feet = zmp + (level - level[begin]) * wrench[:, 3:5] / wrench[:, 5:]
    carts = com[:, :2] - np.array(heights) * wrench[:, 3:5] / (mechanism.robot.mass * GRAVITY)
    return np.asarray(at_feet - carts)


def _com(robot: Robot, planned: Plan, q: Array) -> Array:
    """CoM of all links (T, 3) [m]."""
    D = link_displacements(robot, unstack(q))
    return np.asarray(as_array(pose_from_array(planned.T_world_base) @ mass_center(robot, D), (len(q),)))


def _led(steering: Steering, com: Array, lean: Array | float) -> Array:
    """What the waist leads (T, ways): the CoM (T, 2), and how far bearing soles lean (T,)."""
    return com if steering.bearing is None else np.column_stack([com, np.broadcast_to(lean, len(com))])


def _place(robot: Robot, steering: Steering, planned: Plan, q: Array) -> Array:
    com, still = _com(robot, planned, q)[:, :2], np.zeros_like(q)
    if steering.bearing is None:
        return com
    return _led(steering, com, borne(leans_of(robot, planned, q, still, still), steering.bearing).value)


def _velocity(mechanism: Mechanism, steering: Steering, planned: Plan, q: Array) -> Array:
    com = _momentum(mechanism, planned, q)[:, 3:5] / mechanism.robot.mass
    if steering.bearing is None:
        return com
    qd = differentiate(mechanism, planned, State(planned.T_world_base, q)).qd
    leans = leans_of(mechanism.robot, planned, q, qd, np.zeros_like(q))
    return _led(steering, com, borne(leans, steering.bearing).rate)


def _acceleration(mechanism: Mechanism, steering: Steering, planned: Plan, q: Array) -> Array:
    com = _reaction(mechanism, planned, q)[2][:, 3:5] / mechanism.robot.mass
    if steering.bearing is None:
        return com
    motion = differentiate(mechanism, planned, State(planned.T_world_base, q))
    leans = leans_of(mechanism.robot, planned, q, motion.qd, motion.qdd)
    return _led(steering, com, borne(leans, steering.bearing).acceleration)


def _share(mechanism: Mechanism, steering: Steering, planned: Plan, q: Array) -> Array:
    """How what is led moves with the waist while the feet stay: rates are linear in the waist's."""
    none, ways = np.zeros((len(q), steering.ways)), np.eye(steering.ways)
    rest = _velocity(mechanism, steering, planned, q)
    pushed = [_velocity(mechanism, steering, steering.driven(planned, none + e, none), q) for e in ways]
    return np.stack([moved - rest for moved in pushed], axis=-1)


def _solved(share: Array, wanted: Array) -> Array:
    return np.asarray(np.linalg.solve(share, wanted[..., None])[..., 0])


def _momentum(mechanism: Mechanism, planned: Plan, q: Array) -> Array:
    """Momentum (T, 6) about the base origin, [angular; linear], with the joints that the plan asks for."""
    qd = unstack(differentiate(mechanism, planned, State(planned.T_world_base, q)).qd)
    bodies = Bodies.of(mechanism.robot, pose_from_array(planned.T_world_base).R, unstack(q))
    h = total_momentum(bodies, qd, twist_from_array(planned.base_twist))
    return np.hstack([as_array(part, (len(q),)) for part in (h.m, h.f)])


def _reaction(mechanism: Mechanism, planned: Plan, q: Array) -> tuple[Array, Array, Array, Array]:
    """ZMP, CoM and wrench of the ground, and the cart's ZMP, with the joints that the plan asks for."""
    motion = differentiate(mechanism, planned, State(planned.T_world_base, q))
    twists = planned.base_twist, planned.base_acceleration
    return ground_reaction(mechanism.robot, planned.T_world_base, q, motion.qd, motion.qdd, *twists)
