"""Pictures of maps over a workspace seen from above: what is reached, what cuts, how far a tip sinks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.analysis.stiffness_maps import DeflectionMap
from screwkin.analysis.workspace import WorkspaceMap
from screwkin.ik.reach import OUT_OF_REACH, REACHABLE
from screwkin.model.robot import Robot
from screwkin.report.style import DPI, WIDTH, Axes, Figure, shown

REACHED, BEYOND = "#F4F1E4", "#D4D6DA"
HUES = ("#0072B2", "#E69F00", "#CC3377", "#009E73", "#8B5FBF", "#D55E00", "#56B4E9", "#997700", "#555555")
"""One for each joint of a limb in order; its lower limit full, its upper limit pale."""


def cause_colours(place: WorkspaceMap) -> dict[str, str]:
    """Colour of every cause of a map."""
    colours = {place.causes[REACHABLE]: REACHED, place.causes[OUT_OF_REACH]: BEYOND}
    for k, name in enumerate(place.joint_names):
        hue = HUES[k % len(HUES)]
        colours |= {f"{name} lower": hue, f"{name} upper": _paler(hue)}
    return colours


def workspace_picture(robot: Robot, place: WorkspaceMap, most: float) -> Figure:
    """One height: which limit cuts where, and the inverse condition number up to ``most``."""
    figure, axes = _panels(1, 2, 5.3)
    _draw_causes(axes[0], place)
    _legend(figure, {place.causes[0]: place.area, **place.cuts}, cause_colours(place), 3)
    axes[0].set_title("what limits the reach", fontsize=9)
    shade = _shade(axes[1], place, place.inverse_condition, "viridis", (0.0, most))
    axes[1].set_title(f"inverse condition number, median 1/{place.median_condition:.1f}", fontsize=9)
    bar = figure.colorbar(shade, ax=axes[1], shrink=0.85)
    bar.set_label("1/cond: 0 singular, 1 equal in all directions")
    for axis in axes:
        _surroundings(axis, robot, place)
    figure.suptitle(
        f"{robot.name}: {shown(place.tip)} held level, {_place(place.height)}: "
        f"{1e4 * place.area:.0f} cm² of reach",
        fontsize=10.5,
    )
    return figure


def workspace_overview(robot: Robot, places: Sequence[WorkspaceMap], most: float) -> Figure:
    """All heights side by side: causes above, inverse condition numbers below."""
    figure, axes = _panels(2, len(places), 4.9, WIDTH * max(1.0, len(places) / 3.6))
    axes = np.reshape(axes, (2, len(places)))
    cuts: dict[str, float] = {places[0].causes[REACHABLE]: np.nan}
    shade: Any = None
    for k, place in enumerate(places):
        _draw_causes(axes[0, k], place)
        cuts |= dict.fromkeys(place.cuts, np.nan)
        shade = _shade(axes[1, k], place, place.inverse_condition, "viridis", (0.0, most))
        axes[0, k].set_title(f"{_mm(place.height)}: {1e4 * place.area:.0f} cm²", fontsize=9.5)
        axes[1, k].set_title(f"median cond {place.median_condition:.1f}", fontsize=9)
        for row in (0, 1):
            _surroundings(axes[row, k], robot, place, places)
            axes[row, k].label_outer()
    _legend(figure, cuts, cause_colours(places[0]), 5)
    figure.colorbar(
        shade,
        ax=list(axes.ravel()),
        label="1/cond: 0 singular, 1 equal in all directions",
        pad=0.01,
        shrink=0.8,
    )
    figure.suptitle(
        f"{robot.name}: reach of the {shown(places[0].tip)}, held level, by its distance below the waist",
        fontsize=10.5,
    )
    return figure


def deflection_picture(robot: Robot, deflection: DeflectionMap) -> Figure:
    """One height: length and the three components of the tip's deflection."""
    figure, axes = _panels(2, 2, 7.4)
    values = 1e3 * deflection.translation
    parts = [("length", 1e3 * deflection.magnitude), *zip("xyz", np.moveaxis(values, -1, 0), strict=True)]
    for axis, (name, value) in zip(axes.ravel(), parts, strict=True):
        size = max(float(np.nanmax(np.abs(value), initial=0.0)), 1e-9)
        scale = (0.0, size) if name == "length" else (-size, size)
        shade = _shade(axis, deflection.place, value, "magma_r" if name == "length" else "RdBu", scale)
        figure.colorbar(shade, ax=axis, label="deflection [mm]", shrink=0.9)
        meaning = {"x": ", forwards", "y": ", to the left", "z": ", upwards"}.get(name, "")
        axis.set_title(f"{name}{meaning}: {np.nanmin(value):.2f} to {np.nanmax(value):.2f} mm", fontsize=9)
        _surroundings(axis, robot, deflection.place)
        axis.label_outer()
    title = f"{_sinking(robot, deflection)}, {_place(deflection.place.height)}"
    figure.suptitle(f"{title}\n{_springs(deflection)}", fontsize=10)
    return figure


def deflection_overview(robot: Robot, maps: Sequence[DeflectionMap]) -> Figure:
    """Length of the deflection at all heights, on one scale."""
    figure, axes = _panels(1, len(maps), 3.2, WIDTH * max(1.0, len(maps) / 3.6))
    places = [one.place for one in maps]
    most = max([1e-9, *(float(np.nanmax(1e3 * one.magnitude, initial=0.0)) for one in maps)])
    shade: Any = None
    for axis, one in zip(np.ravel(axes), maps, strict=True):
        shade = _shade(axis, one.place, 1e3 * one.magnitude, "magma_r", (0.0, most))
        middle = np.nanmedian(1e3 * one.magnitude) if one.place.area else np.nan
        axis.set_title(f"{_mm(one.place.height)}: median {middle:.2f} mm", fontsize=9.5)
        _surroundings(axis, robot, one.place, places)
        axis.label_outer()
    figure.colorbar(shade, ax=list(np.ravel(axes)), label="length of deflection [mm]", shrink=0.9, pad=0.01)
    title = f"{_sinking(robot, maps[0])}, by its distance below the waist"
    figure.suptitle(f"{title}\n{_springs(maps[0])}", fontsize=10)
    return figure


