"""The gait as a value: parameters and key points, checked and evaluated.

A gait comes from a document, the content of its file as plain dictionaries, which it holds: changing a
parameter evaluates every formula again, and ``to_dict`` returns what makes the same gait. Formulas may use
lengths of the robot at hand (``screwkin.gait.lengths``); what depends on them is NaN until it is known.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, cast

from screwkin.dynamics.terrain import STEEPEST
from screwkin.errors import Fault, GaitError, near
from screwkin.gait.free_path import read_free_waist
from screwkin.gait.keypoints import CHANNELS, Channel, channel_faults, increases, read_channel
from screwkin.gait.keys import AHEAD, CHOICES, KEYS, NUMBERS, OPTIONAL, RANGES, TEXTS
from screwkin.gait.places import StepEnd, read_places
from screwkin.gait.relative import FREE, NOMINAL, read_lengths, relative_to_robot
from screwkin.gait.settings import place, valid_keys
from screwkin.model.expression import names_in, resolve_parameters

Kind = Literal["geometric", "preview", "footsteps"]
Swing = Literal["minimum-jerk", "cubic", "even"]
Footholds = Literal["alternate", "close", "parallel"]
Side = Literal["right", "left"]

_TABLES = ("gait", "parameters", "channel", "waist", "lengths")
_LISTED = "foothold"


@dataclass(frozen=True, eq=False)
class Gait:
    """A gait. Lengths in m, angles in rad, times in s; from ``load_gait`` or ``gait_from_dict``.

    Tc: period of one step. stride, side, turn: displacement of a foot per swing, forward, to the left and
    about the vertical. lift: height of a swing. waist_height: of the waist above the floor. hand_drop: hands
    below their shoulders. sway: factor on the lateral motion of the waist. spread: added to each foot's
    distance from the middle. ramp: steps over which the gait starts and stops (0: at once). steps: how many,
    by default. rate: samples per second. arms: ``follow`` their hands, or ``rest`` at home. uphill, upleft:
    angles by which the floor rises ahead, along x, and then to the left. roll: how far the wanted ZMP goes
    from the middle of a sole to where the other foot leaves, then to where it lands. lead: time from home
    into the walk and out of it, 0 for none. footholds: ``alternate`` (each foot passes the other), ``close``
    (one leads, the other closes up) or ``parallel`` (as alternate, but from feet side by side to feet side by
    side); first: the foot that swings first. com: what a preview gait steers, the ``true`` CoM of all links
    or, naively, the ``waist``; model: whose ZMP it leads, a ``cart``'s or that of all ``links``. lateral:
    whether its waist ``shift``s to the side, or ``lean``s between the hips, as legs without a roll axis at
    the ankle need it to keep their soles flat, or does both, as it ``tilt``s about a line below the hips, at
    the number ``pivot`` above the floor. twist: share of the way by which the waist turns with each
    step to where the hips are in line with the feet. toe, heel: turn of a foot about the front edge of its
    sole before it leaves, and about the rear edge, toes up, as it lands. swing: spline of a swing; ease: part
    of an ``even`` one in which it speeds up, and again slows down. numbers: all of these and the file's own
    parameters. channels: key points.
    waist: coefficients of a free waist path, or empty. places: where the steps of kind ``footsteps`` end.
    lengths: of the robot that it is fitted to [m]; empty before, when all that depends on them is NaN.
    """

    name: str
    description: str
    source: str
    kind: Kind
    Tc: float
    stride: float
    side: float
    turn: float
    lift: float
    waist_height: float
    hand_drop: float
    sway: float
    spread: float
    ramp: float
    steps: int
    rate: float
    swing: Swing
    footholds: Footholds
    first: Side
    com: Literal["true", "waist"]
    model: Literal["cart", "links"]
    lateral: Literal["shift", "lean", "tilt"]
    arms: Literal["follow", "rest"]
    numbers: Mapping[str, float]
    channels: Mapping[str, Channel]
    waist: Mapping[str, tuple[float, ...]]
    lengths: Mapping[str, float] = field(default_factory=dict)
    places: tuple[StepEnd, ...] = ()
    uphill: float = 0.0
    upleft: float = 0.0
    roll: float = 0.0
    lead: float = 0.0
    twist: float = 0.0
    toe: float = 0.0
    heel: float = 0.0
    ease: float = 0.25
    path: str = ""
    _document: Mapping[str, Any] = field(default_factory=dict, repr=False)

    def __repr__(self) -> str:
        Tc, stride, side, turn = (self._shown(key) for key in ("Tc", "stride", "side", "turn"))
        return (
            f"Gait {self.name!r} ({self.kind}): {self.steps} steps of {Tc} s, "
            f"stride {stride} m, side {side} m, turn {turn} rad, rate {self.rate:g} Hz"
        )

    def _shown(self, key: str) -> str:
        value = self.numbers[key]
        return str(self._document["gait"][key]) if math.isnan(value) else f"{value:g}"

    @property
    def unfitted(self) -> tuple[str, ...]:
        """Keys whose numbers depend on lengths of a robot that is not known yet; ``fitted`` knows it."""
        channels = [f"channel.{c.name}" for c in self.channels.values() if math.isnan(c.at[0] + c.value[0])]
        holds = [
            f"foothold {i + 1}" for i, p in enumerate(self.places) if math.isnan(p.x + p.y + p.yaw + p.z)
        ]
        return (*(key for key, value in self.numbers.items() if math.isnan(value)), *channels, *holds)

    def replace(self, **parameters: Any) -> Gait:
        """The gait with other parameters; numbers may be given as text or formulas, as on a command line.

        Key points are reached by dotted keys: ``{"channel.waist_side.value.2": 0.05}``, or a whole list
        ``{"channel.waist_side.value": [...]}``.

        Raises:
            GaitError: an unknown key (the message lists the valid ones) or a wrong value; all at once.
        """
        document = self.to_dict()
        faults = []
        for key, value in parameters.items():
            if not place(document, key, value, OPTIONAL):
                valid = valid_keys(document, OPTIONAL)
                fix = f"{near(key, valid)}Valid: {', '.join(valid)}; one entry of a list by its number: KEY.0"
                faults.append(Fault("", key, "no such parameter", fix))
        where = self.path or f"gait {self.name}"
        where_with = f"{where} with {', '.join(f'{key}={value}' for key, value in parameters.items())}"
        if faults:
            raise GaitError(where_with, faults)
        return replace(gait_from_dict(document, where_with), path=where)

    def to_dict(self) -> dict[str, Any]:
        """All of the gait as JSON data; ``gait_from_dict`` makes the same gait of it."""
        return copy.deepcopy(dict(self._document))


def gait_from_dict(document: Mapping[str, Any], path: str = "<gait>") -> Gait:
    """The gait of a document: tables ``gait``, ``parameters``, ``channel``, ``waist`` and ``lengths``.

    Args:
        document: as read from a gait file or from ``Gait.to_dict``.
        path: of the file, for messages.

    Raises:
        GaitError: with every fault of the document.
    """
    faults: list[Fault] = []
    tables = _tables(document, faults)
    flat = _flat(tables["gait"], faults)
    lengths = read_lengths(tables["lengths"], faults)
    numbers = _numbers(flat, tables["parameters"], lengths, faults)
    channels = _channels(tables, flat, numbers, faults)
    waist = read_free_waist(tables["waist"], faults)
    _check_complete(flat["kind"], channels, waist, tables["channel"], faults)
    open_ = frozenset() if lengths else relative_to_robot(_raw_numbers(flat, tables["parameters"]))
    for key in AHEAD:
        if flat["kind"] == "geometric" and numbers.get(key):
            found = "key points alone lead the waist of a gait of kind 'geometric'"
            faults.append(Fault("[gait]", key, found, 'Take a gait of kind "preview" or "footsteps"'))
    places = _places(document, flat, numbers, open_, faults)
    if faults:
        raise GaitError(path, faults)
    values = {name: cast(float, value) for name, value in numbers.items() if name not in NOMINAL}
    if not lengths:
        values |= dict.fromkeys(open_ & {*values}, math.nan)
        channels = {name: _without_numbers(c, tables["channel"][name], open_) for name, c in channels.items()}
    given = {name: values[name] for name in (*NUMBERS, *OPTIONAL) if name in values}
    return Gait(
        **flat | given | {"steps": int(values["steps"])},
        numbers=values,
        channels=channels,
        waist=waist,
        lengths=lengths,
        places=places,
        path=path,
        _document=copy.deepcopy({**tables, "gait": flat, **({_LISTED: document[_LISTED]} if places else {})}),
    )


def _places(
    document: Mapping[str, Any],
    flat: dict[str, Any],
    numbers: dict[str, float | None],
    unknown: frozenset[str],
    faults: list[Fault],
) -> tuple[StepEnd, ...]:
    """Footholds of a gait that lists them; their number is that of the steps."""
    listed = flat["kind"] == "footsteps"
    if _LISTED not in document:
        if listed:
            fix = "Give [[foothold]] with x, y, yaw for every step, or walk(robot, gait, footsteps)"
            faults.append(Fault("[[foothold]]", "", "missing", fix))
        return ()
    if not listed:
        found = f"a gait of kind {flat['kind']!r} makes its own footholds"
        faults.append(Fault("[[foothold]]", "", found, 'Set kind = "footsteps"'))
        return ()
    places = read_places(document[_LISTED], numbers, unknown, faults)
    if not document[_LISTED]:
        faults.append(Fault("[[foothold]]", "", "no step is listed", "Give one at least"))
    flat["steps"] = numbers["steps"] = len(places)
    return places


def _tables(document: Mapping[str, Any], faults: list[Fault]) -> dict[str, dict[str, Any]]:
    """The document's tables, empty where absent."""
    for key in document:
        if key not in (*_TABLES, _LISTED):
            fix = f"{near(key, (*_TABLES, _LISTED))}Valid: {', '.join((*_TABLES, _LISTED))}"
            faults.append(Fault(f"[{key}]", "", "unknown table", fix))
    tables: dict[str, dict[str, Any]] = {}
    for name in _TABLES:
        table = document.get(name, {})
        if not isinstance(table, Mapping):
            faults.append(Fault(f"[{name}]", "", f"{table!r} is no table", f"Write [{name}] above its keys"))
            table = {}
        tables[name] = dict(table)
    return tables


