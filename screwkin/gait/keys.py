"""Every key of a gait's table ``[gait]``: what it means, its unit and its default."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

RANGES: Mapping[str, Callable[[float], bool]] = {
    "above 0": lambda x: x > 0,
    "at least 0": lambda x: x >= 0,
    "from 0 to 1": lambda x: 0 <= x <= 1,
    "above 0, up to 0.5": lambda x: 0 < x <= 0.5,
}
"""Ranges of numbers, by what a message calls them."""


@dataclass(frozen=True)
class Key:
    """A key: its meaning, unit, default (None: the file must say it), and the values of one that chooses.

    within: the range of a number, one of ``RANGES``; empty: any, or what else the gait checks.
    """

    meaning: str
    unit: str = ""
    default: float | str | None = None
    choices: tuple[str, ...] = ()
    within: str = ""

    @property
    def number(self) -> float | None:
        """Its default as a number."""
        return None if self.default is None else float(self.default)


def _choice(meaning: str, *choices: str) -> Key:
    """A key that chooses; the first choice is the default."""
    return Key(meaning, default=choices[0], choices=choices)


_TEXTS = {
    "name": Key("name of the gait"),
    "description": Key("one sentence", default=""),
    "source": Key("where it comes from", default=""),
}
_CHOICES = {
    "kind": _choice(
        "what leads the waist: key points, preview control of the ZMP, or that over listed footholds",
        "geometric",
        "preview",
        "footsteps",
    ),
    "swing": _choice(
        "spline of a swing; even: at even speed but for its ends", "minimum-jerk", "cubic", "even"
    ),
    "footholds": _choice(
        "each foot passes the other, one leads and the other closes up, or both are side by side at the ends",
        "alternate",
        "close",
        "parallel",
    ),
    "com": _choice(
        "what preview control steers: the true CoM of all links, or the waist taken for it", "true", "waist"
    ),
    "model": _choice(
        "whose ZMP preview control leads: a cart's at the height of the CoM, or that of all links",
        "cart",
        "links",
    ),
    "lateral": _choice(
        "whether the waist shifts to the side, leans between the hips, as legs without ankle roll need it, or"
        " does both: tilts about a line below them",
        "shift",
        "lean",
        "tilt",
    ),
    "first": _choice("foot that swings first", "right", "left"),
    "arms": _choice("whether arms follow the path of their hands or rest at home", "follow", "rest"),
}
_NUMBERS = {
    "Tc": Key("period of one step", "s", within="above 0"),
    "stride": Key("displacement of a foot per swing, forward; negative walks backwards", "m"),
    "side": Key("displacement of a foot per swing, to the left", "m", 0.0),
    "turn": Key("turn of a foot per swing, to the left", "rad", 0.0),
    "lift": Key("height of a swing", "m", within="above 0"),
    "waist_height": Key("height of the waist above the floor", "m", within="above 0"),
    "hand_drop": Key(
        "how far hands hang below their shoulders; `arm` suits any robot, one without arms too",
        "m",
        within="above 0",
    ),
    "sway": Key("factor on the lateral motion of the waist", "", 1.0),
    "spread": Key("added to each foot's distance from the middle", "m", 0.0),
    "ramp": Key("steps over which the gait starts and stops; 0: at once", "steps", 1.0, within="at least 0"),
    "steps": Key("how many steps, by default", "", 8.0),
    "rate": Key("samples per second", "Hz", 50.0, within="above 0"),
}
_OPTIONAL = {
    "uphill": Key("angle by which the floor rises ahead, along x", "rad", 0.0),
    "upleft": Key("angle by which the floor then rises to the left", "rad", 0.0),
    "roll": Key(
        "how far the ZMP goes from a sole's middle to where the other foot leaves, then to where it lands",
        "share",
        0.0,
        within="at least 0",
    ),
    "lead": Key(
        "time from home into the walk and out of it; 0 for none. Feet must stand as at home then: "
        'footholds = "parallel" and spread = 0, or a list of footholds',
        "s",
        0.0,
        within="at least 0",
    ),
    "twist": Key(
        "how far the hips turn along the line from foot to foot with each step, which spares their speed",
        "share",
        0.0,
        within="from 0 to 1",
    ),
    "toe": Key(
        "angle by which a foot that stands behind the other turns about its front edge before it leaves",
        "rad",
        0.0,
        within="from 0 to 1",
    ),
    "heel": Key(
        "angle by which a foot that lands ahead of the other has turned about its rear edge, toes up",
        "rad",
        0.0,
        within="from 0 to 1",
    ),
    "ease": Key(
        "part of an even swing in which it speeds up, and again slows down",
        "share",
        0.25,
        within="above 0, up to 0.5",
    ),
}

KEYS: Mapping[str, Key] = _TEXTS | _CHOICES | _NUMBERS | _OPTIONAL
"""By name, in the order of a file."""

TEXTS = tuple(_TEXTS)
CHOICES: Mapping[str, tuple[str, ...]] = {name: key.choices for name, key in _CHOICES.items()}
"""Parameters that choose; the first one is the default."""

AHEAD = tuple(name for name in _OPTIONAL if name != "ease")
"""Optional numbers of gaits that look ahead, of kind ``preview`` or ``footsteps``."""

NUMBERS: Mapping[str, float | None] = {name: key.number for name, key in _NUMBERS.items()}
"""Parameters that are numbers, with their defaults; None: the file must say it."""

OPTIONAL: Mapping[str, float] = {name: key.number or 0.0 for name, key in _OPTIONAL.items()}
"""Further numbers, with their defaults; a gait records those only that are given."""
