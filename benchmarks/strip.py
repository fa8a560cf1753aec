"""python -m benchmarks.strip FILE|FOLDER... [--rows FILE] [-o PICTURE] [--across N]: robots that walk.

Every robot whose row of ``benchmarks.robots`` says that it walks in both engines is fitted and planned anew,
and drawn in the middle of its second swing, with the meshes of its URDF.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

import screwkin as sk
from benchmarks.machine import pin_threads
from benchmarks.robots import ROWS, file_of, files_of, passed, read_rows
from screwkin.anatomy.humanoid import humanoid
from screwkin.sim.camera import Camera, Picture
from screwkin.sim.render import pictures

PICTURE = Path(__file__).resolve().parents[1] / "docs" / "images" / "robots.png"
WIDTH, HEIGHT, LINE = 200, 260, 20
"""Of a picture and of the name below it [pixels]."""


def picture_of(robot: sk.Robot) -> Picture:
    """A robot in the middle of its second swing."""
    walk = sk.walk(robot, sk.fitting_gait(robot), 2)
    start, end = walk.meta["boundaries"][1:3]
    swinging = np.flatnonzero(~walk.contact.all(axis=1))
    when = walk.time[swinging]
    middle = int(np.median(swinging[(when >= start) & (when < end)]))
    at = slice(middle, middle + 1)
    height = float(walk.T_world_base[middle, 2, 3])
    camera = Camera(width=WIDTH, height=HEIGHT, distance=3.9, tile=0.4 * height)
    return pictures(robot, walk.time[at], walk.T_world_base[at], walk.q[at], camera)[0]


def strip(files: Sequence[Path], across: int) -> Image.Image:
    """Pictures side by side, so many in a line, with names and masses."""
    lines = -(-len(files) // across)
    whole = Image.new("RGB", (across * WIDTH, lines * (HEIGHT + LINE)), "white")
    draw, font = ImageDraw.Draw(whole), ImageFont.load_default(13)
    for k, path in enumerate(files):
        robot = humanoid(sk.load_robot(path))
        x, y = k % across * WIDTH, k // across * (HEIGHT + LINE)
        whole.paste(Image.fromarray(picture_of(robot)), (x, y))
        text = f"{robot.name}, {float(robot.mass):.0f} kg"
        draw.text((x + WIDTH / 2, y + HEIGHT + LINE / 2), text, fill="black", font=font, anchor="mm")
    return whole


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.strip", description=__doc__)
    parser.add_argument("places", nargs="+", type=Path)
    parser.add_argument("--rows", type=Path, default=ROWS)
    parser.add_argument("-o", "--output", type=Path, default=PICTURE)
    parser.add_argument("--across", type=int, default=5, help="pictures in a line")
    asked = parser.parse_args(arguments)
    warnings.simplefilter("ignore")
    walking = {row["file"] for row in read_rows(asked.rows) if passed(row)}
    whole = strip([path for path in files_of(asked.places) if file_of(path) in walking], asked.across)
    whole.quantize(128).save(asked.output, optimize=True)
    print(asked.output)
    return 0


if __name__ == "__main__":
    pin_threads()
    raise SystemExit(main())