def _flat(table: Mapping[str, Any], faults: list[Fault]) -> dict[str, Any]:
    """The table ``[gait]`` with defaults filled in, texts and choices checked, numbers still as written."""
    row = "[gait]"
    for key in table:
        if key not in KEYS:
            fix = f"{near(key, KEYS)}Valid: {', '.join(KEYS)}; numbers of your own go to [parameters]"
            faults.append(Fault(row, key, "unknown key", fix))
    flat: dict[str, Any] = {}
    for key in TEXTS:
        flat[key] = table.get(key, "")
        if not isinstance(flat[key], str):
            faults.append(Fault(row, key, f"{flat[key]!r} is no text", "Write it in quotes"))
    if not flat["name"]:
        faults.append(Fault(row, "name", "missing", "Name the gait"))
    for key, choices in CHOICES.items():
        flat[key] = table.get(key, choices[0])
        if flat[key] not in choices:
            found = f"{flat[key]!r} is not understood"
            faults.append(
                Fault(row, key, found, f"{near(str(flat[key]), choices)}Valid: {', '.join(choices)}")
            )
    for key, default in NUMBERS.items():
        if key in table or default is not None:
            flat[key] = table.get(key, default)
        else:
            faults.append(Fault(row, key, "missing", "Give a number"))
    return flat | {key: table[key] for key in OPTIONAL if key in table}


