"""Lists of footsteps: from numbers or a file to a gait that walks them."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from screwkin.errors import Fault, GaitError, InputError, near
from screwkin.gait.footsteps import footholds
from screwkin.gait.keys import CHOICES
from screwkin.gait.lead import LEAD, SAME, side_by_side
from screwkin.gait.places import HEIGHT, KEYS, StepEnd, read_places
from screwkin.gait.record import Gait, Side, gait_from_dict
from screwkin.gait.stance import Stance
from screwkin.model.toml import read_text

FOOT = "foot"
"""Column of a file that says which foot swings; it may be left out."""


@dataclass(frozen=True)
class Footsteps:
    """Where a walk's steps end, one after the other, feet alternating; from ``footsteps``.

    places: of the foot that swings, on the floor. first: the foot that swings first.
    """

    places: tuple[StepEnd, ...]
    first: Side = "right"

    def __len__(self) -> int:
        return len(self.places)


def footsteps(places: Iterable[Sequence[float]], first: Side = "right") -> Footsteps:
    """Footholds to walk on, for ``walk(robot, gait, footsteps)``.

    The robot starts with its feet side by side, the middle between them over the origin, facing along x.

    Args:
        places: (x, y, yaw) or (x, y, yaw, z) of every step, x, y, z [m] and yaw [rad] of the frame of the
            foot that swings, in the frame of the floor, which is the world's on a level one; feet alternate.
            A yaw is meant as the one nearest to that of the step before. Under every foothold that is
            higher than the lowest (the start is at 0) the plan supposes a block just larger than the sole.
        first: ``right`` or ``left``: the foot that swings first.

    Returns:
        Footsteps.

    Raises:
        GaitError: no step at all, or numbers that are none; it names the step. InputError: another foot.

    Example:
        >>> import screwkin as sk
        >>> steps = sk.footsteps([(0.05, -0.04, 0.0), (0.05, 0.04, 0.0)])
        >>> robot = sk.load_robot(sk.robot_names()[0])
        >>> bool(sk.walk(robot, sk.load_gait("preview"), steps).margin.min() > 0)
        True
    """
    if str(first) not in CHOICES["first"]:
        raise InputError(f"first is {first!r}; expected 'right' or 'left'")
    rows = [_row(i, place) for i, place in enumerate(places)]
    return _read(rows, first, "footsteps")


def load_footsteps(path: str | Path, first: Side | None = None) -> Footsteps:
    """The footsteps of a CSV file with the columns ``x, y, yaw`` and, if wanted, ``z`` [m, rad] and ``foot``.

    Args:
        path: of the file. Numbers may be formulas, such as ``10*deg``. With ``foot`` feet must alternate.
        first: the foot that swings first where the file has no ``foot``, by default the right one; a file
            that says otherwise is refused.

    Raises:
        GaitError: the file cannot be read, or rows are wrong; all faults are named at once.
    """
    lines = list(csv.reader(io.StringIO(read_text(Path(path), GaitError)), skipinitialspace=True))
    rows = [(i, line) for i, line in enumerate(lines, 1) if any(cell.strip() for cell in line)]
    names = [name.strip() for name in rows[0][1]] if rows else []
    known = [*KEYS, HEIGHT, FOOT]
    faults = [
        Fault("row 1", name, "unknown column", f"{near(name, known)}Valid: {', '.join(known)}")
        for name in names
        if name not in known
    ]
    faults += [
        Fault("row 1", key, "missing column", "Begin with a row x,y,yaw") for key in KEYS if key not in names
    ]
    faults += [
        Fault(f"row {i}", "", f"{len(line)} cells for {len(names)} columns", "Give every column a cell")
        for i, line in rows
        if len(line) != len(names)
    ]
    if faults:
        raise GaitError(str(path), faults)
    table = [dict(zip(names, (cell.strip() for cell in line), strict=True)) for _, line in rows[1:]]
    feet = [row.pop(FOOT, "") for row in table]
    begins = feet[0] if feet and feet[0] else first or "right"
    other = {"right": "left", "left": "right"}
    wanted = [begins if i % 2 == 0 else other.get(begins, "") for i in range(len(feet))]
    wrong = [
        Fault(f"row {i}", FOOT, f"{foot!r} where the {side or 'right or left'} foot swings", "Feet alternate")
        for (i, _), foot, side in zip(rows[1:], feet, wanted, strict=True)
        if foot not in ("", side) or begins not in other
    ]
    if first is not None and begins != first and not wrong:
        fix = f"Leave first = {first} out, or write {first} there and alternate from it"
        wrong = [Fault(f"row {rows[1][0]}", FOOT, f"{begins!r}, but first = {first} is asked for", fix)]
    if wrong:
        raise GaitError(str(path), wrong)
    return _read(table, cast(Side, begins), str(path))


def with_footsteps(gait: Gait, steps: Footsteps) -> Gait:
    """The gait that steps onto listed footholds, from home to home, and is in all else as given.

    Args:
        gait: of kind ``preview`` or ``footsteps``: the waist of others follows key points, not the feet. Its
            ``lead`` is 1 s where it says nothing.
        steps: from ``footsteps`` or ``load_footsteps``.

    Raises:
        GaitError: a gait of another kind.
    """
    check_follows_feet(gait)
    document = gait.to_dict()
    document["gait"] = {"lead": LEAD, **document["gait"], "kind": "footsteps", "first": steps.first}
    document["foothold"] = [place.to_dict() for place in steps.places]
    return gait_from_dict(document, gait.path)


def check_follows_feet(gait: Gait) -> None:
    """Refuse a gait that does not go where its feet are set.

    Raises:
        GaitError: its kind is ``geometric``.
    """
    if gait.kind == "geometric":
        found = "a gait of kind 'geometric' moves its waist by key points, wherever the feet are"
        fix = 'Give one of kind "preview" or "footsteps"'
        raise GaitError(gait.path or f"gait {gait.name}", [Fault("[gait]", "kind", found, fix)])


def closed(gait: Gait, stance: Stance, steps: int) -> tuple[Gait, int]:
    """The gait of so many steps of a list, and one more where it ends at home but its feet do not stand so.

    Args:
        gait: fitted to the robot; others than lists, and those without ``lead``, stay as they are.
        stance: of the robot.
        steps: of the list that are walked.
    """
    if not (gait.places and gait.lead) or steps > len(gait.places):
        return gait, steps
    holds = footholds(gait, stance, steps)
    last = next(hold for hold in reversed(holds) if hold.foot != holds[-1].foot)
    place = side_by_side(stance, holds)
    apart = (last.x - place.x, last.y - place.y, last.z - place.z, last.yaw - place.yaw)
    document = gait.to_dict()
    document["foothold"] = document["foothold"][:steps]
    if max(map(abs, apart)) > SAME:
        document["foothold"].append(place.to_dict())
    return gait_from_dict(document, gait.path), len(document["foothold"])


def _row(i: int, place: Any) -> dict[str, Any]:
    try:
        values = [float(value) for value in place]
    except (TypeError, ValueError):
        values = []
    if len(values) not in (len(KEYS), len(KEYS) + 1):
        fix = "Expected (x, y, yaw) or (x, y, yaw, z), lengths [m] and an angle [rad]"
        raise GaitError("footsteps", [Fault(f"step {i + 1}", "", f"{place!r} is no foothold", fix)])
    return dict(zip((*KEYS, HEIGHT), values, strict=False))


def _read(rows: Sequence[dict[str, Any]], first: Side, where: str) -> Footsteps:
    faults: list[Fault] = []
    places = read_places(rows, {}, frozenset(), faults)
    if not rows:
        faults.append(Fault("steps", "", "none is listed", "Give one foothold at least"))
    if faults:
        raise GaitError(where, faults)
    return Footsteps(places, first)
