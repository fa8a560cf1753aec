"""``screwkin bus identify``: the figures of a servo's motor, from logs of a bench."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from screwkin.cli.folder import output_folder
from screwkin.cli.options import AsJson, OutputFolder
from screwkin.cli.output import aligned, print_json, progress_bar, remark, say
from screwkin.errors import InputError, one_of
from screwkin.files import atomic_write
from screwkin.model.table import load_robot
from screwkin.motors.bench import BenchLog, load_bench_log
from screwkin.motors.identify import FRICTIONS, Identification, identify
from screwkin.motors.library import load_motor, motor_text
from screwkin.servo.bench import bench_log_of_play

FILE = "motor.toml"
"""Name of the file with the identified model."""


def bus_identify(
    logs: Annotated[
        list[Path], typer.Argument(metavar="LOG...", help="Logs of a bench (.json), or play.npz of a send.")
    ],
    model: Annotated[str, typer.Option(help="Servo model to start from; default: the one in the logs.")] = "",
    friction: Annotated[str, typer.Option(help=f"Friction model: {', '.join(FRICTIONS)}.")] = "m3",
    hold_back: Annotated[
        list[Path] | None,
        typer.Option(metavar="LOG", help="Only compare with this one; default: half of four or more logs."),
    ] = None,
    bench: Annotated[str, typer.Option(help="Table of the bench, for play.npz: one joint, fixed base.")] = "",
    output: OutputFolder = None,
    as_json: AsJson = False,
) -> int:
    """Fit torque constant, resistance, rotor inertia, greatest current, lag and friction of a servo to logs.

    Writes motor.toml, whose path can stand for a servo model in a robot's table or in validate --servo. Gain,
    dead zone and punch of the firmware are those of the model to start from.
    """
    read = {path: _log(path, bench) for path in (*logs, *(hold_back or ()))}
    held = list(hold_back) if hold_back else [path for i, path in enumerate(logs) if _is_held(i, len(logs))]
    fitted = [read[path] for path in logs if path not in held]
    start = load_motor(model or _model([log.model for log in read.values()]))
    chosen = one_of("--friction", friction, tuple(FRICTIONS))
    with progress_bar("identification") as done:
        found = identify(start, fitted, [read[path] for path in held], chosen, done)
    with output_folder(output, "identify", found.model.model) as folder:
        path = folder / FILE
    with atomic_write(path) as file:
        file.write(motor_text(found.model))
    _print(found, path, as_json)
    return 0


def _is_held(i: int, count: int) -> bool:
    """Half of four or more: the middle two of every four, so that both halves have what alternates."""
    return count >= 4 and i % 4 in (1, 2)


def _log(path: Path, bench: str) -> BenchLog:
    if path.suffix != ".npz":
        return load_bench_log(path)
    if not bench:
        raise InputError(f"{path} does not say what hung on the servo; give the bench's table with --bench")
    return bench_log_of_play(path, load_robot(bench))


def _model(named: Sequence[str]) -> str:
    models = sorted(set(named) - {""})
    if len(models) != 1:
        which = f"are of {', '.join(models)}" if models else "name no servo model"
        raise InputError(f"the logs {which}; say with --model which one to start from")
    return models[0]


def _mean(errors: Mapping[str, float]) -> float | None:
    return float(np.mean(list(errors.values()))) if errors else None


def _print(found: Identification, path: Path, as_json: bool) -> None:
    fitted, held = _mean(found.fitted), _mean(found.held_back)
    motor = {name: value for name, value in asdict(found.model.motor).items() if name != "friction"}
    if as_json:
        figures: dict[str, Any] = {k: v if np.isfinite(v) else None for k, v in motor.items()}
        print_json(
            {
                "model": found.model.model,
                "friction_model": found.friction,
                "motor": figures,
                "friction": asdict(found.model.motor.friction),
                "offset": found.offset,
                "fitted": dict(found.fitted),
                "held_back": dict(found.held_back),
                "mean_fitted": fitted,
                "mean_held_back": held,
                "profile": str(path),
            }
        )
        return
    say(f"{found.model.model}, friction {found.friction}: mean absolute position error from the goals alone")
    rows = [(name, f"{error:.4f} rad", "fitted") for name, error in found.fitted.items()]
    rows += [(name, f"{error:.4f} rad", "held back") for name, error in found.held_back.items()]
    say(aligned(rows, "  "))
    say(f"mean {fitted:.4f} rad fitted" + ("" if held is None else f", {held:.4f} rad held back"))
    figures = {**motor, **asdict(found.model.motor.friction)}
    say(aligned([(name, f"{value:.6g}") for name, value in figures.items() if value], "  "))
    say(f"written to {path}")
    if held is None:
        remark("Nothing was held back: give more logs, or --hold-back, to see how well it predicts.")
