"""One style for all pictures: colours by limb, shaded swings, legends outside the data."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, get_args

import numpy as np

from screwkin.analysis.account import Account
from screwkin.errors import needed_for
from screwkin.files import atomic_path
from screwkin.model.records import LimbKind

Figure = Any
Axes = Any

SIDES = ("#D55E00", "#0072B2", "#009E73", "#8B5FBF", "#997700", "#CC3377")
"""Colours of limbs of one kind in table order: right and left are distinct for the colour-blind too."""
WAIST, GCOM, ZMP, MEASURED, PLAIN, GOOD = "#333333", "#009E73", "#AA3377", "#E69F00", "#555555", "#E8EEE8"
LINES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 1)))

WIDTH, DPI = 8.4, 130
LEFT, RIGHT, BOTTOM, TOP, BETWEEN = 0.78, 0.14, 0.47, 0.16, 0.16
"""Margins of stacked axes and what is between them [inch]: numbers and a label fit, none needs measuring."""
TITLE = 0.24
"""Height of a line of title [inch]."""
ROW, HANDLE, LETTER = 0.21, 0.57, 0.06
"""Height of a legend's row; width of an entry without its label, and of a label's letter [inch]."""

STYLE: Mapping[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.labelsize": 9.0,
    "axes.edgecolor": "#888888",
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.grid.axis": "y",
    "axes.axisbelow": True,
    "grid.color": "#E4E4E4",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.5,
    "xtick.color": "#555555",
    "ytick.color": "#555555",
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "svg.hashsalt": "screwkin",
}


@contextmanager
def styled() -> Iterator[None]:
    """Pictures drawn inside have the style; nothing global remains changed.

    Raises:
        MissingDependencyError: matplotlib is not installed.
    """
    with needed_for("a picture"):
        import matplotlib

    style: Any = dict(STYLE)
    with matplotlib.rc_context(style):
        yield


def new_figure(height: float, rows: int = 1, columns: int = 1, **options: Any) -> tuple[Figure, Any]:
    """A figure without window or global state, and its axes (an array if there are several).

    Stacked axes have fixed margins: to measure all texts, which axes side by side need, takes as long as to
    draw them.
    """
    from matplotlib.figure import Figure as Canvas

    if columns > 1:
        figure = Canvas(figsize=(WIDTH, height), dpi=DPI, layout="constrained")
        return figure, figure.subplots(rows, columns, **options)
    figure = Canvas(figsize=(WIDTH, height), dpi=DPI)
    figure.subplots_adjust(LEFT / WIDTH, BOTTOM / height, 1 - RIGHT / WIDTH)
    _leave_above(figure, rows, TOP)
    return figure, figure.subplots(rows, columns, **options)


def _leave_above(figure: Figure, rows: int, space: float) -> None:
    """Put the upper end of stacked axes so far [inch] below the figure's."""
    height = figure.get_figheight()
    mean = (height - space - BOTTOM - (rows - 1) * BETWEEN) / rows
    figure.subplots_adjust(top=1 - space / height, hspace=BETWEEN / mean)


def titled(figure: Figure, rows: int, title: str) -> Figure:
    """Stacked axes with a title above them, which covers none."""
    _leave_above(figure, rows, TOP + TITLE)
    figure.suptitle(title, fontsize=10.5, y=1 - TOP / 2 / figure.get_figheight())
    return figure


def save_figure(figure: Figure, path: Path) -> Path:
    """Write a figure as PNG; the same data give the same bytes.

    Raises:
        OutputError: it cannot be written.
    """
    with atomic_path(path) as beside:
        figure.savefig(
            beside, format="png", dpi=DPI, metadata={"Software": None}, pil_kwargs={"compress_level": 3}
        )
    return path


def shown(name: str) -> str:
    """A name for people: ``right_foot`` reads right foot."""
    return name.replace("_", " ")


def foot_colours(account: Account) -> dict[str, str]:
    """Colour of every foot, by its tip's name."""
    return dict(zip(account.trajectory.feet, SIDES, strict=False))


