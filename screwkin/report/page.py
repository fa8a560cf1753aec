"""The report: one HTML file with everything inside, verdict first."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from html import escape
from importlib.resources import files
from io import BytesIO
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from screwkin.analysis.account import Account
from screwkin.analysis.facts import Facts, facts_of
from screwkin.analysis.validate import Validation
from screwkin.files import atomic_write
from screwkin.model.coupled import coupling_text
from screwkin.model.records import CoupledJoint
from screwkin.model.robot import Robot
from screwkin.report.numbers import validation_numbers, walk_numbers
from screwkin.report.pictures import Saved
from screwkin.report.player import player_html

_UNITS = dict.fromkeys(("stride", "side", "lift", "waist_height", "hand_drop", "spread"), "m") | {
    "Tc": "s per step",
    "turn": "rad",
    "sway": "factor",
    "ramp": "steps",
    "rate": "Hz",
}
QUALITY = 82
"""Of pictures in a page, of 100."""
_KIND = {".png": "image/png", ".gif": "image/gif"}


def write_page(
    path: Path,
    account: Account,
    pictures: Sequence[Saved],
    check: Validation | None = None,
    film: Path | None = None,
    commands: Sequence[str] = (),
) -> Path:
    """Write the report of a trajectory, and of its simulation if there was one.

    Args:
        path: of the HTML file.
        account: of the trajectory.
        pictures: as ``save_pictures`` wrote them; they are embedded.
        check: the verdict of a simulation.
        film: an animated picture that lies beside the page; it is named, and not embedded.
        commands: command lines that produced it; default: the one recorded in the trajectory.

    Raises:
        OutputError: the file cannot be written.
    """
    template = Template(files("screwkin.report").joinpath("page.html").read_text(encoding="utf-8"))
    text = template.substitute(_parts(account, pictures, check, film, commands))
    with atomic_write(path) as file:
        file.write(text)
    return path


def _parts(
    account: Account,
    pictures: Sequence[Saved],
    check: Validation | None,
    film: Path | None,
    commands: Sequence[str],
) -> dict[str, str]:
    gait, robot = _gait(account), account.robot
    name = str(gait.get("name", "unknown"))
    steps = "" if account.steps is None else f", {account.steps} steps"
    tone, verdict, remarks = _verdict(account, check)
    lines = commands or [str(account.trajectory.meta.get("command", "")) or "(not recorded)"]
    return {
        "title": escape(f"{robot.name}: gait {name}{steps}"),
        "subtitle": escape(str(gait.get("description", ""))),
        "tone": tone,
        "verdict": escape(verdict),
        "remarks": _list(remarks),
        "player": player_html(account, check),
        "film": f"<p>The film of the simulation lies beside this page: {escape(film.name)}.</p>"
        if film
        else "",
        "numbers": _numbers(account, check),
        "pictures": _pictures(pictures),
        "robot": escape(f"{robot.name}: {robot.description}. Mass {float(robot.mass):.4f} kg."),
        "mechanism": _mechanism(facts_of(robot)),
        "joints": str(len(robot.joints)),
        "screws": _screws(robot),
        "gait": escape(f"{name}: {gait.get('description', '')}"),
        "parameters": _parameters(account),
        "command": escape("\n".join(lines)),
        "versions": _made_with(account),
    }


def _gait(account: Account, table: str = "gait") -> dict[str, Any]:
    """A table of the gait of the trajectory; empty where it is not recorded."""
    gait = account.trajectory.meta.get("gait")
    values = gait.get(table) if isinstance(gait, dict) else None
    return values if isinstance(values, dict) else {}


def _verdict(account: Account, check: Validation | None) -> tuple[str, str, list[str]]:
    """Tone, headline, and what there is to remark."""
    warnings = list(account.warnings)
    if check is not None:
        warnings = list(dict.fromkeys([*check.warnings, *warnings]))
        if check.passed:
            return "good", "Passed: the robot walks in simulation as planned.", warnings
        return "bad", "Not passed.", [*check.reasons, *warnings]
    if account.outside.any():
        share = 100 * float(account.outside.mean())
        leaves = (
            f"The ZMP leaves the support polygon in {share:.1f} % of the samples: the robot would tip over."
        )
        return "bad", leaves, warnings
    return (
        "",
        "Balanced on paper: the ZMP stays inside the support polygon. Not simulated yet (screwkin validate).",
        warnings,
    )


def _numbers(account: Account, check: Validation | None) -> str:
    classes = ("", "value", "soft")
    plan = _table(walk_numbers(account), ("The plan", "", ""), classes)
    return plan + (_table(validation_numbers(check), ("The simulation", "", ""), classes) if check else "")


def _pictures(pictures: Sequence[Saved]) -> str:
    html = []
    for section in dict.fromkeys(picture.section for picture in pictures):
        html.append(f"<h2>{escape(section)}</h2>")
        html += [
            figure_html(p.path, escape(p.caption), escape(p.caption))
            for p in pictures
            if p.section == section
        ]
    return "\n".join(html)


def figure_html(path: Path, name: str, caption: str) -> str:
    """A picture embedded in a page, with its name for those who do not see it; both are HTML."""
    picture = f'<div class="wide"><img alt="{name}" src="{_embedded(path)}"></div>'
    return f"<figure>{picture}<figcaption>{caption}</figcaption></figure>"


def _embedded(path: Path) -> str:
    """A picture as the text of a reference; of drawings as WebP, a third of the bytes."""
    data, kind = path.read_bytes(), _KIND[path.suffix]
    small = _webp(data) if path.suffix == ".png" else b""
    if small and len(small) < len(data):
        data, kind = small, "image/webp"
    return f"data:{kind};base64,{base64.b64encode(data).decode('ascii')}"


def _webp(data: bytes) -> bytes:
    """A PNG picture as WebP; nothing where it is no picture, or Pillow was built without WebP."""
    from PIL import Image

    small = BytesIO()
    try:
        with Image.open(BytesIO(data)) as picture:
            picture.convert("RGB").save(small, "WEBP", quality=QUALITY, method=2)
    except (OSError, KeyError):
        return b""
    return small.getvalue()


def _mechanism(facts: Facts) -> str:
    data = facts.to_dict()
    rows, columns = facts.network_shape
    return _table(
        [
            ("couplings", f"{data['couplings']}", "real joints and virtual ones (Assur virtual chains)"),
            ("links", f"{data['links']}", "virtual ones included"),
            ("circuits", f"{data['circuits']}", ""),
            ("mobility", f"{data['mobility']}", "couplings less the rank of N"),
            ("network matrix N", f"{rows} x {columns}", f"rank {data['rank']}"),
            ("cond(Ns)", f"{facts.condition:.1f}", "at home, N formed at the waist"),
        ],
        classes=("", "value", "soft"),
    )


def _screws(robot: Robot) -> str:
    def point(v: Iterable[Any]) -> str:
        return ", ".join(f"{float(c):.6g}" for c in v)

    def limits(lower: float, upper: float, turns: bool) -> str:
        if not np.isfinite([lower, upper]).all():
            return "none"
        return (
            f"{np.degrees(lower):.0f} to {np.degrees(upper):.0f} deg"
            if turns
            else f"{lower:g} to {upper:g} m"
        )

    rows = [
        (
            coupling_text(joint) if isinstance(joint, CoupledJoint) else joint.name,
            joint.type,
            point(joint.screw.s),
            point(joint.screw.s0),
            limits(joint.lower, joint.upper, joint.type != "prismatic"),
        )
        for joint in robot.tree
    ]
    return _table(rows, ("joint", "type", "s", "s0", "limits"), ("", "", "number", "number", "number"))


def _parameters(account: Account) -> str:
    """The gait's parameters, then those of its own file."""
    shown_above = ("name", "description", "source")
    values = {**_gait(account), **_gait(account, "parameters")}
    rows = [
        (key, f"{value:g}" if isinstance(value, float) else str(value), _UNITS.get(key, ""))
        for key, value in values.items()
        if key not in shown_above
    ]
    return _table(rows, classes=("", "value", "soft"))


