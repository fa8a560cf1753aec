"""``screwkin compare``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from screwkin.analysis.compare import Comparison, compare_models
from screwkin.cli.folder import output_folder
from screwkin.cli.options import AsJson, OutputFolder, RobotName
from screwkin.cli.output import aligned, drawn, print_json, remark, say
from screwkin.files import atomic_write
from screwkin.model.dh_csv import dh_text
from screwkin.model.table import load_robot

_WAYS = {
    "screw": "screws, the textbook's displacements",
    "screw_best_reference": "screws, best reference frame",
    "library": "screws, the library's chain",
    "dh": "DH frames",
}


def compare(
    robot: RobotName,
    samples: Annotated[
        int, typer.Option(help="Random joint positions at which the models are compared.")
    ] = 1000,
    rounds: Annotated[int, typer.Option(help="Alternating rounds of time measurement.")] = 21,
    plots: Annotated[bool, typer.Option(help="Draw what misaligned axes do to either model.")] = True,
    output: OutputFolder = None,
    as_json: AsJson = False,
) -> int:
    """Compare the screw model of a robot with its Denavit-Hartenberg model.

    Writes dh.csv (the tables: those beside the robot's file, the others derived) and misalignment.png. Exit
    code 3 if the models disagree by more than 1e-9.
    """
    table = load_robot(robot)
    with output_folder(output, "compare", table.name) as folder:
        comparison = compare_models(table, samples, rounds)
        files = _write(comparison, folder, plots)
    if as_json:
        print_json({**comparison.to_dict(), "folder": str(folder)})
    else:
        say(_text(comparison))
        say(f"files in {folder}: {', '.join(path.name for path in files)}")
    agree = max(comparison.fk_max_abs, comparison.jacobian_max_abs) <= 1e-9
    if not agree:
        remark("the DH tables do not describe this robot")
    return 0 if agree else 3


def _write(comparison: Comparison, folder: Path, plots: bool) -> list[Path]:
    files = [folder / "dh.csv"]
    with atomic_write(files[0]) as file:
        file.write(dh_text([chain.table for chain in comparison.chains]))
    series = comparison.misalignment
    if plots and series is not None:
        from screwkin.report.misalignment import save_misalignment

        files += drawn(lambda: [save_misalignment(series, folder / "misalignment.png")])
    return files


def _text(comparison: Comparison) -> str:
    printed = [chain.name for chain in comparison.chains if chain.printed]
    others = "" if len(printed) == len(comparison.chains) else ", the others derived"
    tables = f"of {', '.join(printed)} from file{others}" if printed else "derived from the screws"
    numbers = comparison.parameters
    rows: list[Sequence[object]] = [
        ("", "DH", "screws"),
        ("largest difference of a tip's pose", f"{comparison.fk_max_abs:.1e}", ""),
        ("largest difference of a Jacobian", f"{comparison.jacobian_max_abs:.1e}", ""),
        (
            "models for a walk" if comparison.dh_models > 1 else "models",
            comparison.dh_models,
            comparison.screw_models,
        ),
        ("Jacobians", comparison.dh_jacobians, comparison.screw_jacobians),
        ("numbers in one model", numbers["dh_per_model"], numbers["screw"]),
        ("  of these not zero", numbers["dh_not_zero"], numbers["screw_not_zero"]),
        ("numbers in all models", numbers["dh"], numbers["screw"]),
        (
            "change of numbers per change of axes",
            *(f"{comparison.sensitivity[way]:.1e}" for way in ("dh", "screw")),
        ),
    ]
    parts = [
        f"{comparison.robot}: DH tables {tables}",
        aligned(rows, "  "),
        "",
        _ways(comparison),
        _tilt(comparison),
    ]
    return "\n".join(part for part in parts if part is not None)


def _ways(comparison: Comparison) -> str:
    """Operations and times by way of computing."""
    rows: list[Sequence[object]] = [
        ("operations of the program", "FK", "Jacobian", "both", "time", "DH's time over it")
    ]
    for way, name in _WAYS.items():
        count = comparison.operations[way]
        seconds = comparison.seconds.get(way)
        time = f"{1e6 * seconds:.0f} us" if seconds else ""
        ratio = f"{comparison.seconds['dh'] / seconds:.2f}" if seconds else ""
        rows.append((f"  {name}", count["fk"], count["jacobian"], count["both"], time, ratio))
    return aligned(rows, "  ")


def _tilt(comparison: Comparison) -> str | None:
    """What the smallest tilt does, in words."""
    series = comparison.misalignment
    if series is None:
        return None
    length = max(series.dh_length)
    return (
        f"\n  {series.joints[1]} tilted by {series.tilt[-1]:.0e} rad against {series.joints[0]}: "
        f"a DH length changes by {length:.1e} m, a number of the screw table by {series.screw_change[-1]:.0e}"
    )
