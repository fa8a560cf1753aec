"""The plan of a preview gait: a CoM motion for a ZMP that goes from foot to foot, and the waist to give it.

Time falls into phases of Tc: the robot stands in the first and the last one, and swings once in each between.
In the first ``dsp`` of a phase both feet are in contact, while the reference moves linearly to the next
supporting sole. The CoM is that of all links. It has no fixed place in the waist, so Newton's method solves
for the waist, for positions, rates and accelerations in turn. Source: Kajita et al. (2003); walking with the
waist taken for the CoM (``com = "waist"``) is what the second paper does.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array, pose_from_array, twist_from_array, unstack
from screwkin.dynamics.newton_euler import Bodies, total_momentum
from screwkin.errors import Fault, GaitError, InputError, NoSolutionError
from screwkin.gait.balance import ground_reaction
from screwkin.gait.footsteps import Foothold, footholds, swing_side
from screwkin.gait.motion import Motion, along
from screwkin.gait.path import path_of
from screwkin.gait.plan import Plan, check_fitted, check_rate, plan_around, whole_steps
from screwkin.gait.preview import CartMotion, follow_reference, preview_gains
from screwkin.gait.realise import differentiate, positions
from screwkin.gait.record import Gait
from screwkin.gait.stance import Stance
from screwkin.kinematics.mass import mass_center
from screwkin.kinematics.positions import link_displacements
from screwkin.mechanism.mechanism import Mechanism
from screwkin.model.robot import Robot
from screwkin.model.state import State

SETTINGS = ("dsp", "horizon", "Qe", "Qx", "R")
"""Numbers of a preview gait's file in ``[parameters]``."""

TRACKED = 1e-9
"""How closely the CoM follows its reference [m]."""


def preview_plan(mechanism: Mechanism, gait: Gait, stance: Stance, steps: int) -> Plan:
    """The plan of a gait of kind ``preview`` or ``footsteps``.

    Args:
        mechanism: of a robot with a ``home`` posture whose joints follow from base and tips.
        gait: ``dsp`` (fraction of Tc), ``horizon`` [s], ``Qe``, ``Qx``, ``R`` are its own parameters.
        stance: feet, soles and shoulders of the robot.
        steps: number of swings, at least 1.

    Returns:
        Plan of (steps + 2) Tc rate samples.

    Raises:
        InputError: more steps than the gait lists. GaitError: a setting is missing or wrong.
        NoSolutionError: out of reach, or feet that overlap.
    """
    steps = whole_steps(steps)
    check_fitted(gait)
    if gait.places and steps > len(gait.places):
        raise InputError(f"steps is {steps}; gait {gait.name} lists {len(gait.places)} footholds")
    settings = _settings(gait)
    check_rate(gait)
    count = round((steps + 2) * gait.Tc * gait.rate)
    time = np.arange(count) / gait.rate
    phase = _phase(time, gait.Tc, steps)
    holds = footholds(gait, stance, steps)
    reference, heading = zmp_reference(gait, stance, holds, steps, time), headings(gait, holds, steps)

    boundaries = gait.Tc * np.arange(1.0, steps + 2.0)

    def around(cart: CartMotion, part: slice = slice(None)) -> Plan:
        now = Motion(phase.value[part], phase.rate[part], phase.acceleration[part])
        return plan_around(gait, stance, steps, time[part], now, _waist(gait, heading, cart, now), boundaries)

    height = gait.waist_height
    if gait.com == "true":
        rest = np.zeros((1, 2))
        standing = around(CartMotion(reference[:1], rest, rest, reference[:1]), slice(1))
        stand, q = _followed(mechanism, standing, reference[:1])
        height = _com(mechanism.robot, stand, q)[0, 2]
    gains = preview_gains(
        1 / gait.rate, height, settings["horizon"], settings["Qe"], settings["Qx"], settings["R"]
    )
    cart = follow_reference(gains, reference)
    planned = around(cart)
    if gait.com == "waist":
        return replace(planned, notes=("the waist is taken for the CoM",))
    return _tracked(mechanism, planned, cart)


