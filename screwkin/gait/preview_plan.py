"""The plan of a preview gait: a CoM motion for a ZMP that goes from foot to foot, and the waist to give it.

Time falls into phases of Tc: the robot stands in the first and the last one, and swings once in each between.
In the first ``dsp`` of a phase both feet are in contact, while the reference moves linearly to the next
supporting sole. The CoM is that of all links. It has no fixed place in the waist, so Newton's method solves
for the waist, for positions, rates and accelerations in turn. Source: Kajita et al. (2003); walking with the
waist taken for the CoM (``com = "waist"``) is what the second paper does.

Everything is in the floor's frame. On a slope gravity has a part along the floor: with the vertical n in the
floor's axes the ZMP is p = c - z/(g n_z) c'' - z n_xy / n_z. On footholds of different heights the controller
takes the CoM to stay as high above them as at the start; the ZMP of the walk itself is exact.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array, pose_from_array, twist_from_array, unstack
from screwkin.dynamics.newton_euler import Bodies, total_momentum
from screwkin.dynamics.terrain import Terrain
from screwkin.errors import Fault, GaitError, InputError, NoSolutionError
from screwkin.gait.balance import ground_reaction
from screwkin.gait.footsteps import Foothold, footholds, swing_side
from screwkin.gait.lead import at_home, led, samples_of, share_of_home
from screwkin.gait.motion import Motion
from screwkin.gait.over_feet import headings, levels, waist_over
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
        Plan of (steps + 2) Tc rate samples, and ``lead`` rate more on either side, from home to home.

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
    count, more = round((steps + 2) * gait.Tc * gait.rate), samples_of(gait)
    time = np.arange(count + 2 * more) / gait.rate
    phase = _phase(time - more / gait.rate, gait.Tc, steps)
    holds = footholds(gait, stance, steps)
    reference = zmp_reference(gait, stance, holds, steps, time[:count])
    heading, level = headings(gait, holds, steps), levels(holds)
    boundaries = gait.Tc * np.arange(1.0, steps + 2.0) + more / gait.rate
    home = share_of_home(more, count, gait.rate)

    def around(cart: CartMotion, part: slice = slice(None)) -> Plan:
        now = Motion(phase.value[part], phase.rate[part], phase.acceleration[part])
        near = Motion(home.value[part], home.rate[part], home.acceleration[part])
        waist = waist_over(gait, heading, level, cart, now, near * above)
        return plan_around(gait, stance, steps, time[part], now, waist, boundaries, home=near)

    ends = [at_home(mechanism.robot, stance, stood, gait) for stood in (holds[:2], holds)] if more else []
    above = ends[0].height - gait.waist_height if ends else 0.0
    height = gait.waist_height
    if gait.com == "true":
        rest = np.zeros((1, 2))
        standing = around(CartMotion(reference[:1], rest, rest, reference[:1]), slice(more, more + 1))
        stand, q = _followed(mechanism, standing, reference[:1])
        height = _com(mechanism.robot, stand, q)[0, 2]
    normal = Terrain(gait.uphill, gait.upleft).R[2]  # the vertical in the floor's axes
    gains = preview_gains(
        1 / gait.rate, height / normal[2], settings["horizon"], settings["Qe"], settings["Qx"], settings["R"]
    )
    # On a slope the CoM stands further uphill: above the foot, not along its normal.
    cart = follow_reference(gains, reference + height / normal[2] * normal[:2])
    if ends:
        start, end = (one.com if gait.com == "true" else one.waist for one in ends)
        cart = led(cart, start, end, more, gait.rate)
    planned = around(cart)
    if gait.com == "waist":
        return replace(planned, notes=("the waist is taken for the CoM",))
    return _tracked(mechanism, planned, cart)


def zmp_reference(gait: Gait, stance: Stance, holds: tuple[Foothold, ...], steps: int, time: Array) -> Array:
    """Wanted ZMP (T, 2): at rest between the feet, else in the supporting sole [m].

    There it goes from ``roll`` on the side that the other foot leaves to ``roll`` on the side where it lands,
    about the middle and along the foot's x axis.

    Args:
        gait: of kind ``preview`` or ``footsteps``.
        stance: soles of the robot.
        holds: from ``footholds``.
        steps: number of swings.
        time: (T,) [s].
    """
    enter = [0.5 * (_middle(stance, holds[0]) + _middle(stance, holds[1]))]
    leave = enter.copy()
    stand = {hold.foot: hold for hold in holds[:2]}
    for n in range(steps):
        supporting = stand[stance.foot(-swing_side(gait, n)).name]
        for ends, other in ((enter, stand[holds[n + 2].foot]), (leave, holds[n + 2])):
            ends.append(_middle(stance, supporting, towards=other, by=gait.roll))
        stand[holds[n + 2].foot] = holds[n + 2]
    first, second = stand.values()
    for ends in (enter, leave):
        ends.append(0.5 * (_middle(stance, first) + _middle(stance, second)))
    number = np.clip(np.floor(time / gait.Tc + 1e-9).astype(int), 0, steps + 1)
    dsp, gone = gait.numbers["dsp"], (time / gait.Tc - number)[:, None]
    before, at, after = (
        np.array([leave[0], *leave[:-1]])[number],
        np.array(enter)[number],
        np.array(leave)[number],
    )
    rolled = np.clip((gone - dsp) / (1 - dsp), 0.0, 1.0) * (after - at)
    return np.asarray(before + np.clip(gone / dsp, 0.0, 1.0) * (at - before) + rolled)


def _middle(stance: Stance, hold: Foothold, towards: Foothold | None = None, by: float = 0.0) -> Array:
    """The middle of a sole on its foothold, or ``by`` along its x axis towards another [m]."""
    outlines = {foot.name: foot.sole for foot in stance.feet}
    x, y = np.mean(outlines[hold.foot], axis=0)
    c, s = np.cos(hold.yaw), np.sin(hold.yaw)
    if towards is not None:
        x += float(np.clip(c * (towards.x - hold.x) + s * (towards.y - hold.y), -by, by))
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
