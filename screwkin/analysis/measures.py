"""All measures by name: each answers one kind of number that a paper tells."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any

from screwkin.analysis import measures_leg, measures_springs, measures_table, measures_walk

Measure = Callable[..., Any]
"""A number, a vector or a text."""

_ALL: tuple[Measure, ...] = (
    measures_table.mass,
    measures_table.center_of_mass,
    measures_table.middle_of_link,
    measures_table.place,
    measures_table.distance,
    measures_table.axis,
    measures_table.limits,
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
    measures_walk.balance,
    measures_walk.spike_phases,
    measures_walk.simulated,
    measures_leg.ik,
    measures_leg.ik_ratio,
    measures_leg.reach,
    measures_leg.cut_at,
    measures_leg.deflection,
    measures_leg.gains,
    measures_leg.tracking,
    measures_leg.compensation,
    measures_springs.on_springs,
)

MEASURES: Mapping[str, Measure] = {measure.__name__: measure for measure in _ALL}
"""Measures take a ``Bench`` and named arguments, and give a value in SI units."""


def argument_faults(function: Callable[..., object], told: Mapping[str, object]) -> str:
    """What is wrong with the arguments of a measure or drawing; empty if nothing is."""
    parameters = list(inspect.signature(function).parameters.values())[1:]
    names = [parameter.name for parameter in parameters]
    unknown = [name for name in told if name not in names]
    missing = [p.name for p in parameters if p.default is p.empty and p.name not in told]
    parts = [f"unknown arguments {', '.join(unknown)}"] if unknown else []
    parts += [f"missing arguments {', '.join(missing)}"] if missing else []
    return f"{' and '.join(parts)}; valid: {', '.join(names)}" if parts else ""
