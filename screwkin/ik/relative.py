"""The nearest limb that has a closed form: axes that are parallel or meet but for tolerance, made to be so.

Tables that were measured or rounded hold right angles to five digits or so. The branches of such a relative
lie next to those of the limb itself.
"""

from __future__ import annotations

from dataclasses import replace

from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import cross, dot, norm
from screwkin.ik.closed import ClosedForm, recognised
from screwkin.kinematics.axis_geometry import meeting, parallel
from screwkin.kinematics.serial_chain import SerialChain, per_chain

NEARLY = 1e-4
"""Largest angle [rad] and, over the limb's size, distance at which axes count as parallel or meeting.

Beyond it elimination is exact; up to it, where branches fall together is known by the relative to two digits.
"""
GROUPS = ((0, 1, 2), (3, 4, 5), (0, 1), (4, 5))
"""Neighbouring axes that closed forms want to meet."""


@per_chain
def relative(chain: SerialChain) -> ClosedForm | None:
    """The closed form of the nearest limb that has one, None where there is none within ``NEARLY``."""
    if len(chain.screws) != 6 or not chain.turning.all():
        return None
    return recognised(_meeting(_parallel(chain)))


@per_chain
def departure(chain: SerialChain) -> float:
    """How far the relative's axes lie from the limb's: largest angle [rad] or distance over its length."""
    form = relative(chain)
    assert form is not None
    pairs = list(zip(chain.screws, form.chain.screws, strict=True))
    turned = max(float(norm(a.s - b.s)) for a, b in pairs)
    return max(turned, *(float(norm(cross(a.s, b.s0 - a.s0))) / chain.length for a, b in pairs))


def _parallel(chain: SerialChain) -> SerialChain:
    """The limb with neighbouring axes that are nearly parallel made so: all get the mean direction."""
    screws = list(chain.screws)
    first = 0
    for k in range(1, 7):
        if k < 6 and parallel(chain, k - 1, k, NEARLY):
            continue
        mean = screws[first].s
        for screw in screws[first + 1 : k]:
            mean = mean + screw.s * (1.0 if dot(mean, screw.s) > 0 else -1.0)
        for i in range(first, k) if k - first > 1 else ():
            sign = 1.0 if dot(mean, screws[i].s) > 0 else -1.0
            screws[i] = Screw(mean * (sign / norm(mean)), screws[i].s0)
        first = k
    return replace(chain, screws=tuple(screws))


def _meeting(chain: SerialChain) -> SerialChain:
    """The limb with neighbouring axes that nearly meet made so: all pass through the nearest point."""
    screws = list(chain.screws)
    moved: set[int] = set()
    for joints in GROUPS:
        point = None if moved & {*joints} else meeting(chain, joints, NEARLY)
        if point is not None:
            moved |= {*joints}
            for i in joints:
                screws[i] = Screw(screws[i].s, point)
    return replace(chain, screws=tuple(screws))
