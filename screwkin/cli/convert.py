"""``screwkin convert``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated

import typer

from screwkin.analysis.chains import derived_tables
from screwkin.cli.options import AsJson
from screwkin.cli.output import print_json, remark, say, shortened
from screwkin.errors import InputError, TableError, one_of
from screwkin.files import atomic_write
from screwkin.model.coupled import coupling_text
from screwkin.model.dh import CONVENTIONS, Convention
from screwkin.model.dh_csv import dh_text, load_dh
from screwkin.model.dh_robot import robot_from_dh
from screwkin.model.mjcf_in import is_mjcf, parse_mjcf
from screwkin.model.robot import Robot
from screwkin.model.srdf import srdf_from_robot
from screwkin.model.table import load_robot
from screwkin.model.toml import read_text
from screwkin.model.toml_out import robot_toml
from screwkin.model.urdf import urdf_from_robot
from screwkin.model.urdf_in import load_urdf
from screwkin.model.urdf_joints import MIMICS, Mimic

_SRDF = "limbs, soles and postures stand in the SRDF file beside; URDF and SRDF hold no servos and parameters"
FORMATS = (".toml", ".urdf", ".csv")


def convert(
    source: Annotated[
        str,
        typer.Argument(
            metavar="IN", help="A bundled robot's name, or a .toml, .urdf, MJCF .xml or DH .csv file."
        ),
    ],
    target: Annotated[Path, typer.Argument(metavar="OUT", help="The .toml, .urdf or DH .csv file to write.")],
    convention: Annotated[
        str, typer.Option(metavar="NAME", help="Of a DH file to write: modified or standard.")
    ] = "modified",
    repair: Annotated[
        bool,
        typer.Option("--repair", help="Of a URDF to read: replace inertias that no body has by the nearest."),
    ] = False,
    mimic: Annotated[
        str,
        typer.Option(
            metavar="HOW",
            help="Joints of a URDF that follow others: couple them, or read them as free joints.",
        ),
    ] = "couple",
    as_json: AsJson = False,
) -> int:
    """Convert a robot between screw tables (.toml), URDF (.urdf) and Denavit-Hartenberg tables (.csv).

    What the target cannot hold is listed. Formulas and mirrored limbs are written out.
    """
    chosen = one_of("convention", convention, CONVENTIONS)
    suffix = target.suffix.lower()
    if suffix not in FORMATS:
        raise InputError(f"cannot write {target}: OUT must end with {', '.join(FORMATS)}")
    coupled = one_of("way to read mimic", mimic, MIMICS)
    robot, remarks = _read(source, repair, coupled)
    text, lost = _written(robot, target, chosen)
    with atomic_write(target) as file:
        file.write(text)
    if target.suffix.lower() == ".urdf" and (robot.limbs or robot.postures):
        with atomic_write(target.with_suffix(".srdf")) as file:
            file.write(srdf_from_robot(robot))
    remarks += lost
    if as_json:
        data = {"robot": robot.name, "file": str(target), "joints": robot.joint_names, "remarks": remarks}
        print_json(data)
    else:
        say(f"{target}: {robot.name}, {len(robot.links)} links, {len(robot.joints)} joints")
        for text in remarks:
            remark(shortened(f"remark: {text}"))
    return 0


def _read(source: str, repair: bool, mimic: Mimic) -> tuple[Robot, list[str]]:
    """The robot of a name or file, and remarks on what its format leaves open."""
    suffix = Path(source).suffix.lower()
    if suffix in (".urdf", ".xml"):
        text = read_text(Path(source), TableError)
        read = parse_mjcf(text, source, repair) if is_mjcf(text) else load_urdf(source, repair, mimic)
        return read.robot, list(read.remarks)
    if repair or mimic == "free":
        raise InputError(f"--repair and --mimic are for a URDF that is read, and {source} is none; edit it")
    if suffix == ".csv":
        robot = robot_from_dh(load_dh(source), Path(source).stem, source)
        return robot, ["DH tables hold no masses, limits and soles: add those that the robot has"]
    return load_robot(source), []


def _written(robot: Robot, target: Path, convention: Convention) -> tuple[str, list[str]]:
    """The text of a robot in the format of a file, and remarks on what is lost."""
    suffix = target.suffix.lower()
    writers: Mapping[str, Callable[[], str]] = {
        ".toml": lambda: robot_toml(robot, target.parent),
        ".urdf": lambda: urdf_from_robot(robot, target.parent),
        ".csv": lambda: dh_text(derived_tables(robot, convention)),
    }
    lost = {
        ".toml": [],
        ".urdf": [_SRDF] if robot.limbs or robot.postures else [],
        ".csv": ["DH tables hold the chains' geometry only: no masses, limits, soles and closures"],
    }
    if robot.coupled and suffix == ".csv":
        lost[suffix].append(f"these joints are free in it: {', '.join(map(coupling_text, robot.coupled))}")
    return writers[suffix](), lost[suffix]
