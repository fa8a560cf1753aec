"""One verdict out of several: of engines that must agree, and of one solver at finer settings.

A number of the joint verdict is the worst of them, so that whoever reads it alone is never too hopeful; what
each engine measured stands beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, TypeVar

from screwkin.sim.self_collision import SelfCollision, deepest

V = TypeVar("V", bound=Any)
"""A ``Validation``, or any record with its measured fields."""

SCATTER = ("end_error_mm", "slip_mm", "max_tilt_deg", "zmp_rms_mm", "zmp_max_mm")
"""Fields whose range over a solver's settings is reported."""
_LEAST = ("fell_at", "min_margin_mm", "min_base_height")
_OWN = (
    "passed",
    "reasons",
    "warnings",
    "engine",
    "engine_settings",
    "engines",
    "solver",
    "undecided",
    "self_collisions",
)
_JUDGED = ("end_error_mm", "slip_mm")


def agreed(checks: Sequence[V]) -> V:
    """One verdict on what several engines did: passed if all pass, every number the worst.

    Run and pictures are those of the first that did not pass, else of the first.

    Args:
        checks: verdicts on the same trajectory, one per engine.
    """
    if len(checks) == 1:
        return checks[0]
    shown = next((check for check in checks if not check.passed), checks[0])
    farthest = max(checks, key=lambda check: float(check.end_error_mm))
    values = {f.name: [getattr(check, f.name) for check in checks] for f in fields(shown)}
    changed = {
        name: _worst(name, column) for name, column in values.items() if name not in _OWN and _is_data(column)
    }
    solvers = [check.solver for check in checks if check.solver is not None]
    return replace(
        shown,
        **changed | {"distance": farthest.distance},
        passed=all(values["passed"]),
        reasons=_named(checks, "reasons"),
        warnings=_named(checks, "warnings"),
        engine="+".join(values["engine"]),
        engine_settings=_joined(values["engine_settings"]),
        engines=_joined(values["engines"]),
        solver=_joined(solvers) if solvers else None,
        undecided=any(values["undecided"]),
        self_collisions=_collided(values["self_collisions"]),
    )


def settled(check: V, finer: Mapping[str, V], reasons_of: Callable[[V], Sequence[str]]) -> V:
    """A verdict beside those at finer settings of the same engine: does it outlast them?

    It does not if one of them differs, or if the errors, moved on by as much as they scatter, turn it.

    Args:
        check: the verdict at usual settings.
        finer: verdicts at finer ones, by what is finer.
        reasons_of: the criteria that a verdict fails.
    """
    every = {"usual": check, **finer}
    columns = {name: [getattr(one, name) for one in every.values()] for name in SCATTER}
    spread = {
        name: None if any(v is None for v in column) else [min(column), max(column)]
        for name, column in columns.items()
    }
    sign = 1.0 if check.passed else -1.0
    moved = {
        name: getattr(check, name) + sign * (max(v) - min(v))
        for name, v in columns.items()
        if name in _JUDGED
    }
    turns = bool(reasons_of(replace(check, **moved))) == check.passed
    undecided = turns or any(one.passed != check.passed for one in every.values())
    verdicts = {name: one.passed for name, one in every.items()}
    record = {check.engine: {"undecided": undecided, "passed": verdicts, "spread": spread}}
    if not undecided:
        return replace(check, solver=record)
    said = ", ".join(f"{name} {'passes' if passed else 'fails'}" for name, passed in verdicts.items())
    ranges = ", ".join(f"{name} {v[0]:.2f} to {v[1]:.2f}" for name, v in spread.items() if v is not None)
    reason = f"undecided: the verdict lies within the solver's own scatter ({said}; {ranges})"
    return replace(check, solver=record, undecided=True, passed=False, reasons=(reason, *check.reasons))


def _collided(every: Sequence[Sequence[SelfCollision] | None]) -> tuple[SelfCollision, ...] | None:
    """The deepest of all engines; None where one of them has not looked."""
    looked = [own for own in every if own is not None]
    return deepest(one for own in looked for one in own) if len(looked) == len(every) else None


def _is_data(column: Sequence[Any]) -> bool:
    known = [value for value in column if value is not None]
    return all(isinstance(value, int | float | tuple | Mapping) for value in known) and not any(
        isinstance(part, Sequence) or not isinstance(part, int | float)
        for value in known
        if isinstance(value, tuple | Mapping)
        for part in (value.values() if isinstance(value, Mapping) else value)
    )


def _worst(name: str, column: Sequence[Any]) -> Any:
    """The worst of the values of one field: the least of some, the greatest of most; unknown beats known."""
    known = [value for value in column if value is not None]
    if not known or (len(known) < len(column) and name not in _LEAST):
        return None
    if isinstance(known[0], Mapping):
        return {key: _worst(name, [value[key] for value in known]) for key in known[0]}
    if isinstance(known[0], tuple):
        return tuple(_worst(name, parts) for parts in zip(*known, strict=True))
    return min(known) if name in _LEAST else max(known)


def _named(checks: Sequence[Any], field: str) -> tuple[str, ...]:
    """Sentences of all verdicts: once where all say the same, else with the engine's name."""
    texts = [getattr(check, field) for check in checks]
    shared = [text for text in texts[0] if all(text in own for own in texts)]
    own = [
        f"{check.engine}: {text}" for check in checks for text in getattr(check, field) if text not in shared
    ]
    return (*shared, *own)


def _joined(parts: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    return {key: value for part in parts for key, value in part.items()}