def limb_colours(account: Account) -> dict[str, str]:
    """Colour of every limb: the k-th leg, the k-th arm and the k-th other share theirs."""
    colours: dict[str, str] = {}
    for kind in get_args(LimbKind):
        names = [limb.name for limb in account.robot.limbs if limb.kind == kind]
        colours |= {name: SIDES[k % len(SIDES)] for k, name in enumerate(names)}
    return colours


def joint_colours(account: Account, others: str = PLAIN) -> dict[str, str]:
    """Colour of every joint: its limb's, or that of others if it carries limbs of both sides."""
    robot, of_limb = account.robot, limb_colours(account)
    own: dict[str, set[str]] = {name: set() for name in robot.joint_names}
    for limb in robot.limbs:
        for i in robot.path_to(limb.link):
            own[robot.tree[i].name].add(of_limb[limb.name])
    return {name: colours.pop() if len(colours) == 1 else others for name, colours in own.items()}


def shade_swings(axes: Axes, account: Account) -> None:
    """Tint the times at which a foot is in the air with that foot's colour; mark where steps begin."""
    time, contact = account.trajectory.time, account.trajectory.contact
    for k, (foot, colour) in enumerate(foot_colours(account).items()):
        for n, (begin, end) in enumerate(spans(~contact[:, k])):
            label = f"{shown(foot)} in the air" if n == 0 else None
            axes.axvspan(time[begin], time[end], color=colour, alpha=0.09, linewidth=0, label=label)
    mark_steps(axes, account)


def mark_steps(axes: Axes, account: Account) -> None:
    """A line where every step but the first begins."""
    for boundary in account.boundaries[1:-1]:
        axes.axvline(boundary, color="#BBBBBB", linewidth=0.6, zorder=0.6)


def time_figure(account: Account, height: float, rows: int = 1, **options: Any) -> tuple[Figure, Any]:
    """A figure of stacked axes over the time of a motion, with its swings tinted, and its axes."""
    figure, axes = new_figure(height, rows, sharex=True, **options)
    for one in figure.axes:
        shade_swings(one, account)
    return figure, axes


def finished(figure: Figure, account: Account, columns: int = 6) -> Figure:
    """The figure with its axis of time, exactly as long as the motion, and one legend above."""
    last, time = figure.axes[-1], account.trajectory.time
    last.set_xlim(time[0], time[-1])
    last.set_xlabel("time [s]")
    legend_above(figure, figure.axes, columns)
    return figure


def spans(flags: Any) -> list[tuple[int, int]]:
    """First and last index of every run of true flags; a run is drawn up to the sample after it."""
    edges = np.flatnonzero(
        np.diff(np.concatenate([[False], np.asarray(flags, dtype=bool), [False]]).astype(int))
    )
    return [(int(a), min(int(b), len(flags) - 1)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def legend_above(figure: Figure, axes: Sequence[Axes], columns: int = 6) -> None:
    """One legend for all axes, above them, every label once."""
    entries: dict[str, Any] = {}
    for one in axes:
        for handle, label in zip(*one.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    if not entries:
        return
    columns = min(columns, len(entries))
    if figure.get_layout_engine() is not None:
        figure.legend(entries.values(), entries.keys(), loc="outside upper left", ncols=columns)
        return
    columns = _columns_that_fit(list(entries), columns)
    rows = axes[0].get_gridspec().nrows
    _leave_above(figure, rows, TOP + ROW * math.ceil(len(entries) / columns))
    left = (LEFT / WIDTH, 1 - 0.08 / figure.get_figheight())
    figure.legend(
        entries.values(),
        entries.keys(),
        loc="upper left",
        bbox_to_anchor=left,
        ncols=columns,
        borderaxespad=0.0,
        borderpad=0.0,
    )


def _columns_that_fit(labels: Sequence[str], most: int) -> int:
    """Columns of a legend, filled one after the other, that are not wider than the axes below."""
    for columns in range(most, 1, -1):
        rows = math.ceil(len(labels) / columns)
        each = [labels[k : k + rows] for k in range(0, len(labels), rows)]
        if sum(HANDLE + LETTER * max(map(len, one)) for one in each) < WIDTH - LEFT - RIGHT + HANDLE / 2:
            return columns
    return 1