def _raw_numbers(flat: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    return {key: flat[key] for key in (*NUMBERS, *OPTIONAL) if key in flat} | {
        key: value for key, value in own.items() if key not in KEYS
    }


def _without_numbers(channel: Channel, raw: Mapping[str, Any], open_: frozenset[str]) -> Channel:
    """The channel with NaN for its times or values if one of them depends on an unknown length."""

    def known(key: str) -> bool:
        return not any(open_ & {*names_in(item)} for item in raw[key])

    at, value = (
        getattr(channel, key) if known(key) else getattr(channel, key) * math.nan for key in ("at", "value")
    )
    return Channel(channel.name, at, value)


def _numbers(
    flat: Mapping[str, Any], own: Mapping[str, Any], lengths: Mapping[str, float], faults: list[Fault]
) -> dict[str, float | None]:
    """Values of all numeric parameters, and of the robot's lengths; None for a faulty one."""
    for key in own:
        if key in KEYS:
            found = f"{key!r} is a parameter of [gait]"
            faults.append(Fault("[parameters]", key, found, "Set it there, or choose another name"))
        elif key in NOMINAL:
            found = f"{key!r} is a length of the robot at hand"
            faults.append(Fault("[parameters]", key, found, "Choose another name"))
    raw = _raw_numbers(flat, own)
    relative = relative_to_robot(raw)
    faults += [
        Fault("[gait]", key, f"{raw[key]!r} depends on the robot", "Give a number that suits any robot")
        for key in FREE
        if key in relative
    ]
    values, wrong = resolve_parameters(raw | dict(lengths or NOMINAL), row="[gait]")
    faults += [
        fault if fault.key in (*NUMBERS, *OPTIONAL) else _moved(fault, "[parameters]") for fault in wrong
    ]
    numbers = {name: None if value is None else float(value) for name, value in values.items()}
    for name, within in ((name, key.within) for name, key in KEYS.items() if key.within):
        value, known = numbers.get(name), lengths or name not in relative
        if known and value is not None and not RANGES[within](value):
            found = f"{value:g} is not {within}"
            faults.append(Fault("[gait]", name, found, f"Give a number {within}"))
            numbers[name] = None
    for name in ("uphill", "upleft"):
        value = numbers.get(name)
        if value is not None and abs(value) > STEEPEST:
            found = f"{value:g} rad is {math.degrees(value):.3g} deg"
            fix = f"A floor slopes by {math.degrees(STEEPEST):g} deg at most"
            faults.append(Fault("[gait]", name, found, fix))
            numbers[name] = None
    steps = numbers.get("steps")
    if steps is not None and (steps < 1 or steps != round(steps)):
        faults.append(
            Fault("[gait]", "steps", f"{steps:g} is no number of steps", "Give a whole number from 1")
        )
        numbers["steps"] = None
    return {name: numbers.get(name) for name in (*NUMBERS, *numbers)}


def _moved(fault: Fault, row: str) -> Fault:
    return Fault(row, fault.key, fault.found, fault.fix)


def _channels(
    tables: Mapping[str, Mapping[str, Any]],
    flat: Mapping[str, Any],
    numbers: Mapping[str, float | None],
    faults: list[Fault],
) -> dict[str, Channel]:
    """The sound ones of the channels."""
    channels: dict[str, Channel] = {}
    for name, raw in tables["channel"].items():
        row = f"[channel.{name}]"
        if name not in CHANNELS:
            fix = f"{near(name, CHANNELS)}Valid: {', '.join(CHANNELS)}"
            faults.append(Fault(row, "", "unknown channel", fix))
            continue
        channel = read_channel(name, raw, numbers, faults)
        if channel is None:
            continue

        def works_at(Tc: float, name: str = name, raw: Any = raw) -> bool:
            lengths = {name: numbers[name] for name in NOMINAL}
            at_that, _ = resolve_parameters(_raw_numbers({**flat, "Tc": Tc}, tables["parameters"]) | lengths)
            other = read_channel(name, raw, at_that, [])
            return other is not None and increases(other)

        wrong = channel_faults(channel, numbers["Tc"] or 1.0, works_at)
        faults += wrong
        if not wrong:
            channels[name] = channel
    return channels


def _check_complete(
    kind: str,
    channels: Mapping[str, Channel],
    waist: Mapping[str, Any],
    written: Mapping[str, Any],
    faults: list[Fault],
) -> None:
    """Channels that must be there, and the feet's two channels against each other."""
    needed = ["foot_progress", "foot_height"]
    if kind == "geometric" and not waist:
        needed += ["waist_progress", "waist_side"]
    for name in needed:
        if name not in written:
            fix = "Give its key points: at = [...], value = [...]"
            faults.append(Fault(f"[channel.{name}]", "", "missing", fix))
    if "foot_progress" in channels and "foot_height" in channels:
        moves, lifted = channels["foot_progress"].at, channels["foot_height"].at
        if moves[0] < lifted[0] - 1e-9 or moves[-1] > lifted[-1] + 1e-9:
            found = f"the foot moves from {moves[0]:.6g} to {moves[-1]:.6g} Tc"
            fix = f"Keep it within its time off the floor, {lifted[0]:.6g} to {lifted[-1]:.6g} Tc"
            faults.append(Fault("[channel.foot_progress]", "at", found, fix))