def _made_with(account: Account) -> str:
    meta, trajectory = account.trajectory.meta, account.trajectory
    versions = meta.get("versions", {})
    rows = (
        [(str(name), str(version)) for name, version in versions.items()]
        if isinstance(versions, dict)
        else []
    )
    rows += [("trajectory.npz, SHA-256", trajectory.sha256)]
    if isinstance(meta.get("robot"), dict):
        rows += [("robot table, SHA-256", str(meta["robot"].get("sha256", "")))]
    return _table(rows, classes=("", "hash"))


def _table(rows: Iterable[Sequence[str]], head: Sequence[str] = (), classes: Sequence[str] = ()) -> str:
    """Rows of plain text as a table."""
    top = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    body = [
        "<tr>"
        + "".join(
            f'<td class="{css}">{escape(cell)}</td>' if css else f"<td>{escape(cell)}</td>"
            for cell, css in zip(row, [*classes, *[""] * len(row)], strict=False)
        )
        + "</tr>"
        for row in rows
    ]
    return "<table>" + (f"<tr>{top}</tr>" if top else "") + "".join(body) + "</table>"


def _list(items: Sequence[str]) -> str:
    return "<ul>" + "".join(f"<li>{escape(item)}</li>" for item in items) + "</ul>" if items else ""
