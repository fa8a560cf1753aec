"""All measures by name: each answers one kind of number that a paper prints."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any

from screwkin.errors import InputError, one_of
from screwkin.papers import measures_leg, measures_springs, measures_table, measures_walk

Measure = Callable[..., Any]
"""A number, a vector or a text."""

_ALL: tuple[Measure, ...] = (
    measures_table.mass,
    measures_table.middle_of_link,
    measures_table.axis,
    measures_table.limits,
    measures_table.range_share,
    measures_table.torque_limit,
    measures_table.tilt,
    measures_table.sole,
    measures_table.size,
    measures_table.reference_error,
    measures_table.mechanism,
    measures_table.comparison,
    measures_table.dh_angles,
    measures_table.dh_lengths,
    measures_walk.key_points,
    measures_walk.feet_apart,
    measures_walk.swing_height,
    measures_walk.cycle_ends,
    measures_walk.largest_effort,
    measures_walk.spike_phases,
    measures_walk.simulated,
    measures_leg.ik_ratio,
    measures_leg.reach,
    measures_leg.cut_at,
    measures_leg.deflection,
    measures_leg.gains,
    measures_leg.compensation,
    measures_leg.command_changes,
    measures_leg.most_changed,
    measures_leg.swing_corrections,
    measures_springs.on_springs,
    measures_springs.landing,
)

MEASURES: Mapping[str, Measure] = {
    **{measure.__name__: measure for measure in _ALL},
    "center_of_mass": measures_table.link_center,
    "place": measures_table.zero_pose_place,
    "distance": measures_table.zero_pose_distance,
    "balance": measures_walk.balance_number,
    "ik": measures_leg.ik_number,
    "tracking": measures_leg.preview_tracking,
}
"""Measures take a ``Bench`` and named arguments, and return a value in SI units."""


def check_call(
    kind: str, name: str, known: Mapping[str, Callable[..., Any]], given: Mapping[str, object], where: str
) -> None:
    """Raise unless ``name`` is a known measure or drawing, and takes the arguments given beside the bench.

    Raises:
        UnknownNameError, InputError: what is wrong; ``where`` says in which row.
    """
    called = one_of(f"{kind} of {where!r}", name, known)
    parameters = list(inspect.signature(called).parameters.values())[1:]
    names = [parameter.name for parameter in parameters]
    unknown = [one for one in given if one not in names]
    missing = [p.name for p in parameters if p.default is p.empty and p.name not in given]
    parts = [f"unknown arguments {', '.join(unknown)}"] if unknown else []
    parts += [f"missing arguments {', '.join(missing)}"] if missing else []
    if parts:
        raise InputError(f"{where}: {kind} {name} has {' and '.join(parts)}; valid: {', '.join(names)}")
