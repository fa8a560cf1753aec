"""What to change of a gait that a robot cannot follow: keys, with values that work.

Keys are tried one by one, between their values and ones that ask little of the legs. Many values are planned
coarsely and solved in one batch; what is recommended has then been planned in full.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from screwkin.errors import NoSolutionError, ScrewkinError
from screwkin.gait.coarse import coarse_walks
from screwkin.gait.driven import arms_of
from screwkin.gait.follow import follow
from screwkin.gait.footsteps import listed_step
from screwkin.gait.lengths import lengths_of, stretched
from screwkin.gait.record import Gait
from screwkin.model.robot import Robot

_VALUES = 10  # of a key that are tried
_BACK = 4  # values that are planned in full before a key is given up
_LOWEST, _HIGHEST, _HEIGHTS = 0.5, 0.98, 17  # waist heights that are tried, of legs stretched down
_TOGETHER = (0.93, 0.87, 0.8)  # those that are tried with smaller moves
_SHARES = (0.75, 0.5, 0.25, 0.1)  # of stride, side, turn and lift together
_ANGLES = (0.1, 0.2, 0.3)  # rad: by which feet might turn about their edges
_NO_STEP = 10.0  # times the length of a leg: what no step is meant to be
_TOO = {"stride": "long", "side": "wide", "turn": "far", "lift": "high", "sway": "wide", "spread": "wide"}


def with_remedy(error: NoSolutionError, robot: Robot, gait: Gait, steps: int) -> NoSolutionError:
    """The error, its message completed by the keys of the gait to change and values that work.

    Args:
        error: of this walk.
        robot: the robot.
        gait: fitted to it.
        steps: of the walk.
    """
    if gait.places:
        said = [str(error), _listed(error, gait), _millimetres(robot, gait)]
        error.args = (". ".join(filter(None, said)), *error.args[1:])
        return error
    trial = _Trial(robot, gait, steps)
    limb = getattr(error, "limb", "")
    error.args = (f"{error}. {'; or '.join(_legs(trial, limb)) or _unknown(gait)}", *error.args[1:])
    return error


def _listed(error: NoSolutionError, gait: Gait) -> str:
    """Which foothold is being stepped onto where a limb fails, and what to change; else the error says so."""
    sample = getattr(error, "sample", -1)
    if sample < 0:
        return ""
    n = listed_step(gait, sample / gait.rate)
    place = gait.places[n]
    where = f"x {place.x:g}, y {place.y:g} m, yaw {math.degrees(math.remainder(place.yaw, math.tau)):.4g} deg"
    nearer = f"bring it nearer, or lower waist_height = {gait.waist_height:g}"
    return f"This is in step {n + 1}, onto {where}: {nearer}"


def _millimetres(robot: Robot, gait: Gait) -> str:
    """That lengths are in metres, where a step of a list is longer than any robot could mean."""
    ways = np.diff([(0.0, 0.0, 0.0), *((place.x, place.y, place.z) for place in gait.places)], axis=0)
    longest = float(np.abs(ways).max())
    if not longest > _NO_STEP * lengths_of(robot)["leg"]:
        return ""
    return f"Footholds are in metres: one lies {longest:g} m from the last; write 40*mm for millimetres"


@dataclass(frozen=True, eq=False)
class _Trial:
    """A gait, changed and planned anew."""

    robot: Robot
    gait: Gait
    steps: int

    @cached_property
    def lengths(self) -> Mapping[str, float]:
        """The robot's."""
        return lengths_of(self.robot)

    def reached(self, several: Sequence[Mapping[str, float]]) -> list[bool]:
        """Whether the limbs reach their targets in coarse walks of the gait with some numbers changed."""
        walks = coarse_walks(self.robot, [self.gait.replace(**changes) for changes in several], self.steps)
        return [walk is not None and walk.reached for walk in walks]

    def works(self, changes: Mapping[str, float]) -> bool:
        """Whether the robot follows the gait with some numbers changed."""
        try:
            follow(self.robot, self.gait.replace(**changes), self.steps, arms_of(self.robot))
        except ScrewkinError:
            return False
        return True

    def first(self, several: Sequence[Mapping[str, float]]) -> Mapping[str, float] | None:
        """The first of several changes with which the robot follows the gait."""
        promising = [changes for changes, good in zip(several, self.reached(several), strict=True) if good]
        return next((changes for changes in promising[:_BACK] if self.works(changes)), None)

    def value(self, key: str, easy: float) -> float | None:
        """The value of a key nearest to the gait's own that works, on the way to an easy one."""
        now = float(getattr(self.gait, key))
        if easy == now:
            return None
        unit = 10.0 ** math.floor(math.log10(abs(now - easy)) - 1)
        towards = math.floor if easy < now else math.ceil
        places = [now + (easy - now) * k / _VALUES for k in range(1, _VALUES)]
        values = [*(float(f"{unit * towards(place / unit):.6g}") for place in places), easy]
        good = self.first([{key: value} for value in values])
        return None if good is None else good[key]


