"""``screwkin forces TRAJ``: forces of feet and efforts of joints along a trajectory."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from screwkin.analysis.account import account_of, recorded_robot
from screwkin.analysis.contact_account import ForceAccount, forces_of, simulated_forces, validated_with
from screwkin.analysis.engines import RIGID
from screwkin.cli.folder import output_folder
from screwkin.cli.output import aligned, drawn, print_json, progress_bar, say
from screwkin.cli.simulation import engine as engine_named
from screwkin.errors import InputError
from screwkin.files import atomic_write_bytes, npz_bytes
from screwkin.trajectory import load_trajectory

NONE, VALIDATED = "none", "validated"
FRICTION = 0.8
"""Coefficient of friction of the floor where none is given: rubber on wood."""


@dataclass(frozen=True)
class ForceSettings:
    """Limits of the floor, what to simulate beside, and what to write.

    friction: None, where the floor may pull too. engine: a simulator's name, ``none``, or ``validated``: that
    of the validation beside the trajectory, if there is one.
    """

    friction: float | None = FRICTION
    engine: str = VALIDATED
    plots: bool = True
    output: Path | None = None
    as_json: bool = False


def forces_along(path: Path, wanted: ForceSettings) -> int:
    """Write forces.npz and pictures of a trajectory's forces, and print the largest ones."""
    trajectory = load_trajectory(path)
    account = account_of(recorded_robot(trajectory, str(path)), trajectory)
    if wanted.friction is not None and not 0 < wanted.friction < np.inf:
        raise InputError(
            f"--friction {wanted.friction:g} is no coefficient; give a positive number, such as 0.8"
        )
    if wanted.engine == VALIDATED:
        way = validated_with(path, account)
    else:
        way = None if wanted.engine == NONE else (engine_named(wanted.engine), RIGID)
    if way is not None and way[0] in ("auto", "kinematic"):
        raise InputError(f"--engine {way[0]} measures no forces; name pybullet, mujoco or none")
    forces = forces_of(account, wanted.friction)
    with output_folder(wanted.output, "forces", account.robot.name) as folder:
        if way is not None:
            with progress_bar("simulation") as done:
                forces = replace(forces, simulated=simulated_forces(account, *way, done), engine=way[0])
        with atomic_write_bytes(folder / "forces.npz") as file:
            file.write(npz_bytes(_arrays(forces)))
        if wanted.plots:
            drawn(lambda: _draw(forces, folder))
    data = {"robot": account.robot.name, "samples": trajectory.samples, **force_data(forces)}
    if wanted.as_json:
        print_json(data)
    else:
        say(f"{path}: {account.robot.name}, {trajectory.samples} samples, {trajectory.duration:.2f} s")
        say(aligned(_rows(forces, data), "  "))
        say(f"files in {folder}")
    return 0


def force_data(forces: ForceAccount) -> dict[str, Any]:
    """The largest efforts and forces, and what they ask of friction, as JSON data."""
    robot, time = forces.account.robot, forces.account.trajectory.time
    efforts = np.abs(forces.forces.efforts)
    sample, joint = np.unravel_index(int(efforts.argmax()), efforts.shape)
    moment, foot = np.unravel_index(int(forces.sizes.argmax()), forces.sizes.shape)
    data: dict[str, Any] = {
        "max_effort": float(efforts.max()),
        "max_effort_joint": robot.joint_names[joint],
        "max_effort_at": float(time[sample]),
        "max_effort_use": max(forces.use.values(), default=0.0),
        "max_contact_force": float(forces.sizes.max()),
        "max_contact_force_foot": forces.feet[foot],
        "max_contact_force_at": float(time[moment]),
        "friction_needed": _largest(forces.friction),
        "efforts": dict(zip(robot.joint_names, efforts.max(axis=0).tolist(), strict=True)),
        "contact_forces": dict(zip(forces.feet, forces.sizes.max(axis=0).tolist(), strict=True)),
        "engine": forces.engine or None,
        "simulated": None,
    }
    seen = forces.simulated
    if seen is not None and len(seen.time):
        planned = np.stack([np.interp(seen.time, time, effort) for effort in forces.forces.efforts.T], axis=1)
        data["simulated"] = {
            "max_effort": float(np.abs(seen.torque).max()),
            "max_contact_force": float(np.linalg.norm(seen.foot_force, axis=-1).max()),
            "effort_rms_difference": float(np.sqrt(np.mean((seen.torque - planned) ** 2))),
        }
    return data


def _largest(values: Any) -> float | None:
    found = values[np.isfinite(values)]
    return float(found.max()) if len(found) else None


def _rows(forces: ForceAccount, data: dict[str, Any]) -> list[tuple[str, ...]]:
    rows = [
        (
            "largest effort",
            f"{data['max_effort']:.3f} N m",
            f"{data['max_effort_joint']} at {data['max_effort_at']:.2f} s",
        ),
        ("largest share of a limit", f"{100 * data['max_effort_use']:.0f} %"),
        (
            "largest force on a foot",
            f"{data['max_contact_force']:.2f} N",
            f"{data['max_contact_force_foot']} at {data['max_contact_force_at']:.2f} s",
        ),
    ]
    if data["friction_needed"] is not None:
        rows.append(("friction needed", f"{data['friction_needed']:.3f}"))
    if data["simulated"]:
        seen = data["simulated"]
        rows += [
            (f"largest effort in {forces.engine}", f"{seen['max_effort']:.3f} N m"),
            (f"largest force on a foot in {forces.engine}", f"{seen['max_contact_force']:.2f} N"),
            ("efforts differ by", f"{seen['effort_rms_difference']:.3f} N m", "root mean square"),
        ]
    return rows


def _arrays(forces: ForceAccount) -> dict[str, Any]:
    arrays = {
        "time": forces.account.trajectory.time,
        "joint_names": np.array(forces.account.robot.joint_names),
        "feet": np.array(forces.feet),
        "wrenches": forces.forces.wrenches,
        "efforts": forces.forces.efforts,
    }
    if forces.simulated is not None:
        seen = forces.simulated
        arrays |= {
            "simulated_time": seen.time,
            "simulated_force": seen.foot_force,
            "simulated_torque": seen.torque,
        }
    return arrays


def _draw(forces: ForceAccount, folder: Path) -> list[Path]:
    from screwkin.report import forces as pictures
    from screwkin.report.style import Figure, save_figure, styled

    plots: dict[str, Callable[[], Figure | None]] = {
        "foot_forces": lambda: pictures.foot_forces(forces),
        "pressure": lambda: pictures.pressure(forces),
        "efforts": lambda: pictures.joint_efforts(forces),
        "efforts_arms": lambda: pictures.joint_efforts(forces, "arm"),
    }
    saved = []
    with progress_bar("pictures") as done:
        for count, (name, picture) in enumerate(plots.items()):
            with styled():
                figure = picture()
                if figure is not None:
                    saved.append(save_figure(figure, folder / f"{name}.png"))
            done((count + 1) / len(plots))
    return saved
