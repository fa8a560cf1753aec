"""The waist's way along the path: through key points, or free with given coefficients.

Both are two functions of the phase, progress [steps along the path] and side [m to the left of it]; whatever
else is to lead the waist needs only to give these two.
"""

from __future__ import annotations

from dataclasses import dataclass

from screwkin.algebra.arrays import Array
from screwkin.gait.free_path import free_path
from screwkin.gait.motion import Function, Motion, along
from screwkin.gait.record import Gait
from screwkin.gait.splines import cyclic_cubic


@dataclass(frozen=True, eq=False)
class WaistPath:
    """Progress [steps] and side [m, left positive] as functions of the phase."""

    progress: Function
    side: Function

    def motions(self, phase: Motion) -> tuple[Motion, Motion]:
        """Progress and side along time."""
        return along(self.progress, phase), along(self.side, phase)


def waist_path(gait: Gait, steps: int) -> WaistPath:
    """The waist's path of a gait over a number of steps.

    Free if the gait has coefficients for it, else C2 cubics through the key points of ``waist_progress`` and
    ``waist_side`` (walking paper, eq. 23-24). These pass the inner key points: to rest there would put spikes
    of decimetres into the ZMP. Sides count towards the foot that supports; ``sway`` multiplies them.

    Args:
        gait: with a free path, or channels of the waist.
        steps: number of steps.
    """
    if gait.waist:
        progress, towards = free_path(gait.waist, steps)
    else:
        forward, sideways = (gait.channels[name] for name in ("waist_progress", "waist_side"))
        progress = cyclic_cubic(forward.at, forward.value, forward.kind)
        towards = cyclic_cubic(sideways.at, sideways.value, sideways.kind)
    left_supports_first = gait.first == "right"
    factor = gait.sway if left_supports_first else -gait.sway

    def side(phase: Array, order: int) -> Array:
        return factor * towards(phase, order)

    return WaistPath(progress, side)
