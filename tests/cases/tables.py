"""Tables that were read wrongly once, each the bundled one with a few rows changed."""

from __future__ import annotations

from pathlib import Path

from screwkin.model.library import find_robot

BIOLOID = Path(find_robot("bioloid")).read_text(encoding="utf-8")


def with_points(**points: str) -> str:
    """The Bioloid with other points of some joints' axes; mirrored joints follow."""
    text = BIOLOID
    for joint, s0 in points.items():
        head, tail = text.split(f'[[joint]]\nname = "{joint}"', 1)
        before, after = tail.split("s0 = ", 1)
        text = f'{head}[[joint]]\nname = "{joint}"{before}s0 = {s0}\n{after.split(chr(10), 1)[1]}'
    return text


AXIS_POINTS = {
    "midline": with_points(right_shoulder_pitch='[0, 0, "shoulder_z"]'),
    "outer": with_points(right_shoulder_pitch='[0, "-shoulder_y - 0.03", "shoulder_z"]'),
    "far": with_points(right_hip_yaw='[0, "-hip_y", 10]'),
    "legs": with_points(right_hip_yaw='[0, "-hip_y", 0.05]', right_hip_pitch='[0, "-hip_y - 0.04", 0]'),
}
"""Axes as they are, by other points of theirs."""

HEAD = """
[[link]]
name = "head"
mass = 0.1
com = [0, 0, 0.2]
inertia = { box = [0.04, 0.04, 0.04] }

[[joint]]
name = "neck"
parent = "torso"
child = "head"
type = "revolute"
s = [0, 0, 1]
s0 = [0, 0, 0.17]
lower = -1.5
upper = 1.5
velocity = "speed"
effort = "torque"
"""

PELVIS = """
[[link]]
name = "pelvis"
mass = 0.2
com = [0, 0, 0]
inertia = { box = [0.04, 0.08, 0.03] }

[[joint]]
name = "waist_yaw"
parent = "pelvis"
child = "torso"
type = "revolute"
s = [0, 0, 1]
s0 = [0, 0, 0]
lower = -1.5
upper = 1.5
velocity = "speed"
effort = "torque"
"""


def without(text: str, title: str, name: str) -> str:
    """The text without one row."""
    start = text.index(f'{title}\nname = "{name}"')
    return text[:start] + text[text.index("[[", start + 2) :]


NECK = BIOLOID.replace("# ---- Joints", f"{HEAD}\n# ---- Joints")
"""A joint outside all limbs."""

WAIST_JOINT = (
    BIOLOID.replace('base_link = "torso"', 'base_link = "pelvis"')
    .replace('name = "right_hip_yaw"\nparent = "torso"', 'name = "right_hip_yaw"\nparent = "pelvis"')
    .replace("# ---- Joints", f"{PELVIS}\n# ---- Joints")
)
"""A joint below both arms."""

WITHOUT_YAW = (
    without(without(BIOLOID, "[[link]]", "right_hip_yaw_link"), "[[joint]]", "right_hip_yaw")
    .replace('parent = "right_hip_yaw_link"', 'parent = "torso"')
    .replace("right_hip_yaw = 7\nleft_hip_yaw = 8\n", "")
)
"""Legs of five joints, none of which turns a foot about the vertical."""

LONG_LEGS = (
    WITHOUT_YAW.replace("thigh = 0.0773829", "thigh = 0.12")
    .replace("calf = 0.0780929", "calf = 0.12")
    .replace("waist_height = 0.170", "waist_height = 0.255")
    .replace('limit = "150*deg"', 'limit = "110*deg"')
)
"""The same with long legs, for which gaits of the Bioloid stoop too low."""
