"""The plan of a preview gait: a CoM motion for a ZMP that goes from foot to foot, and the waist to give it.

Time falls into phases of Tc: the robot stands in the first and the last one (or in ``stand`` of them: quick
steps need more time to begin), and swings once in each between.
In the first ``dsp`` of a phase both feet are in contact, while the reference moves linearly to the next
supporting sole. The CoM is that of all links. It has no fixed place in the waist, so Newton's method solves
for the waist, for positions, rates and accelerations in turn. Source: Kajita et al. (2003); walking with the
waist taken for the CoM (``com = "waist"``) is what the second paper does.

Everything is in the floor's frame. On a slope gravity has a part along the floor: with the vertical n in the
floor's axes the ZMP is p = c - z/(g n_z) c'' - z n_xy / n_z. On footholds of different heights the controller
takes the CoM to stay as high above them as at the start; the ZMP of the walk itself is exact.
"""

from __future__ import annotations

from dataclasses import fields, replace
from functools import partial

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.dynamics.terrain import Terrain
from screwkin.errors import Fault, GaitError, InputError
from screwkin.gait.bearing import bearing, supports
from screwkin.gait.footsteps import Foothold, footholds
from screwkin.gait.lead import at_home, led, samples_of, share_of_home
from screwkin.gait.motion import Motion
from screwkin.gait.over_feet import headings, levels, waist_over
from screwkin.gait.pitch import refuse_level_legs
from screwkin.gait.plan import Plan, check_fitted, check_rate, plan_around, whole_steps
from screwkin.gait.preview import CartMotion, follow_reference, preview_gains
from screwkin.gait.realise import free_rotations
from screwkin.gait.record import Gait
from screwkin.gait.stance import Stance
from screwkin.gait.steering import Steering
from screwkin.gait.tracking import Tracked, beyond_carts, cart_heights, com_along, com_over, on_edges
from screwkin.mechanism.mechanism import Mechanism

SETTINGS = ("dsp", "horizon", "Qe", "Qx", "R")
"""Numbers of a preview gait's file in ``[parameters]``."""

PASSES = 3
"""How often preview control is repeated for the ZMP of all links."""


def preview_plan(mechanism: Mechanism, gait: Gait, stance: Stance, steps: int) -> Plan:
    """The plan of a gait of kind ``preview`` or ``footsteps``.

    Args:
        mechanism: of a robot with a ``home`` posture whose joints follow from base and tips.
        gait: ``dsp`` (fraction of Tc), ``horizon`` [s], ``Qe``, ``Qx``, ``R`` are its own parameters.
        stance: feet, soles and shoulders of the robot.
        steps: number of swings, at least 1.

    Returns:
        Plan of (steps + 2 stand) Tc rate samples, and ``lead`` rate more on either side, from home to home.

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
    refuse_level_legs(gait, [foot.name for foot in stance.feet], free_rotations(mechanism))
    stand = settings["stand"]
    count, more = round((steps + 2 * stand) * gait.Tc * gait.rate), samples_of(gait)
    time = np.arange(count + 2 * more) / gait.rate
    phase = _phase(time - more / gait.rate, gait.Tc, steps, stand)
    holds = footholds(gait, stance, steps)
    reference = zmp_reference(gait, stance, holds, steps, time[:count])
    heading, level = headings(gait, stance, holds, steps), levels(holds)
    boundaries = gait.Tc * (np.arange(steps + 1.0) + stand) + more / gait.rate
    home = share_of_home(more, count, gait.rate)

    def around(cart: CartMotion, part: slice = slice(None)) -> Plan:
        now = Motion(phase.value[part], phase.rate[part], phase.acceleration[part])
        near = Motion(home.value[part], home.rate[part], home.acceleration[part])
        waist = waist_over(gait, heading, level, cart, now, near * above)
        return plan_around(gait, stance, steps, time[part], now, waist, boundaries, home=near)

    ends = [at_home(mechanism.robot, stance, stood, gait) for stood in (holds[:2], holds)] if more else []
    above = ends[0].height - gait.waist_height if ends else 0.0
    steering, heights, aside = Steering.of(mechanism.robot, gait), (gait.waist_height,) * 2, 1.0
    if gait.com == "true" or steering.axis is not None:
        rest = np.zeros((1, 2))
        standing = around(CartMotion(reference[:1], rest, rest, reference[:1]), slice(more, more + 1))
        standing, q = com_over(mechanism, steering, Tracked.of(mechanism, steering, standing), reference[:1])
        heights, aside = cart_heights(mechanism, steering, standing, q)

    def cart_along(reference: Array) -> CartMotion:
        cart = _cart(gait, settings, heights, reference)
        if not ends:
            return cart
        start, end = (one.com if gait.com == "true" else one.waist for one in ends)
        return led(cart, start, end, more, gait.rate)

    cart = cart_along(reference)
    if steering.axis is None:
        planned = around(cart)
    else:
        planned = steering.moved(around(_straight(cart)), (cart.com - cart.com[:1]) * (0, 1 / aside))
        shares = bearing(mechanism, gait, stance, steps, time - more / gait.rate)
        steering = replace(steering, bearing=shares)
    if gait.com == "waist":
        return replace(planned, notes=("the waist is taken for the CoM",))
    now = com_along(mechanism, steering, Tracked.of(mechanism, steering, planned), cart)
    if steering.bearing is not None:
        now = com_along(mechanism, steering, on_edges(mechanism, now, planned, stance), cart)
    for _ in range(PASSES if gait.model == "links" else 0):
        beyond = beyond_carts(mechanism, now, heights, more)[more : more + count]
        now = com_along(mechanism, steering, now, cart_along(reference - beyond))
    return now.planned


def _cart(
    gait: Gait, settings: dict[str, float], heights: tuple[float, float], reference: Array
) -> CartMotion:
    """The cart's motion ahead and to the side (T, 2), each at its own height [m]."""
    normal = Terrain(gait.uphill, gait.upleft).R[2]  # the vertical in the floor's axes
    weights = [settings[key] for key in ("horizon", "Qe", "Qx", "R")]
    # On a slope the CoM stands further uphill: above the foot, not along its normal.
    reference = reference + heights[0] / normal[2] * normal[:2]
    if heights[0] == heights[1]:
        gains = preview_gains(1 / gait.rate, heights[0] / normal[2], *weights)
        return follow_reference(gains, reference)
    parts = [
        follow_reference(preview_gains(1 / gait.rate, height / normal[2], *weights), reference[:, k : k + 1])
        for k, height in enumerate(heights)
    ]
    return CartMotion(*(np.hstack([getattr(part, f.name) for part in parts]) for f in fields(CartMotion)))


