"""``screwkin codegen``."""

from __future__ import annotations

from typing import Annotated

import typer

from screwkin.cli.folder import output_folder
from screwkin.cli.options import AsJson, OutputFolder, RobotName
from screwkin.cli.output import print_json, say
from screwkin.export.codegen import KINDS, c_files, programs_of
from screwkin.files import atomic_write
from screwkin.model.table import load_robot


def codegen(
    robot: RobotName,
    what: Annotated[
        str, typer.Option(metavar="KINDS", help=f"Of {', '.join(KINDS)}, with commas between.")
    ] = "ik,rates,zmp",
    single: Annotated[bool, typer.Option("--float", help="Numbers of type float, not double.")] = False,
    output: OutputFolder = None,
    as_json: AsJson = False,
) -> int:
    """Write a robot's formulas as self-contained C99, with a header, a test driver and a README."""
    loaded = load_robot(robot)
    programs = programs_of(loaded, [kind.strip() for kind in what.split(",") if kind.strip()])
    files = c_files(loaded, programs, "float" if single else "double")
    with output_folder(output, "codegen", loaded.name) as folder:
        for name, text in files.items():
            with atomic_write(folder / name) as file:
                file.write(text)
    counts = {program.name: program.operations for program in programs}
    if as_json:
        print_json({"robot": loaded.name, "files": list(files), "operations": counts})
    else:
        for name, count in counts.items():
            say(f"{name}: {count} operations a sample")
        say(f"files in {folder}: {', '.join(files)}")
    return 0
