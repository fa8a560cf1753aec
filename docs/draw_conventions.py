"""Draws docs/images/conventions.svg: the frames of a robot, a screw axis, and its twist.

Run it from anywhere: python docs/draw_conventions.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

TARGET = Path(__file__).parent / "images" / "conventions.svg"
SIZE = (960, 440)
INK, SOFT, RED, GREEN, BLUE, ORANGE = "#22303c", "#9aa7b1", "#c0392b", "#1e8449", "#1f5fa8", "#d35400"
AXES = ((RED, "x"), (GREEN, "y"), (BLUE, "z"))


class Panel:
    """One view of the same space: x towards the reader's lower left, y to the right, z up."""

    def __init__(self, origin: tuple[float, float], scale: float) -> None:
        azimuth, elevation = np.radians(62), np.radians(20)
        c, s = np.cos(azimuth), np.sin(azimuth)
        right = np.array([-c, s, 0.0])
        up = np.array([-s * np.sin(elevation), -c * np.sin(elevation), np.cos(elevation)])
        self.view, self.origin, self.scale = np.array([right, -up]), np.array(origin), scale
        self.near = np.array([s * np.cos(elevation), c * np.cos(elevation), np.sin(elevation)])
        self.parts: list[str] = []

    def at(self, point) -> np.ndarray:
        """Where a point of space falls on the page."""
        return self.origin + self.scale * (self.view @ np.asarray(point, float))

    def path(self, points, color=INK, width=1.6, fill="none", dash="", closed=False) -> None:
        """A line through points of space."""
        flat = " L".join(f"{x:.1f} {y:.1f}" for x, y in map(self.at, points))
        style = f'stroke="{color}" stroke-width="{width}" fill="{fill}" stroke-linejoin="round"'
        dashes = f' stroke-dasharray="{dash}"' if dash else ""
        self.parts.append(f'<path d="M{flat}{" Z" if closed else ""}" {style}{dashes}/>')

    def arrow(self, start, end, color=INK, width=2.2, dash="") -> None:
        """An arrow in space; its head lies flat on the page."""
        a, b = self.at(start), self.at(end)
        along = (b - a) / np.linalg.norm(b - a)
        across = np.array([-along[1], along[0]])
        size = 3.2 * width
        self.path([start, end], color, width, dash=dash)
        corners = [
            b + along * 2,
            b - along * size + across * size / 2.2,
            b - along * size - across * size / 2.2,
        ]
        flat = " ".join(f"{x:.1f},{y:.1f}" for x, y in corners)
        self.parts.append(f'<polygon points="{flat}" fill="{color}"/>')

    def text(self, point, words, color=INK, shift=(0, 0), size=15, anchor="start", italic=True) -> None:
        """Words beside a point; ``_{...}`` sets an index."""
        x, y = self.at(point) + shift
        words = words.replace("_{", '<tspan font-size="70%" dy="4">').replace(
            "}", '</tspan><tspan dy="-4"> </tspan>'
        )
        style = ' font-style="italic"' if italic else ""
        place = f'x="{x:.1f}" y="{y:.1f}" font-size="{size}" text-anchor="{anchor}"'
        self.parts.append(f'<text {place} fill="{color}"{style}>{words}</text>')

    def frame(self, at, length, name, shift) -> None:
        """Three axes in their colours, and the frame's name."""
        for axis, (color, letter) in zip(np.eye(3), AXES, strict=True):
            tip = np.asarray(at) + axis * length
            self.arrow(at, tip, color)
            self.text(tip, letter, color, {"x": (-14, 6), "y": (7, 5), "z": (-4, -8)}[letter])
        self.text(at, name, shift=shift, italic=False)

    def box(self, low, high, fill) -> None:
        """A solid box: the faces that look at the reader."""
        low, high = np.asarray(low, float), np.asarray(high, float)
        for axis in range(3):
            u, v = [k for k in range(3) if k != axis]
            corner = low.copy()
            corner[axis] = high[axis] if self.near[axis] > 0 else low[axis]
            face = []
            for du, dv in ((0, 0), (1, 0), (1, 1), (0, 1)):
                point = corner.copy()
                point[u], point[v] = (low, high)[du][u], (low, high)[dv][v]
                face.append(point)
            self.path(face, SOFT, 1.0, fill=fill[axis], closed=True)