def _sinking(robot: Robot, one: DeflectionMap) -> str:
    return f"{robot.name} on its {shown(one.support)}: deflection of the {shown(one.place.tip)}"


def _springs(one: DeflectionMap) -> str:
    """The stiffness and the method, in words."""
    k = one.common_stiffness
    soft = f"{one.stiffness.min():g} to {one.stiffness.max():g}" if k is None else f"{k:g}"
    law = (
        "to first order: all scales as 1/k" if one.method == "linear" else "equilibrium of springs and weight"
    )
    return f"joints of k = {soft} N m/rad; {law}"


def _place(height: float) -> str:
    return f"{_mm(abs(height))} {'below' if height >= 0 else 'above'} the waist"


def _mm(height: float) -> str:
    return f"{1e3 * height:g} mm"


def _paler(colour: str) -> str:
    """Halfway to white."""
    parts = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return "#" + "".join(f"{round(0.45 * part + 0.55 * 255):02X}" for part in parts)


def _panels(rows: int, columns: int, height: float, width: float = WIDTH) -> tuple[Figure, Any]:
    from matplotlib.figure import Figure as Canvas

    figure = Canvas(figsize=(width, height), dpi=DPI, layout="constrained")
    return figure, figure.subplots(rows, columns, sharex=True, sharey=True)


def _extent(place: WorkspaceMap) -> tuple[float, ...]:
    """Edges of the cells around the outer points [mm]."""
    half = place.resolution / 2
    edges = (place.x[0] - half, place.x[-1] + half, place.y[0] - half, place.y[-1] + half)
    return tuple(1e3 * float(edge) for edge in edges)


def _shade(axis: Axes, place: WorkspaceMap, values: Array, colours: str, scale: tuple[float, float]) -> Any:
    """Values as colours, forward to the right and left upwards; an outline where the reach ends."""
    low, high = scale
    return _image(axis, place, np.ma.masked_invalid(values), "#F0F0F2", cmap=colours, vmin=low, vmax=high)


def _draw_causes(axis: Axes, place: WorkspaceMap) -> None:
    from matplotlib.colors import ListedColormap

    colours = cause_colours(place)
    last = len(place.causes) - 0.5
    hues = ListedColormap([colours[name] for name in place.causes])
    _image(axis, place, place.cause, BEYOND, cmap=hues, vmin=-0.5, vmax=last)


def _image(axis: Axes, place: WorkspaceMap, values: Array, beyond: str, **colours: Any) -> Any:
    """Values over the grid, and an outline where the reach ends."""
    axis.set_facecolor(beyond)
    options = {"origin": "lower", "interpolation": "nearest", "aspect": "equal"}
    image = axis.imshow(values.T, extent=_extent(place), **options, **colours)
    seen = place.reachable.astype(float)
    if 0 < seen.sum() < seen.size and min(seen.shape) > 1:
        axis.contour(1e3 * place.x, 1e3 * place.y, seen.T, levels=[0.5], colors="#222222", linewidths=0.7)
    return image


def _surroundings(
    axis: Axes, robot: Robot, place: WorkspaceMap, places: Sequence[WorkspaceMap] | None = None
) -> None:
    """Soles in the zero pose, the middle of the waist, axes in mm; all heights on one scale."""
    for sole in robot.soles:
        corners = [(1e3 * float(c.x), 1e3 * float(c.y)) for c in sole.corners]
        own = sole.limb == place.limb
        axis.plot(
            *zip(*corners, corners[0], strict=True),
            color="#222222",
            linewidth=0.9,
            linestyle="-" if own else ":",
        )
    axis.plot(0, 0, marker="+", color="#222222", markersize=7)
    edges = np.array([_extent(one) for one in (places or [place])])
    soles = np.array(
        [[1e3 * float(c.x), 1e3 * float(c.y)] for s in robot.soles for c in s.corners] or [[0, 0]]
    )
    low, high = soles.min(axis=0) - 12, soles.max(axis=0) + 12
    axis.set_xlim(min(edges[:, 0].min(), low[0]), max(edges[:, 1].max(), high[0]))
    axis.set_ylim(min(edges[:, 2].min(), low[1]), max(edges[:, 3].max(), high[1]))
    axis.set_xlabel("x forwards [mm]")
    axis.set_ylabel("y to the left [mm]")
    axis.grid(False)


def _legend(figure: Figure, areas: Mapping[str, float], colours: Mapping[str, str], columns: int) -> None:
    """A patch for every cause, with its area where one is given."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    entries: list[Any] = [
        Patch(
            facecolor=colours[name],
            edgecolor="#777777",
            linewidth=0.5,
            label=shown(name) + ("" if np.isnan(area) else f": {1e4 * area:.0f} cm²"),
        )
        for name, area in areas.items()
    ]
    entries.append(Patch(facecolor=BEYOND, edgecolor="#777777", linewidth=0.5, label="too far for the limb"))
    entries.append(
        Line2D([], [], color="#222222", linewidth=0.9, label="soles in the zero pose (dotted: other legs)")
    )
    entries.append(Line2D([], [], color="#222222", marker="+", linestyle="none", label="middle of the waist"))
    figure.legend(handles=entries, loc="outside lower center", ncols=columns, fontsize=7.5)
