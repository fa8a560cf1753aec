"""The table of a humanoid, with what was read off it as comments where it stands."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from pathlib import Path

from screwkin.anatomy.record import Anatomy
from screwkin.model.toml_out import robot_toml

WIDTH = 108
HEAD = (
    "Limbs, soles and the posture home were read off the robot's geometry, without regard to names, each with"
    " a confidence from 0 to 1. Look them over, correct what is wrong, then take these comments out."
    " Units are m, kg, rad, s, N m; x points forward, y to the left, z up."
)


def commented_table(found: Anatomy, folder: Path | None = None) -> str:
    """The text of a table whose limbs, soles and home say how sure they are and why.

    Args:
        found: about a robot.
        folder: where the table will lie, so that meshes near it have short paths.
    """
    notes = {f'[[limb]]\nname = "{finding.about}"': finding for finding in found.limbs}
    notes |= {f'[[sole]]\nlimb = "{finding.about}"': finding for finding in found.soles}
    notes['[[posture]]\nname = "home"'] = found.home
    general = (found.symmetry, found.forward, found.waist)
    head = [HEAD, *map(str, general), *(f"Remark: {remark}" for remark in found.remarks)]
    blocks = ["\n".join(line for text in head for line in _comment(text))]
    for block in robot_toml(found.robot, folder).rstrip("\n").split("\n\n"):
        note = next((finding for start, finding in notes.items() if block.startswith(start)), None)
        blocks.append("\n".join([*(_comment(str(note)) if note else ()), block]))
    return "\n\n".join(blocks) + "\n"


def _comment(text: str) -> Iterator[str]:
    for line in textwrap.wrap(text, WIDTH, break_long_words=False, break_on_hyphens=False):
        yield f"# {line}"
