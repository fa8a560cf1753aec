"""The world of a row: drawn from its seed out of a spread, with some figures the same in every row.

Both stand in one text, words with blanks between them: ``x3`` is three times the usual spread,
``rise~5*mm`` draws one figure as ``Spread`` says, ``each_lag~1`` sets a switch, and ``rise=5*mm`` is a figure
of ``Perturbation`` as it stands, as ``validate --perturb`` takes it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from screwkin.errors import InputError, near
from screwkin.model.expression import ExpressionError, evaluate
from screwkin.model.robot import Robot
from screwkin.sim.drawn import NOWHERE, Spread, drawn_world
from screwkin.sim.perturbation import BY_NAME, DEFAULTS, NONE, Perturbation, by_name
from screwkin.sim.perturbation_files import perturbation_from_texts
from screwkin.trajectory import Trajectory

AS_PLANNED = "none"
"""The text of the planned world."""
USUAL: Mapping[str, Any] = vars(Spread())


def world_of(text: str, robot: Robot, seed: int, duration: float, distance: float) -> Perturbation:
    """The world in which a row is played.

    Args:
        text: see above, or ``none``.
        robot: whose links and joints differ.
        seed: of the row.
        duration: of the trajectory [s].
        distance: that it covers along x [m].

    Raises:
        InputError: a word is none, or a value is wrong.
    """
    if text == AS_PLANNED:
        return NONE
    words = text.split()
    fixed = [word for word in words if "=" in word]
    world = drawn_world(
        robot, seed, spread_of([word for word in words if "=" not in word]), duration, distance
    )
    own = perturbation_from_texts(fixed)
    return replace(world, **{key: getattr(own, key) for key in own.to_dict()})


def world_along(text: str, robot: Robot, seed: int, trajectory: Trajectory) -> Perturbation:
    """The world in which a walk is played: as ``world_of``, for its duration and as far as its base goes."""
    x = trajectory.T_world_base[:, 0, 3]
    return world_of(text, robot, seed, trajectory.duration, float(np.abs(x - x[0]).max()))


def check_world(text: str, robot: Robot) -> None:
    """Refuse what no row could be played in.

    Raises:
        InputError: a word is none, a value is wrong, or a name is none of the robot's.
    """
    world = world_of(text, robot, 0, 1.0, 0.0)
    for key in BY_NAME:
        names, what = (robot.link_names, "link") if key == "mass" else (robot.joint_names, "joint")
        by_name(getattr(world, key), names, DEFAULTS[key], what)


def spread_of(words: Sequence[str]) -> Spread:
    """The spread of ``xN`` and ``KEY~VALUE`` words; what none of them names is as planned.

    Raises:
        InputError: a word or a value is wrong.
    """
    spread = NOWHERE
    for word in words:
        if scale := re.fullmatch(r"x(\d+\.?\d*|\.\d+)", word):
            if spread != NOWHERE:
                raise InputError(
                    f"--perturb {word}: the usual spread comes first, what differs from it after"
                )
            spread = Spread().scaled(float(scale[1]))
            continue
        key, about, value = word.partition("~")
        if not (about and value):
            raise InputError(
                f"--perturb {word!r} is none; write x1 for the usual spread, KEY~VALUE to draw a figure, or "
                "KEY=VALUE for the same in every row"
            )
        if key not in USUAL:
            raise InputError(
                f"--perturb {word}: no figure to draw. {near(key, USUAL)}Valid: {', '.join(USUAL)}"
            )
        spread = replace(spread, **{key: _value(word, USUAL[key], value)})
    return spread


def _value(word: str, usual: Any, text: str) -> Any:
    """A switch, the two ends of a range, or a number: what the usual value is."""
    if isinstance(usual, bool):
        if text not in ("0", "1"):
            raise InputError(f"--perturb {word}: a switch is 1 or 0")
        return text == "1"
    parts = text.split(":")
    try:
        numbers = [float(evaluate(part, {})) for part in parts]
    except ExpressionError as error:
        raise InputError(f"--perturb {word}: {error}") from None
    if isinstance(usual, tuple):
        if len(numbers) > 2 or numbers != sorted(numbers):
            raise InputError(f"--perturb {word}: write LEAST:GREATEST")
        return numbers[0], numbers[-1]
    if len(numbers) != 1 or numbers[0] < 0:
        raise InputError(f"--perturb {word}: one number of at least 0 says how far it may lie from the plan")
    return numbers[0]
