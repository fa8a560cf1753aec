"""The hands: they swing fore and aft about where they hang at home, relative to the waist."""

from __future__ import annotations

import numpy as np

from screwkin.gait.footsteps import first_side
from screwkin.gait.motion import Motion, along, carried_point, together
from screwkin.gait.record import Gait
from screwkin.gait.splines import cyclic_cubic, resting_cubic
from screwkin.gait.stance import Stance


def hands_motion(
    gait: Gait, stance: Stance, waist: Motion, phase: Motion, home: Motion | None = None
) -> dict[str, Motion]:
    """World motion (T, 3) of every hand by name; positions only.

    ``hand_forward`` [m] moves the hand on the side of the swinging foot, and the other one oppositely
    (walking paper, eq. 16-17, g = (-1)^n); ``hand_raise`` [m] lifts both above ``hand_drop`` below the
    shoulder (eq. 18). Without these channels the hands rest there. With ``cubic`` swings they rest between
    key points of equal value, as the paper prints it, and their accelerations jump there as those of its feet
    do; else they move on periodic C2 cubics, which overshoot such ends by 4 % (1 mm).

    Args:
        gait: its channels of the hands.
        stance: hands at home, in the waist frame [m].
        waist: x, y, z, yaw (T, 4) in the world [m and rad].
        phase: (T,) [steps].
        home: how much (T,) they are where they are at home; the phase rests while they go there.
    """
    swing, lift = (_channel(gait, name, phase) for name in ("hand_forward", "hand_raise"))
    none = swing * 0.0
    motions = {}
    for hand in stance.hands:
        x, y, z = hand.shoulder
        own = together(swing * (hand.side * first_side(gait)), none, lift)
        own += np.array([x, y, z - gait.hand_drop])
        motions[hand.name] = carried_point(
            waist, own if home is None else _drawn(own, home, x, y, z - hand.drop)
        )
    return motions


def _drawn(own: Motion, home: Motion, *place: float) -> Motion:
    """Between its own place (T, 3) and that at home, where the own one rests while the share (T,) changes."""
    away = np.array(place) - own.value
    share, rate, acceleration = (x[:, None] for x in (home.value, home.rate, home.acceleration))
    return Motion(own.value + share * away, own.rate + rate * away, own.acceleration + acceleration * away)


def _channel(gait: Gait, name: str, phase: Motion) -> Motion:
    channel = gait.channels.get(name)
    if channel is None:
        return phase * 0.0
    through = resting_cubic if gait.swing == "cubic" else cyclic_cubic
    return along(through(channel.at, channel.value, channel.kind), phase)
