"""A starting point from a similar limb: the hip made spherical, whose solution is closed, and near.

Source: paper B, section 3.2.3, after Cisneros Limon et al. (2013); here for axes of any directions.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import dot
from screwkin.errors import InputError
from screwkin.ik.closed import ClosedForm, closed_form
from screwkin.kinematics.axis_geometry import meeting, parallel
from screwkin.kinematics.serial_chain import SerialChain


def spherical_variant(chain: SerialChain) -> SerialChain:
    """The chain with its first two axes moved, unturned, to where the third comes nearest to the ankle.

    Raises:
        InputError: not six revolute joints whose last two axes meet, or hip axes that cannot turn freely.
    """
    if len(chain.screws) != 6 or not chain.turning.all():
        raise InputError(f"{chain.limb} has no hybrid solution: six revolute joints are needed")
    ankle = meeting(chain, (4, 5))
    if ankle is None:
        raise InputError(
            f"{chain.limb} has no hybrid solution: the axes of {chain.names[4]} and {chain.names[5]} "
            "do not meet in a point"
        )
    if parallel(chain, 0, 1) or parallel(chain, 1, 2):
        raise InputError(f"{chain.limb} has no hybrid solution: neighbouring hip axes are parallel")
    pitch = chain.screws[2]
    hip = pitch.s0 + pitch.s * dot(pitch.s, ankle - pitch.s0)
    moved = [Screw(screw.s, hip) for screw in chain.screws[:3]]
    return replace(chain, screws=(*moved, *chain.screws[3:]))


def hybrid_seed(chain: SerialChain, target: Array, guess: Array) -> Array:
    """Joint positions (B, n) that bring the tip near its target poses (B, 4, 4), by the spherical variant.

    Of its eight branches the one least beyond the joint limits, among equals the nearest to the guess (B, n).
    """
    form: ClosedForm = closed_form(spherical_variant(chain))
    q = form.branches(target)
    apart = np.linalg.norm(np.sin((q - guess[:, None]) / 2), axis=-1)
    best = np.lexsort((apart, np.maximum(chain.excess(q), 0.0)), axis=1)[:, 0]
    return np.asarray(np.take_along_axis(q, best[:, None, None], axis=1)[:, 0])
