"""A motion as a film, by the same drawing as the films of simulations."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from screwkin.errors import InputError
from screwkin.model.robot import Robot
from screwkin.sim.camera import Camera, save_gif
from screwkin.sim.render import pictures
from screwkin.viewer.track import Track

PICTURES_PER_SECOND = 12.0
FEWEST, MOST = 24, 240


def check_film(path: Path) -> None:
    """Refuse a name that no film has.

    Raises:
        InputError: it does not end in .gif.
    """
    if path.suffix.lower() != ".gif":
        raise InputError(f"--record {path}: films are written as GIF; name a file that ends in .gif")


def write_film(robot: Robot, track: Track, path: Path, camera: Camera | None = None) -> Path:
    """Film a motion at its own speed.

    Args:
        robot: that moves.
        track: its motion.
        path: of the film, a GIF.
        camera: default: that of simulations, with so many pictures that a film runs smoothly.

    Raises:
        InputError: the path does not end in .gif. OutputError: it cannot be written.
    """
    check_film(path)
    count = int(np.clip(PICTURES_PER_SECOND * track.duration, FEWEST, MOST))
    camera = camera or Camera(pictures=count)
    at = [track.sample(time) for time in np.linspace(0.0, track.duration, camera.pictures)]
    shots = pictures(robot, track.time[at], track.T_world_base[at], track.q[at], camera, track.terrain)
    return save_gif(path, shots, track.duration)
