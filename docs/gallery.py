"""The gallery's pictures, each made anew by its command.

Run it from anywhere: python docs/gallery.py [NAME...]. They go to docs/images/gallery.
"""

from __future__ import annotations

import shlex
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).parent
FOLDER = HERE / "images" / "gallery"
WIDEST = 1000


class Picture(NamedTuple):
    """What is shown, the command whose folder ``out`` holds it, and its file there."""

    name: str
    caption: str
    command: str
    file: str


PICTURES = (
    Picture(
        "graph",
        "A Bioloid as one closed mechanism: links, joints and virtual chains, one circuit a limb.",
        "screwkin info bioloid --graph -o out",
        "graph.png",
    ),
    Picture(
        "top-view",
        "Eight steps from above: soles, GCoM and zero-moment point.",
        "screwkin walk bioloid --gait smooth --steps 8 -o out",
        "top_view.png",
    ),
    Picture(
        "singular-values",
        "How far each limb is from a singularity along that walk.",
        "screwkin walk bioloid --gait smooth --steps 8 -o out",
        "singular_values.png",
    ),
    Picture(
        "workspace",
        "Where a foot can go, held level, and which joint limit cuts there.",
        "screwkin workspace poppy12 --resolution 0.01 -o out",
        "workspace.png",
    ),
    Picture(
        "deflection",
        "How far a foot sinks on elastic joints, all over its workspace.",
        "screwkin stiffness poppy12 --resolution 0.01 -k 100 -o out",
        "stiffness.png",
    ),
    Picture(
        "falls",
        "A walk that is too quick, in worlds farther and farther from its plan: how often it falls.",
        "screwkin sweep bioloid --gait walk --set steps=1 --set Tc=0.5 --set perturb=x1,x3,x9 --runs 8 "
        "--seed 1 --engine mujoco -o out",
        "falls.png",
    ),
)


def page() -> str:
    """The page: every picture with its command."""
    parts = [
        "# Gallery",
        "Each picture is one command's. `python docs/gallery.py` makes them all anew, "
        "`python docs/gallery.py NAME` one of them; reports hold more, and play.",
    ]
    for picture in PICTURES:
        image = f"![{picture.caption}](../images/gallery/{picture.name}.png)"
        parts += [f"## {picture.name}", picture.caption, f"```text\n{picture.command}\n```", image]
    return "\n\n".join(parts)


def draw(picture: Picture) -> Path:
    """Run the command of a picture in a folder of its own, and take the picture over, in few colours."""
    from PIL import Image

    with tempfile.TemporaryDirectory() as folder:
        words = shlex.split(picture.command)[1:]
        subprocess.run([sys.executable, "-m", "screwkin", *words, "--quiet"], cwd=folder, check=True)
        image = Image.open(Path(folder) / "out" / picture.file).convert("RGB")
        image.thumbnail((WIDEST, WIDEST))
        target = FOLDER / f"{picture.name}.png"
        FOLDER.mkdir(parents=True, exist_ok=True)
        image.quantize(64).save(target, optimize=True)
    return target


def main() -> None:
    """Draw the pictures of the command line's names, or all."""
    for picture in PICTURES:
        if not sys.argv[1:] or picture.name in sys.argv[1:]:
            print(draw(picture), flush=True)


if __name__ == "__main__":
    main()