def robot() -> Panel:
    """Left: a biped in its zero pose, world and base frames, a tip."""
    p = Panel((232, 352), 330)
    p.path(
        [(-0.2, -0.34, 0), (0.42, -0.34, 0), (0.42, 0.34, 0), (-0.2, 0.34, 0)],
        SOFT,
        1,
        "#f4f6f7",
        closed=True,
    )
    shades = ("#dfe6ea", "#eef2f4", "#f8fafb")
    for side in (-0.085, 0.085):
        p.box((-0.07, side - 0.05, 0), (0.12, side + 0.05, 0.035), shades)
        p.box((-0.03, side - 0.03, 0.06), (0.03, side + 0.03, 0.2), shades)
        p.box((-0.03, side - 0.03, 0.23), (0.03, side + 0.03, 0.37), shades)
        p.box((-0.025, side * 2.2 - 0.025, 0.4), (0.025, side * 2.2 + 0.025, 0.66), shades)
    p.box((-0.06, -0.125, 0.4), (0.06, 0.125, 0.68), shades)
    p.box((-0.05, -0.05, 0.71), (0.05, 0.05, 0.8), shades)
    world, base, foot = (0.36, -0.26, 0), (0.06, 0, 0.4), (0.12, 0.085, 0.0)
    p.frame(world, 0.19, "world", (-64, -14))
    p.frame(base, 0.24, "", (0, 0))
    p.text((0, -0.24, 0.74), "base", shift=(-34, 0), italic=False)
    p.path([(0, -0.25, 0.725), base], SOFT, 1)
    p.frame(foot, 0.13, "", (0, 0))
    p.text(foot, "tip", shift=(14, 28), italic=False)
    p.arrow(world, base, ORANGE, 1.6, dash="5 4")
    p.text(np.add(world, base) / 2, "T_{world_base}", ORANGE, (-92, -22))
    p.text(
        (0, 0, 0), "x forward, y left, z up; gravity along -z", shift=(-2, 74), anchor="middle", italic=False
    )
    return p


def screw() -> Panel:
    """Right: a screw axis with pitch, the helix of a point, and the twist taken at the origin."""
    p = Panel((640, 300), 330)
    s = np.array([-0.2, 0.2, 0.93])
    s /= np.linalg.norm(s)
    s0, h, radius = np.array([-0.1, 0.5, 0.22]), 0.034, 0.1
    a = np.cross(s, [1.0, 0, 0])
    a /= np.linalg.norm(a)
    b = np.cross(s, a)
    p.frame((0, 0, 0), 0.2, "O", (4, 20))
    p.path([s0 - 0.42 * s, s0 + 0.6 * s], SOFT, 1.4, dash="8 4 2 4")
    turns = np.linspace(0, 3.6 * np.pi, 150)
    helix = [s0 + s * h * t + radius * (np.cos(t) * a + np.sin(t) * b) for t in turns]
    p.path(helix, ORANGE, 1.8)
    p.arrow(helix[-5], helix[-1], ORANGE, 1.8)
    p.arrow((0, 0, 0), s0, INK, 1.8)
    p.text(s0 * 0.62, "s_{0}", shift=(-6, -10))
    p.arrow(s0, s0 + 0.2 * s, INK, 2.6)
    p.text(s0 + 0.2 * s, "s", shift=(-16, 6), size=17)
    top = s0 + s * h * turns[-1]
    foot, lead = s0 + radius * (2.2 * b + 0.2 * a), s * h * 2 * np.pi
    p.arrow(foot, foot + lead, SOFT, 1.6)
    p.text(foot + lead / 2, "2π h", shift=(12, 4))
    p.text(top + 0.2 * s, "axis", SOFT, shift=(16, -10), italic=False)
    omega, v = 0.42 * s, 0.8 * (np.cross(s0, s) + h * s)
    p.arrow((0, 0, 0), omega, RED, 3)
    p.text(omega, "ω = s q̇", RED, shift=(-14, 0), anchor="end")
    p.arrow((0, 0, 0), v, BLUE, 3)
    p.text(v, "v = (s_{0} × s + h s) q̇", BLUE, shift=(-8, -2), anchor="end")
    p.text((0, 0, 0), "revolute: h = 0; prismatic: [0; s]", shift=(70, 126), anchor="middle", italic=False)
    p.text((0, 0, 0), "twist [ω; v]", shift=(70, 104), anchor="middle", italic=False)
    return p


def drawing() -> str:
    """The whole picture as SVG text."""
    width, height = SIZE
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif">'
    parts = [part for panel in (robot(), screw()) for part in panel.parts]
    return "\n".join([head, f'<rect width="{width}" height="{height}" fill="#ffffff"/>', *parts, "</svg>\n"])


def main() -> None:
    """Write the picture."""
    TARGET.parent.mkdir(exist_ok=True)
    TARGET.write_text(drawing(), encoding="utf-8")
    print(TARGET)


if __name__ == "__main__":
    main()