def zmp_reference(gait: Gait, stance: Stance, holds: tuple[Foothold, ...], steps: int, time: Array) -> Array:
    """Wanted ZMP (T, 2): at rest between the feet, else in the middle of the supporting sole [m].

    Args:
        gait: of kind ``preview`` or ``footsteps``.
        stance: soles of the robot.
        holds: from ``footholds``.
        steps: number of swings.
        time: (T,) [s].
    """
    places = [0.5 * (_middle(stance, holds[0]) + _middle(stance, holds[1]))]
    stand = {hold.foot: hold for hold in holds[:2]}
    for n in range(steps):
        supporting = stance.foot(-swing_side(gait, n))
        places.append(_middle(stance, stand[supporting.name]))
        stand[holds[n + 2].foot] = holds[n + 2]
    first, second = stand.values()
    places.append(0.5 * (_middle(stance, first) + _middle(stance, second)))
    number = np.clip(np.floor(time / gait.Tc + 1e-9).astype(int), 0, steps + 1)
    share = np.clip((time / gait.Tc - number) / gait.numbers["dsp"], 0.0, 1.0)[:, None]
    levels = np.array([places[0], *places])
    return np.asarray(levels[number] + share * (levels[number + 1] - levels[number]))


def headings(gait: Gait, holds: tuple[Foothold, ...], steps: int) -> Array:
    """Yaw of the waist at the boundaries of the steps (steps + 1,) [rad].

    Along the path of the gait; over listed footholds the mean of those that the feet then stand on.
    """
    if not gait.places:
        return np.arange(steps + 1.0) * path_of(gait).turn
    stand = {hold.foot: hold.yaw for hold in holds[:2]}
    means = [sum(stand.values()) / 2]
    for hold in holds[2:]:
        stand[hold.foot] = hold.yaw
        means.append(sum(stand.values()) / 2)
    return np.array(means)


def _middle(stance: Stance, hold: Foothold) -> Array:
    """The middle of a sole on its foothold, seen from above [m]."""
    outlines = {foot.name: foot.sole for foot in stance.feet}
    x, y = np.mean(outlines[hold.foot], axis=0)
    c, s = np.cos(hold.yaw), np.sin(hold.yaw)
    return np.array([hold.x + c * x - s * y, hold.y + s * x + c * y])


def _settings(gait: Gait) -> dict[str, float]:
    faults = []
    for name in SETTINGS:
        if name not in gait.numbers:
            faults.append(Fault("[parameters]", name, "missing", "A preview gait needs it"))
    numbers = {name: gait.numbers.get(name, np.nan) for name in SETTINGS}
    lifted = gait.channels["foot_height"].at[0]
    if faults:
        raise GaitError(gait.path or f"gait {gait.name}", faults)
    if not 0 < numbers["dsp"] <= lifted + 1e-12:
        found = f"{numbers['dsp']:g} does not lie above 0 and up to liftoff at {lifted:g} Tc"
        faults.append(Fault("[parameters]", "dsp", found, "The ZMP must arrive before the foot leaves"))
    if numbers["horizon"] < gait.Tc:
        found = f"{numbers['horizon']:g} s is shorter than a step of {gait.Tc:g} s"
        faults.append(Fault("[parameters]", "horizon", found, "Look at least one step ahead"))
    faults += [
        Fault("[parameters]", name, f"{numbers[name]:g} is out of range", f"Give a number {least}")
        for name, bad, least in (
            ("Qe", numbers["Qe"] <= 0, "above 0"),
            ("Qx", numbers["Qx"] < 0, "of at least 0"),
            ("R", numbers["R"] <= 0, "above 0"),
        )
        if bad
    ]
    if faults:
        raise GaitError(gait.path or f"gait {gait.name}", faults)
    return numbers


def _phase(time: Array, Tc: float, steps: int) -> Motion:
    """Phase of the swings, from 0 at the end of the first standing phase; feet rest where its rate jumps."""
    value = np.clip(time / Tc - 1, 0.0, float(steps))
    moving = (value > 0) & (value < steps)
    return Motion(value, np.where(moving, 1 / Tc, 0.0), np.zeros_like(time))


def _waist(gait: Gait, heading: Array, cart: CartMotion, phase: Motion) -> Motion:
    """Waist x, y, z, yaw (T, 4): over the cart, turned to the next heading by a quintic in each step."""

    def turned(p: Array, order: int) -> Array:
        n = np.minimum(np.floor(p), len(heading) - 2).astype(int)
        u, by = p - n, np.diff(heading)[n]
        if order == 0:
            return np.asarray(heading[n] + by * u**3 * (10 + u * (6 * u - 15)))
        return by * (30 * (u * (1 - u)) ** 2 if order == 1 else 60 * u * (1 - u) * (1 - 2 * u))

    turning = along(turned, phase)
    columns = [
        np.column_stack([flat, np.full(len(flat), height), yaw])
        for flat, height, yaw in (
            (cart.com, gait.waist_height, turning.value),
            (cart.velocity, 0.0, turning.rate),
            (cart.acceleration, 0.0, turning.acceleration),
        )
    ]
    return Motion(*columns)