def _straight(cart: CartMotion) -> CartMotion:
    """The cart's motion without what it does to the side."""
    first = cart.com[:1] * (0, 1)
    ahead = [x * (1, 0) for x in (cart.com, cart.velocity, cart.acceleration, cart.zmp)]
    return CartMotion(ahead[0] + first, ahead[1], ahead[2], ahead[3] + first)


def zmp_reference(gait: Gait, stance: Stance, holds: tuple[Foothold, ...], steps: int, time: Array) -> Array:
    """Wanted ZMP (T, 2): at rest between the feet, else in the supporting sole [m].

    There it goes from ``roll`` on the side that the other foot leaves to ``roll`` on the side where it lands,
    about the middle and along the foot's x axis, at the times of ``supports``. The gait's number ``ahead``
    (default 1) times as far ahead of the tips as the middle, which lie below the ankles: these then bear less
    torque. Its number ``inward`` (default 0) of the way from the middle to the edge at the other foot: the
    CoM then sways less.

    Args:
        gait: of kind ``preview`` or ``footsteps``.
        stance: soles of the robot.
        holds: from ``footholds``.
        steps: number of swings.
        time: (T,) [s].
    """
    middle = partial(_middle, stance, gait.numbers.get("ahead", 1.0), gait.numbers.get("inward", 0.0))
    begins, enter = [0.0], [0.5 * (middle(holds[0]) + middle(holds[1]))]
    leave, stand = enter.copy(), {hold.foot: hold for hold in holds[:2]}
    for begin, foot, n in supports(gait, stance, steps)[1:]:
        if not foot:
            places = [0.5 * np.sum([middle(hold) for hold in stand.values()], axis=0)]
        elif n is None:
            places = [middle(stand[foot])]
        else:
            landing = holds[n + 2]
            places = [middle(stand[foot], towards=o, by=gait.roll) for o in (stand[landing.foot], landing)]
            stand[landing.foot] = landing
        begins.append(begin)
        enter.append(places[0])
        leave.append(places[-1])
    phase = time / gait.Tc - (gait.numbers.get("stand", 1.0) - 1)
    number = np.maximum(np.searchsorted(begins, phase + 1e-9, side="right") - 1, 0)
    dsp, gone = gait.numbers["dsp"], (phase - np.array(begins)[number])[:, None]
    before, at, after = (
        np.array([leave[0], *leave[:-1]])[number],
        np.array(enter)[number],
        np.array(leave)[number],
    )
    rolled = np.clip((gone - dsp) / (1 - dsp), 0.0, 1.0) * (after - at)
    return np.asarray(before + np.clip(gone / dsp, 0.0, 1.0) * (at - before) + rolled)


def _middle(
    stance: Stance,
    ahead: float,
    inward: float,
    hold: Foothold,
    towards: Foothold | None = None,
    by: float = 0.0,
) -> Array:
    """The middle of a sole on its foothold, or ``by`` along its x axis towards another [m].

    It is ``ahead`` times as far ahead of the tip, and ``inward`` of the way to the edge at the other foot.
    """
    side, sole = next((foot.side, np.array(foot.sole)) for foot in stance.feet if foot.name == hold.foot)
    x, y = np.mean(sole, axis=0) * (ahead, 1.0)
    y += inward * (side * np.min(side * sole[:, 1]) - y)
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
    numbers["stand"] = gait.numbers.get("stand", 1.0)
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
            ("stand", not numbers["stand"] >= 1, "of at least 1"),
        )
        if bad
    ]
    if faults:
        raise GaitError(gait.path or f"gait {gait.name}", faults)
    return numbers


def _phase(time: Array, Tc: float, steps: int, stand: float) -> Motion:
    """Phase of the swings, from 0 at the end of the first stand; feet rest where its rate jumps."""
    value = np.clip(time / Tc - stand, 0.0, float(steps))
    moving = (value > 0) & (value < steps)
    return Motion(value, np.where(moving, 1 / Tc, 0.0), np.zeros_like(time))