def _legs(trial: _Trial, limb: str) -> Iterator[str]:
    """What to change so that the legs can follow: one of several keys, or all where none works by itself."""
    gait, found = trial.gait, 0
    moves = {key: 0.0 for key in ("stride", "side", "turn") if getattr(gait, key)}
    others = {"lift": 0.1 * gait.lift, "sway": 0.0, "spread": 0.0}
    stands = trial.reached([{**moves, "lift": others["lift"], "sway": 0.0}])[0]
    for key, easy in {**moves, **others}.items():
        tried = stands if key in moves else not found
        if tried and (good := trial.value(key, easy)) is not None:
            found += 1
            yield f"{key} {getattr(gait, key):g} is too {_TOO[key]}: {good:g} works"
    if not limb and (good := trial.value("spread", gait.spread + 0.5 * trial.lengths["hip"])) is not None:
        found += 1
        yield f"spread {gait.spread:g} is too narrow: {good:g} works"
    if limb and (sentence := _height(trial, limb)):
        found += 1
        yield sentence
    if not found:
        yield from _together(trial, moves)
    level = gait.kind != "geometric" and gait.toe == gait.heel == 0.0
    pitched = [{"toe": angle, "heel": angle} for angle in _ANGLES]
    if limb and level and (changes := trial.first(pitched)) is not None:
        yield f"soles stay level: toe and heel {changes['toe']:g} work"


def _height(trial: _Trial, limb: str) -> str:
    """The waist height that works, the nearest to the gait's own; empty if none does."""
    lengths, now = trial.lengths, trial.gait.waist_height
    shares = np.linspace(_LOWEST, _HIGHEST, _HEIGHTS)
    heights = [float(f"{share * lengths['leg'] + lengths['waist']:.3g}") for share in shares]
    nearest = sorted(heights, key=lambda height: abs(height - now))
    good = trial.first([{"waist_height": height} for height in nearest])
    if good is None:
        return ""
    height = good["waist_height"]
    reach = stretched(trial.robot, *(one.tip for one in trial.robot.limbs if one.name == limb))
    what = f"too {'low' if height > now else 'high'}"
    if now > reach:
        what = f"above what {limb or 'the legs'} reaches, {reach:.3g}"
    return f"waist_height {now:g} is {what}: {height:g} works"


def _together(trial: _Trial, moves: Mapping[str, float]) -> Iterator[str]:
    """Several keys at once, where none works by itself."""
    lengths, gait = trial.lengths, trial.gait
    several = []
    for share in _SHARES:
        smaller = {key: float(f"{share * getattr(gait, key):.3g}") for key in (*moves, "lift")}
        for height in _TOGETHER:
            waist = float(f"{height * lengths['leg'] + lengths['waist']:.3g}")
            several.append({**smaller, "waist_height": waist})
    good = trial.first(several)
    if good is not None:
        now = ", ".join(f"{key} {getattr(gait, key):g}" for key in good)
        listed = ", ".join(f"{key} {value:g}" for key, value in good.items())
        yield f"{now} do not fit together: {listed} work"


def _unknown(gait: Gait) -> str:
    """What to look at where no change was found that works."""
    keys = ("waist_height", "stride", "side", "turn", "lift", "sway", "spread")
    listed = ", ".join(f"{key} {getattr(gait, key):g}" for key in keys)
    return f"No change of one key works; the gait has {listed}"
