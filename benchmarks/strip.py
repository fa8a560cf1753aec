"""python -m benchmarks.strip ROWS [-o PICTURE] [--across N]: the robots of ``benchmarks.robots`` that walk.

Every robot whose row says that it walks in both engines is fitted and planned anew, and drawn in the middle
of its second swing, with the meshes of its URDF.
"""

from __future__ import annotations

import argparse
import json
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

import screwkin as sk
from benchmarks.machine import pin_threads
from benchmarks.robots import Row, passed
from screwkin.anatomy.humanoid import humanoid
from screwkin.sim.camera import Camera, Picture
from screwkin.sim.render import pictures

PICTURE = Path(__file__).resolve().parents[1] / "docs" / "images" / "robots.png"
WIDTH, HEIGHT, LINE = 200, 260, 20
"""Of a picture and of the name below it [pixels]."""


def picture_of(path: Path) -> Picture:
    """A robot in the middle of its second swing."""
    robot = humanoid(sk.load_robot(path))
    walk = sk.walk(robot, sk.fitting_gait(robot), 2)
    start, end = walk.meta["boundaries"][1:3]
    swinging = np.flatnonzero(~walk.contact.all(axis=1))
    when = walk.time[swinging]
    middle = int(np.median(swinging[(when >= start) & (when < end)]))
    at = slice(middle, middle + 1)
    height = float(walk.T_world_base[middle, 2, 3])
    camera = Camera(width=WIDTH, height=HEIGHT, distance=3.9, tile=0.4 * height)
    return pictures(robot, walk.time[at], walk.T_world_base[at], walk.q[at], camera)[0]


def strip(rows: Sequence[Row], across: int) -> Image.Image:
    """Pictures side by side, so many in a line, with names and masses."""
    lines = -(-len(rows) // across)
    whole = Image.new("RGB", (across * WIDTH, lines * (HEIGHT + LINE)), "white")
    draw, font = ImageDraw.Draw(whole), ImageFont.load_default(13)
    for k, row in enumerate(rows):
        x, y = k % across * WIDTH, k // across * (HEIGHT + LINE)
        whole.paste(Image.fromarray(picture_of(Path(row["path"]))), (x, y))
        text = f"{row['name']}, {row['mass']:.0f} kg"
        draw.text((x + WIDTH / 2, y + HEIGHT + LINE / 2), text, fill="black", font=font, anchor="mm")
    return whole


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.strip", description=__doc__)
    parser.add_argument("rows", type=Path, help="written by python -m benchmarks.robots --rows")
    parser.add_argument("-o", "--output", type=Path, default=PICTURE)
    parser.add_argument("--across", type=int, default=5, help="pictures in a line")
    asked = parser.parse_args(arguments)
    pin_threads()
    warnings.simplefilter("ignore")
    rows = [json.loads(line) for line in asked.rows.read_text(encoding="utf-8").splitlines()]
    whole = strip([row for row in rows if passed(row)], asked.across)
    whole.quantize(128).save(asked.output, optimize=True)
    print(asked.output)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
