"""What ``walk --compensate`` makes beside the plan: commands that allow for elastic servos."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import typer

from screwkin.cli.output import aligned
from screwkin.compliance.springs import joint_stiffness
from screwkin.errors import InputError, one_of
from screwkin.files import make_folder
from screwkin.gait.compensation import WAYS, Remaining, Way, compensate_walk, convergence
from screwkin.model.robot import Robot
from screwkin.trajectory import Trajectory

CompensateBy = Annotated[
    str | None,
    typer.Option(
        metavar="|".join(WAYS),
        help="Also commands for elastic servos: correct the foot in the air, or all joints by statics or by "
        "the torques of the walk.",
    ),
]
Passes = Annotated[int | None, typer.Option(help="Of the compensation; default: 1.")]
ServoStiffness = Annotated[
    float | None,
    typer.Option(
        "-k", "--stiffness", help="Of the servos to compensate for [N m/rad]; default: the table's."
    ),
]

FOLDER = "compensated"
"""The folder of the commands, beside the plan: both are trajectories with a verdict of their own."""


@dataclass(frozen=True)
class Remedy:
    """How commands are to be compensated; ``stiffness`` None is the table's."""

    way: Way
    passes: int
    stiffness: float | None

    @property
    def words(self) -> list[str]:
        """The options that ask for it."""
        words = ["--compensate", self.way, "--passes", str(self.passes)]
        return words + ([] if self.stiffness is None else ["--stiffness", f"{self.stiffness:g}"])


def remedy(robot: Robot, way: str | None, passes: int | None, stiffness: float | None) -> Remedy | None:
    """The remedy that a command line asks for, if any.

    Raises:
        UnknownNameError: no such remedy. InputError: a number is out of range, or for no remedy at all.
    """
    if way is None:
        for option, value in (("--passes", passes), ("--stiffness", stiffness)):
            if value is not None:
                raise InputError(f"{option} is of a compensation; add --compensate {', '.join(WAYS)}")
        return None
    chosen = one_of("compensation", way, tuple(WAYS))
    if passes is not None and passes < 1:
        raise InputError(f"--passes is {passes}; it must be a whole number of at least 1")
    joint_stiffness(robot, stiffness)
    return Remedy(chosen, passes or 1, stiffness)


@dataclass(frozen=True)
class Compensated:
    """The commands, their file, and what every pass leaves of the static error of the foot in the air."""

    remedy: Remedy
    trajectory: Trajectory
    path: Path
    rows: Sequence[Remaining]

    def to_dict(self) -> dict[str, Any]:
        """Its numbers as JSON data."""
        return {
            **asdict(self.remedy),
            "trajectory": str(self.path),
            "trajectory_sha256": self.trajectory.sha256,
            "convergence": [asdict(row) for row in self.rows],
        }

    def save(self) -> None:
        """Write the commands as ``.npz`` and ``.csv``."""
        make_folder(self.path.parent)
        for ending in (".npz", ".csv"):
            self.trajectory.save(self.path.with_suffix(ending))

    def text(self) -> str:
        """The table of its passes."""
        head = f"commands compensated by {self.remedy.way} in {self.path}"
        if not self.rows:
            return f"{head}\n  led by the torques of the walk itself: nothing static to converge to"
        lines: list[Sequence[str]] = [("passes", "x", "y", "z", "largest", "removed")]
        lines += [
            (
                str(row.passes),
                *(f"{value:.2g} mm" for value in (*row.largest_mm, row.norm_mm)),
                f"{100 * row.removed:.2f} %",
            )
            for row in self.rows
        ]
        return f"{head}\n  static error of the foot in the air after each pass:\n{aligned(lines, '  ')}"


def compensated(
    robot: Robot, trajectory: Trajectory, wanted: Remedy, command: str, folder: Path
) -> Compensated:
    """The commands, to be written into a folder of their own in ``folder``.

    Raises:
        NoSolutionError, LimitError: such servos cannot be compensated. Others as of ``compensate_walk``.
    """
    method, model = WAYS[wanted.way]
    commands = compensate_walk(robot, trajectory, wanted.stiffness, method, wanted.passes, model)
    commands = replace(commands, meta={**commands.meta, "command": command})
    rows: Sequence[Remaining] = ()
    if model != "dynamic":
        rows = convergence(robot, trajectory, wanted.stiffness, wanted.passes, method, model)
    return Compensated(wanted, commands, folder / FOLDER / "trajectory.npz", rows)
