"""Perturbations from files and command lines: ``[perturbation]`` of a TOML file, or ``key=value`` texts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from screwkin.errors import Fault, InputError, PerturbationError
from screwkin.model.expression import ExpressionError, evaluate
from screwkin.model.toml import read_text, read_toml
from screwkin.sim.perturbation import BY_NAME, DEFAULTS, PLACE, WHOLE, Perturbation, perturbation_faults


def load_perturbation(path: str | Path) -> Perturbation:
    """The perturbation of a TOML file: its table ``[perturbation]``, and nothing else.

    Raises:
        PerturbationError: the file cannot be read or is wrong; all faults are named at once.
    """
    data = read_toml(read_text(Path(path), PerturbationError), str(path), PerturbationError)
    table = data.pop("perturbation", None)
    faults = [Fault(f"[{key}]", "", "unknown table", f"Write {PLACE} only") for key in data]
    if not isinstance(table, Mapping):
        faults.append(Fault(PLACE, "", "missing", f"Write {PLACE} above its keys"))
    if faults:
        raise PerturbationError(str(path), faults)
    assert isinstance(table, Mapping)
    return perturbation_from_data(table, str(path))


def perturbation_from_texts(texts: Sequence[str], option: str = "--perturb") -> Perturbation:
    """The perturbation of ``key=value`` texts, such as ``slope=3*deg,0`` and ``mass.torso=1.1``.

    Args:
        texts: each sets one key, once; numbers of one key stand with commas between them.
        option: its name in messages.

    Raises:
        InputError: a text is no assignment, or a key is given twice.
        PerturbationError: a key or value is wrong; all faults are named at once.
    """
    data: dict[str, Any] = {}
    for text in texts:
        key, equals, value = (part.strip() for part in text.partition("="))
        if not (equals and key and value):
            raise InputError(
                f"{option} {text!r} is no assignment; write {option} key=value, such as rise=5*mm"
            )
        first, point, name = key.partition(".")
        holder = data.setdefault(first, {}) if point else data
        if not isinstance(holder, dict) or (name or first) in holder:
            raise InputError(f"{option} {first} is given twice; once is enough")
        parts = value.split(",")
        holder[name or first] = parts if len(parts) > 1 else value
    return perturbation_from_data(data, option)


def perturbation_from_data(data: Mapping[str, Any], path: str = "<data>") -> Perturbation:
    """The perturbation of JSON or TOML data; numbers may be formulas over pi, deg and mm.

    Args:
        data: values by key, as in ``Perturbation.to_dict``.
        path: where they come from, for messages.

    Raises:
        PerturbationError: a key or value is wrong; all faults are named at once.
    """
    faults: list[Fault] = []
    values = {key: _value(key, value, faults) for key, value in data.items()}
    known = {fault.key for fault in faults}
    faults += (fault for fault in perturbation_faults(values) if fault.key not in known)
    if faults:
        raise PerturbationError(path, faults)
    return Perturbation(**values)


def _value(key: str, value: Any, faults: list[Fault]) -> Any:
    """Numbers of one key; what is none becomes a fault."""
    if isinstance(value, Mapping) and key in BY_NAME:
        return {str(name): _number(key, one, faults) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return tuple(_number(key, one, faults) for one in value)
    return value if value is None or key not in DEFAULTS else _number(key, value, faults)


def _number(key: str, value: Any, faults: list[Fault]) -> Any:
    try:
        number = evaluate(value, {})
    except ExpressionError as error:
        faults.append(Fault(PLACE, key, error.found, error.fix))
        return 0.0
    return int(number) if key in WHOLE and float(number).is_integer() else number


def described(perturbation: Perturbation) -> Iterator[str]:
    """``key=value`` of all that differs from the planned world, as ``perturbation_from_texts`` reads it."""
    for key, value in perturbation.to_dict().items():
        if isinstance(value, Mapping):
            yield from (f"{key}.{name}={number!r}" for name, number in value.items())
        else:
            yield f"{key}={','.join(map(repr, value)) if isinstance(value, list) else repr(value)}"