def _com(robot: Robot, planned: Plan, q: Array) -> Array:
    """CoM of all links (T, 3) [m]."""
    D = link_displacements(robot, unstack(q))
    return np.asarray(as_array(pose_from_array(planned.T_world_base) @ mass_center(robot, D), (len(q),)))


def _followed(mechanism: Mechanism, planned: Plan, wanted: Array) -> tuple[Plan, Array]:
    """The plan with its waist moved until the CoM stands over ``wanted`` (T, 2), and its joint positions."""
    q = positions(mechanism, planned).state.q
    share = _share(mechanism, planned, q)
    for _ in range(20):
        error = wanted - _com(mechanism.robot, planned, q)[:, :2]
        if np.abs(error).max() < TRACKED:
            return planned, q
        planned = _moved(planned, _solved(share, error))
        q = positions(mechanism, planned, q).state.q
    far = 1e3 * np.abs(error).max()
    raise NoSolutionError(f"the waist cannot bring the CoM to its reference; {far:.2g} mm are missing")


def _tracked(mechanism: Mechanism, planned: Plan, cart: CartMotion) -> Plan:
    """The plan whose CoM of all links follows the cart, in all three derivatives."""
    planned, q = _followed(mechanism, planned, cart.com)
    share, none = _share(mechanism, planned, q), np.zeros_like(cart.com)
    velocity, _ = _com_rates(mechanism, planned, q)
    planned = _driven(planned, _solved(share, cart.velocity - velocity), none)
    _, acceleration = _com_rates(mechanism, planned, q)
    return _driven(planned, none, _solved(share, cart.acceleration - acceleration))


def _share(mechanism: Mechanism, planned: Plan, q: Array) -> Array:
    """How the CoM moves with the waist while the feet stay, (T, 2, 2): rates are linear in the waist's."""
    none = np.zeros((len(q), 2))
    rest, _ = _com_rates(mechanism, planned, q)
    pushed = [_com_rates(mechanism, _driven(planned, none + e, none), q)[0] for e in np.eye(2)]
    return np.stack([moved - rest for moved in pushed], axis=-1)


def _solved(share: Array, wanted: Array) -> Array:
    return np.asarray(np.linalg.solve(share, wanted[..., None])[..., 0])


def _moved(planned: Plan, by: Array) -> Plan:
    """The plan with its waist, and the hands that hang from it, moved (T, 2) [m]."""
    T = planned.T_world_base.copy()
    T[:, :2, 3] += by
    hands = {name: _added(p, by) for name, p in planned.hand_position.items()}
    return replace(planned, T_world_base=T, hand_position=hands)


def _driven(planned: Plan, velocity: Array, acceleration: Array) -> Plan:
    """The plan with velocities and accelerations (T, 2) added to waist and hands."""
    return replace(
        planned,
        base_twist=_added(planned.base_twist, velocity, 3),
        base_acceleration=_added(planned.base_acceleration, acceleration, 3),
        hand_velocity={name: _added(v, velocity) for name, v in planned.hand_velocity.items()},
        hand_acceleration={name: _added(a, acceleration) for name, a in planned.hand_acceleration.items()},
    )


def _added(array: Array, by: Array, at: int = 0) -> Array:
    changed = array.copy()
    changed[:, at : at + 2] += by
    return changed


def _com_rates(mechanism: Mechanism, planned: Plan, q: Array) -> tuple[Array, Array]:
    """Velocity and acceleration of the CoM (T, 2), with the joints that the plan asks for."""
    robot = mechanism.robot
    motion = differentiate(mechanism, planned, State(planned.T_world_base, q))
    T, qd = pose_from_array(planned.T_world_base), unstack(motion.qd)
    h = total_momentum(Bodies.of(robot, T.R, unstack(q)), qd, twist_from_array(planned.base_twist))
    velocity = as_array(h.f, (len(q),)) / robot.mass
    twists = planned.base_twist, planned.base_acceleration
    wrench = ground_reaction(robot, planned.T_world_base, q, motion.qd, motion.qdd, *twists)[2]
    return velocity[:, :2], wrench[:, 3:5] / robot.mass
