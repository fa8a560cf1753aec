"""A camera that glides along with the robot, its perspective, and files of pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwkin.algebra.arrays import Array
from screwkin.files import atomic_path

Picture = NDArray[np.uint8]
Colour = tuple[float, float, float]

LAG = 0.6
"""Time constant with which the camera follows the waist [s]: slow enough not to sway with it."""
LOOK_AT = 0.93
"""Height looked at, in heights of the waist."""


@dataclass(frozen=True)
class Camera:
    """How many pictures, their size, and place, light and floor.

    pictures: number spread evenly over a trajectory; width, height [pixels]; field_of_view (vertical), yaw,
    pitch [deg]: at yaw 0 the camera looks along +y, a negative pitch looks down; distance from the point
    looked at, in heights of the waist (0.72 m for a waist at 0.15 m); light: direction towards the lamp;
    ambient: share of the light that comes from everywhere; tile: edge of a floor tile [m], with the colours
    of its two kinds; sky: colour of the background.
    """

    pictures: int = 60
    width: int = 480
    height: int = 400
    field_of_view: float = 38.0
    distance: float = 4.8
    yaw: float = 40.0
    pitch: float = -18.0
    light: tuple[float, float, float] = (0.6, -1.0, 1.6)
    ambient: float = 0.58
    tile: float = 0.1
    tile_colours: tuple[Colour, Colour] = ((0.97, 0.97, 0.96), (0.88, 0.89, 0.90))
    sky: Colour = (1.0, 1.0, 1.0)


@dataclass(frozen=True, eq=False)
class View:
    """A camera in place: eye (3,) [m]; rows of axes point right, up, forward; focal length [pixels]."""

    eye: Array
    axes: Array
    focal: float
    width: int
    height: int

    def project(self, points: Array) -> tuple[Array, Array]:
        """Pixels (..., 2) of world points (..., 3), x to the right and y down, and their depth [m]."""
        right, up, depth = np.moveaxis((points - self.eye) @ self.axes.T, -1, 0)
        scale = self.focal / np.maximum(depth, 1e-9)
        return np.stack([self.width / 2 + scale * right, self.height / 2 - scale * up], axis=-1), depth


def view_of(camera: Camera, target: Array, away: float, magnified: int = 1) -> View:
    """The camera placed so that it looks at a world point from a distance [m]."""
    yaw, pitch = np.deg2rad([camera.yaw, camera.pitch])
    forward = np.array([-np.sin(yaw) * np.cos(pitch), np.cos(yaw) * np.cos(pitch), np.sin(pitch)])
    right = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    axes = np.array([right, np.cross(right, forward), forward])
    height = magnified * camera.height
    focal = height / 2 / np.tan(np.deg2rad(camera.field_of_view) / 2)
    return View(np.asarray(target) - away * forward, axes, float(focal), magnified * camera.width, height)


def following(time: Array, base: Array) -> Array:
    """Points (K, 3) to look at while the base, (K, 4, 4), moves: its path, smoothed, at an even height."""
    at = base[0, :2, 3].copy()
    path = np.empty((len(time), 2))
    for k, p in enumerate(base[:, :2, 3]):
        at = at + (1.0 - np.exp(-(time[k] - time[max(k - 1, 0)]) / LAG)) * (p - at)
        path[k] = at
    return np.column_stack([path, np.full(len(time), LOOK_AT * base[0, 2, 3])])


def save_gif(path: str | Path, frames: Sequence[Picture], seconds: float) -> Path:
    """An endless animated GIF of so many seconds, its pictures taken from begin to end at even times.

    Each is shown until midway to the next, in whole hundredths of a second, whose sum is the film's. All
    share one palette and only what changes is stored, so it is small and does not flicker.

    Raises:
        OutputError: it cannot be written.
    """
    from PIL import Image

    images = [Image.fromarray(frame) for frame in frames]
    palette = _common_palette(images)
    mapped = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    with atomic_path(path) as beside:
        mapped[0].save(
            beside,
            format="GIF",
            save_all=True,
            append_images=mapped[1:],
            duration=_milliseconds(len(frames), seconds),
            loop=0,
        )
    return Path(path)


def _milliseconds(pictures: int, seconds: float) -> list[int]:
    """How long each of several pictures is shown [ms], whole hundredths of a second, of a film so long."""
    changes = [0.0, *((k + 0.5) / (pictures - 1) for k in range(pictures - 1)), 1.0]
    hundredths = np.round(100 * seconds * np.array(changes)).astype(int)
    return [10 * max(1, int(step)) for step in np.diff(hundredths)]


def save_png(path: str | Path, picture: Picture) -> Path:
    """One picture as PNG.

    Raises:
        OutputError: it cannot be written.
    """
    from PIL import Image

    with atomic_path(path) as beside:
        Image.fromarray(picture).save(beside, format="PNG", optimize=True)
    return Path(path)


def _common_palette(images: Sequence[Any]) -> Any:
    """128 colours that fit pictures spread over the film."""
    from PIL import Image

    chosen = [images[i] for i in np.unique(np.linspace(0, len(images) - 1, 6).astype(int))]
    width, height = chosen[0].size
    strip = Image.new("RGB", (width, height * len(chosen)))
    for i, image in enumerate(chosen):
        strip.paste(image, (0, i * height))
    return strip.quantize(colors=128, method=Image.Quantize.MEDIANCUT)
