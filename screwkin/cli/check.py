"""``screwkin check``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from screwkin.analysis.audit import added_by_pybullet, audit
from screwkin.analysis.remark import LEVELS, Level, Remark
from screwkin.anatomy.humanoid import anatomy
from screwkin.cli.options import AsJson, RobotName
from screwkin.cli.output import print_json, say
from screwkin.errors import ScrewkinError, TableError
from screwkin.model.robot import Robot
from screwkin.model.table import load_robot
from screwkin.model.toml import read_text
from screwkin.model.urdf_xml import links_without_inertia

_NO = 3
_COUNTED: dict[Level, str] = {"error": "error", "warning": "warning", "info": "remark"}
_ADVICE = "screwkin new writes the table with it, to be edited"


def check(robot: RobotName, as_json: AsJson = False) -> int:
    """Audit a robot: masses, inertias, limits, axes, symmetry, soles, loops, and what simulators change.

    Exit code 3 if a remark is an error: dynamics or walks of such a robot cannot be believed.
    """
    table = load_robot(robot)
    remarks = _remarks(table)
    counts = {level: sum(remark.level == level for remark in remarks) for level in LEVELS}
    if as_json:
        found = [remark.to_dict() for remark in remarks]
        print_json({"robot": table.name, "remarks": found, "counts": counts, "passed": not counts["error"]})
    else:
        for line in _lines(remarks):
            say(line)
        words = {level: word if counts[level] == 1 else f"{word}s" for level, word in _COUNTED.items()}
        say(f"{table.name}: " + ", ".join(f"{counts[level]} {word}" for level, word in words.items()))
    return _NO if counts["error"] else 0


def _lines(remarks: Sequence[Remark]) -> list[str]:
    """Remarks as they are read: those that differ in their place alone as one, advice on one place once."""
    places: dict[tuple[Level, str, str], list[str]] = {}
    for remark in remarks:
        places.setdefault((remark.level, remark.what, remark.advice), []).append(remark.place)
    read = [Remark(level, ", ".join(at), what, advice) for (level, what, advice), at in places.items()]
    last = {(remark.place, remark.advice): remark for remark in read}
    return [
        str(remark if last[remark.place, remark.advice] is remark else replace(remark, advice="")).rstrip()
        for remark in read
    ]


def _remarks(robot: Robot) -> tuple[Remark, ...]:
    """Those of the robot, with its limbs if they can be found, and of what tables do not have of its URDF."""
    more = []
    path = Path(robot.path)
    if path.suffix.lower() == ".urdf" and path.is_file():
        massless = links_without_inertia(read_text(path, TableError), str(path))
        if added := added_by_pybullet(massless, float(robot.mass)):
            more.append(added)
    if not robot.limbs and robot.base == "floating":
        try:
            found = anatomy(robot)
            robot = found.robot
            more += [
                Remark("info", "anatomy", str(finding).rstrip("."), _ADVICE) for finding in found.findings
            ]
            more += [Remark("info", "anatomy", text.rstrip("."), _ADVICE) for text in found.remarks]
        except ScrewkinError as error:
            more.append(Remark("info", "anatomy", str(error), "No walk without limbs, soles and home"))
    return tuple(sorted((*more, *audit(robot)), key=lambda remark: LEVELS.index(remark.level)))
