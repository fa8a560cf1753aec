"""Names of the files that reports of motions are made of, and how those of earlier results go."""

from __future__ import annotations

from pathlib import Path

PAGE, FILM = "report.html", "walk.gif"
PICTURES = (
    *("frames", "top_view", "feet_x", "feet_z", "waist_x", "waist_y", "joints", "joints_arms"),
    *("singular_values", "zmp_y", "zmp_x", "margin", "contact_zmp", "upright", "servos", "tracking"),
)
"""Names, without suffix, of all pictures that reports of motions have."""


def remove_reports(folder: Path) -> None:
    """Remove page, pictures and film of earlier results, which are not those of the numbers to come.

    Args:
        folder: that may hold some; other files stay.
    """
    for name in (PAGE, FILM, *(f"{plot}.png" for plot in PICTURES)):
        (folder / name).unlink(missing_ok=True)
