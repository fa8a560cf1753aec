"""Tables of humanoids with any joints: legs and arms of any number, waists, necks, toes."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos

AXES = {"yaw": (0, 0, 1), "roll": (1, 0, 0), "pitch": (0, 1, 0)}
HIP, KNEE, ANKLE, TOE, SOLE = 0.0, -0.25, -0.5, -0.53, -0.55
SHOULDER, ELBOW, WRIST, HAND = 0.3, 0.1, -0.08, -0.14
BEND = 0.5
"""Hip pitch at home [rad], forwards; the knee bends twice as far."""
LEG = ("hip_yaw", "hip_roll", "hip_pitch", "knee_pitch", "ankle_pitch", "ankle_roll")
ARM = ("shoulder_pitch", "shoulder_roll", "elbow_pitch")
SEVEN = (
    "shoulder_pitch",
    "shoulder_roll",
    "shoulder_yaw",
    "elbow_pitch",
    "wrist_yaw",
    "wrist_pitch",
    "wrist_roll",
)
HEIGHTS = {
    "hip": HIP,
    "knee": KNEE,
    "ankle": ANKLE,
    "toe": TOE,
    "shoulder": SHOULDER,
    "elbow": ELBOW,
    "wrist": WRIST,
}


def humanoid(
    leg: Sequence[str] = LEG,
    arm: Sequence[str] = ARM,
    waist: str = "",
    extra: str = "",
    hip_y: float = 0.08,
    sole: tuple[float, float] = (0.2, 0.11),
    ahead: float = 0.0,
) -> str:
    """A table.

    Args:
        leg: joints of a leg from the hip on, PLACE_AXIS.
        arm: likewise; none for a robot without arms.
        waist: axis of a joint between pelvis and chest.
        extra: further rows.
        hip_y: half the width of the hips [m].
        sole: length and width [m].
        ahead: of the tip before the ankle [m].
    """
    chest = "chest" if waist else "pelvis"
    rows = [
        '[robot]\nname = "body"\nbase_link = "pelvis"\nbase = "floating"',
        _link("pelvis", 4.0, (0, 0, 0.05), (0.12, 0.16, 0.1)),
    ]
    if waist:
        rows += [_link("chest", 4.0, (0, 0, 0.22), (0.12, 0.2, 0.2))]
        rows += [_joint(f"waist_{waist}", "pelvis", "chest", waist, (0, 0, 0.1))]
    plate = f"{{ center = [{ahead}, {-hip_y}, {SOLE + 0.01}], size = [{sole[0]}, {sole[1]}, 0.02] }}"
    rows += _limb("leg", leg, "pelvis", -hip_y, (ahead, -hip_y, SOLE), plate)
    corners = [[x * sole[0] / 2 + ahead, y * sole[1] / 2 - hip_y, SOLE] for x, y in CORNERS]
    rows.append(f'[[sole]]\nlimb = "right_leg"\ncorners = {corners}')
    if arm:
        rows += _limb("arm", arm, chest, -0.16, (0, -0.16, HAND))
    q = {
        "hip_pitch": -BEND,
        "knee_pitch": 2 * BEND,
        "ankle_pitch": -BEND,
        "elbow_pitch": -0.8,
        "shoulder_pitch": 0.4,
    }
    named = [f"{side}_{name} = {q[name]}" for side in ("right", "left") for name in (*leg, *arm) if name in q]
    height = (KNEE - HIP) * -2 * cos(BEND) + ANKLE - SOLE
    rows.append("\n".join(["[[posture]]", 'name = "home"', f"base_height = {height}", "[posture.q]", *named]))
    return "\n\n".join([*rows, extra])


CORNERS = ((1, -1), (1, 1), (-1, 1), (-1, -1))


def _limb(
    kind: str, names: Sequence[str], root: str, y: float, tip: tuple[float, float, float], plate: str = ""
) -> list[str]:
    """Rows of a right limb and of its reflection."""
    rows, parent = [], root
    for k, name in enumerate(names):
        place, _, axis = name.rpartition("_")
        z = HEIGHTS[place]
        child = f"right_{name}_link"
        last = k == len(names) - 1 or names[k + 1].rpartition("_")[0] != place
        below = HEIGHTS[names[k + 1].rpartition("_")[0]] if k + 1 < len(names) else tip[2]
        rows.append(
            _link(child, 0.6 if last else 0.02, (0, y, (z + below) / 2), (0.05, 0.05, abs(below - z) or 0.02))
        )
        rows.append(_joint(f"right_{name}", parent, child, axis, (0, y, z)))
        parent = child
    if plate:
        rows[-2] = rows[-2].rpartition("boxes = ")[0] + f"boxes = [{plate}]"
    xyz = ", ".join(map(str, tip))
    end = "foot" if kind == "leg" else "hand"
    rows.append(
        f'[[limb]]\nname = "right_{kind}"\nkind = "{kind}"\nlink = "{parent}"\ntip = "right_{end}"\n'
        f"frame = {{ xyz = [{xyz}] }}"
    )
    rows.append(f'[[limb]]\nname = "left_{kind}"\nmirror = "y"\nof = "right_{kind}"')
    return rows


def _link(name: str, mass: float, com: tuple[float, ...], box: tuple[float, ...]) -> str:
    return (
        f'[[link]]\nname = "{name}"\nmass = {mass}\ncom = {list(com)}\ninertia = {{ box = {list(box)} }}\n'
        f"boxes = [{{ center = {list(com)}, size = {list(box)} }}]"
    )


def _joint(name: str, parent: str, child: str, axis: str, s0: tuple[float, ...]) -> str:
    return (
        f'[[joint]]\nname = "{name}"\nparent = "{parent}"\nchild = "{child}"\ntype = "revolute"\n'
        f"s = {list(AXES[axis])}\ns0 = {list(s0)}\nlower = -2.4\nupper = 2.4\nvelocity = 20.0\neffort = 200.0"
    )
