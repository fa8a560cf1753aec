"""Robots from files and texts of every format: screw tables, URDF, MJCF, Denavit-Hartenberg tables."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path

from screwkin.errors import Fault, InputError, RobotRemark, TableError, UnknownNameError, expect
from screwkin.model.inertias import impossible
from screwkin.model.library import find_robot
from screwkin.model.robot import Robot
from screwkin.model.toml import read_text


def load_robot(name_or_path: str | Path, symbolic: bool = False) -> Robot:
    """The robot of a bundled name, or of a file: ``.toml``, ``.urdf``, MJCF ``.xml``, or a DH ``.csv``.

    What a URDF file says and a table cannot is a warning (``RobotRemark``), as is an inertia that breaks the
    triangle inequality; ``model.urdf_in.load_urdf`` returns the remarks.

    Args:
        name_or_path: such as ``"linkages/four-bar"`` or ``"my/robot.toml"``, or a folder with one URDF file.
        symbolic: keep the table's parameters as sympy symbols; for a ``.toml`` only.

    Returns:
        The checked robot, every length in [m], mass in [kg], angle in [rad].

    Raises:
        UnknownNameError: no such robot or file; it lists the bundled names.
        TableError: the file cannot be read or has faults; it lists all of them.
        InputError: not a name or a path.

    Example:
        >>> import screwkin as sk
        >>> sk.load_robot("linkages/four-bar").joint_names
        ('crank', 'crank_pin', 'rocker_pin', 'rocker')
    """
    expect(name_or_path, (str, Path), "name_or_path", "a bundled robot's name or the path of a file")
    path = _file_in(find_robot(name_or_path))
    if path.suffix.lower() == ".csv":
        from screwkin.model.dh_csv import load_dh
        from screwkin.model.dh_robot import robot_from_dh

        _only_numbers(symbolic, str(path), "a DH table")
        return robot_from_dh(load_dh(path), path.stem, str(path))
    return _read(read_text(path, TableError), str(path), symbolic, path)


def _file_in(path: Path) -> Path:
    """The one URDF file of a folder, such as a package of ROS; else the path itself."""
    files = (
        sorted(file for file in path.rglob("*") if file.suffix.lower() == ".urdf") if path.is_dir() else []
    )
    if len(files) > 1:
        raise UnknownNameError("robot, for a folder with several,", str(path), [str(file) for file in files])
    return files[0] if files else path


def robot_from_text(text: str, name: str = "<text>", symbolic: bool = False) -> Robot:
    """The robot of a text: a screw table in TOML, or URDF or MJCF, which begin with ``<``.

    Args:
        text: the content of such a file.
        name: where it comes from, for messages and for ``Robot.path``.
        symbolic: keep the table's parameters as sympy symbols; for TOML only.

    Returns:
        The checked robot, every length in [m], mass in [kg], angle in [rad].

    Raises:
        TableError: the text has faults; it lists all of them.
        InputError: not a text, or symbols asked of URDF.

    Example:
        >>> import screwkin as sk
        >>> sk.robot_from_text(sk.load_robot("linkages/four-bar").text).name
        'four-bar'
    """
    expect(text, str, "text", "the content of a robot's file, or call load_robot with its path")
    return _read(text, name, symbolic)


parse_robot = Robot.from_text


def _read(text: str, name: str, symbolic: bool, path: Path | None = None) -> Robot:
    """The robot of a text in TOML or XML, of a file or not; remarks are warnings to its caller's caller."""
    if text.lstrip("\ufeff \t\r\n").startswith("<"):
        from screwkin.model.mjcf_in import is_mjcf, parse_mjcf
        from screwkin.model.srdf import find_srdf
        from screwkin.model.urdf_in import parse_urdf

        _only_numbers(symbolic, name, "URDF")
        if is_mjcf(text):
            read = parse_mjcf(text, name)
        else:
            read = parse_urdf(text, name, srdf=find_srdf(path) if path else None)
        robot, remarks = read.robot, read.remarks
    else:
        _refuse_no_table(text, name)
        robot = parse_robot(text, name, symbolic)
        remarks = () if robot.is_symbolic else tuple(_inertia_remarks(robot))
    for remark in remarks:
        warnings.warn(f"{name}: {remark}", RobotRemark, stacklevel=3)
    return robot


def _refuse_no_table(text: str, name: str) -> None:
    """Nothing at all, and a text without a tag in a file whose name promises XML, are no faulty tables."""
    if not text.strip("\ufeff\0 \t\r\n"):
        raise TableError(name, [Fault("file", "", "is empty", "Give a screw table, URDF or MJCF")])
    if name.lower().endswith((".urdf", ".xml", ".xacro")):
        begins = text.split()[0][:40]
        fix = "Expected XML: <robot ...> or <mujoco ...>"
        raise TableError(name, [Fault("file", "", f"begins with {begins!r}", fix)])


def _inertia_remarks(robot: Robot) -> Iterator[str]:
    """Links with inertias that no body can have, though every formula takes them."""
    for link in robot.links:
        if found := impossible(link.inertia):
            yield f"link {link.name}, key inertia: {found}. Give the inertia about the CoM in base axes"


def _only_numbers(symbolic: bool, name: str, what: str) -> None:
    if symbolic:
        raise InputError(
            f"{name}: {what} has no parameters to keep as symbols; convert it to a .toml and name them"
        )
