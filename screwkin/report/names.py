"""Names of the files that reports of motions are made of, and how those of earlier results go."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

PAGE, FILM = "report.html", "walk.gif"
PICTURES = (
    *("frames", "top_view", "feet_x", "feet_z", "waist_x", "waist_y", "joints", "joints_arms"),
    *("singular_values", "zmp_y", "zmp_x", "margin", "contact_zmp", "upright", "servos", "tracking"),
)
"""Names, without suffix, of all pictures that reports of motions have."""


SIMULATED = ("contact_zmp", "upright", "servos", "tracking")
"""Those of them that show a simulation, or servos, and not the plan."""


def remove_reports(folder: Path) -> tuple[str, ...]:
    """Remove page, pictures and film of earlier results, which are not those of the numbers to come.

    Args:
        folder: that may hold some; other files stay.

    Returns:
        Names of the files that were removed.
    """
    return _removed(folder, (PAGE, FILM, *_pictures(PICTURES)))


def remove_simulated(folder: Path) -> tuple[str, ...]:
    """Remove what another simulation of the same trajectory makes untrue; pictures of the plan stay.

    The frames are those of a simulation where other pictures of one lie beside them.

    Args:
        folder: that may hold some; other files stay.

    Returns:
        Names of the files that were removed.
    """
    simulated = any((folder / name).exists() for name in _pictures(SIMULATED))
    frames = ("frames",) if simulated else ()
    return _removed(folder, (PAGE, FILM, *_pictures((*SIMULATED, *frames))))


def _pictures(plots: Iterable[str]) -> tuple[str, ...]:
    return tuple(f"{plot}.png" for plot in plots)


def _removed(folder: Path, names: Iterable[str]) -> tuple[str, ...]:
    there = tuple(name for name in names if (folder / name).exists())
    for name in there:
        (folder / name).unlink(missing_ok=True)
    return there
