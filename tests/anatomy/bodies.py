"""URDF of bodies with nameless parts: limbs of any joints, feet of any shape, any base frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import pi

AXES = {"yaw": (0, 0, 1), "roll": (1, 0, 0), "pitch": (0, 1, 0)}
HEIGHTS = {"hip": 0.0, "knee": -0.25, "shin": -0.28, "ankle": -0.5}
HEIGHTS |= {"shoulder": 0.3, "elbow": 0.1, "wrist": -0.05}
SOLE = -0.55
HIP_Y, SHOULDER_Y = 0.08, 0.16
LEG = ("hip_yaw", "hip_roll", "hip_pitch", "knee_pitch", "ankle_pitch", "ankle_roll")
ARM = ("shoulder_pitch", "shoulder_roll", "elbow_pitch")
AHEAD = 0.02
"""How far the middle of a sole lies ahead of the ankle [m]."""
PLATE = 0.02


@dataclass
class Body:
    """Links and joints of a URDF, numbered as they come."""

    links: list[str] = field(default_factory=list)
    joints: list[str] = field(default_factory=list)
    places: list[tuple[float, float, float]] = field(default_factory=list)

    def link(self, place: Sequence[float], mass: float, com: Sequence[float], shape: str = "") -> int:
        """Another link; place and CoM are in base axes [m]."""
        x, y, z = (c - p for c, p in zip(com, place, strict=True))
        self.links.append(
            f'<link name="part{len(self.links)}"><inertial><origin xyz="{x} {y} {z}"/>'
            f'<mass value="{mass}"/><inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/>'
            f"</inertial>{shape}</link>"
        )
        self.places.append((place[0], place[1], place[2]))
        return len(self.links) - 1

    def joint(self, parent: int, child: int, axis: str, limits: tuple[float, float] = (-2.5, 2.5)) -> None:
        """A revolute joint at the child's place; without an axis, a fixed one."""
        x, y, z = (c - p for c, p in zip(self.places[child], self.places[parent], strict=True))
        kind = "revolute" if axis else "fixed"
        s = " ".join(map(str, AXES[axis])) if axis else "1 0 0"
        self.joints.append(
            f'<joint name="axis{len(self.joints)}" type="{kind}"><origin xyz="{x} {y} {z}"/>'
            f'<parent link="part{parent}"/><child link="part{child}"/><axis xyz="{s}"/>'
            f'<limit lower="{limits[0]}" upper="{limits[1]}" effort="100" velocity="10"/></joint>'
        )

    def chain(
        self,
        names: Sequence[str],
        root: int,
        y: float,
        bends: tuple[float, float] = (0, 0),
        raised: bool = False,
        mass: float = 0.5,
    ) -> int:
        """Joints one below the other, or raised, above; the last link's number."""
        parent = root
        top, sense = HEIGHTS[names[0].rpartition("_")[0]] if names else 0.0, -1 if raised else 1
        for name in names:
            place, _, axis = name.rpartition("_")
            z = top + sense * (HEIGHTS[place] - top)
            at = (0.0, y, z)
            child = self.link(at, mass, (0.0, y, z - sense * 0.03))
            limits = bends if place == "knee" and bends != (0, 0) else (-2.5, 2.5)
            self.joint(parent, child, axis, limits)
            parent = child
        return parent

    def text(self, rpy: str = "0 0 0", xyz: str = "0 0 0") -> str:
        """The URDF; part 0 stands turned in the base frame."""
        base = (
            '<link name="frame"/><joint name="mount" type="fixed"><parent link="frame"/>'
            f'<child link="part0"/><origin xyz="{xyz}" rpy="{rpy}"/></joint>'
        )
        return f'<robot name="body">{base}{"".join(self.links)}{"".join(self.joints)}</robot>'


def box(center: Sequence[float], size: Sequence[float], rpy: str = "0 0 0", role: str = "collision") -> str:
    """A box of a link, in the link's axes."""
    xyz, edges = " ".join(map(str, center)), " ".join(map(str, size))
    return f'<{role}><origin xyz="{xyz}" rpy="{rpy}"/><geometry><box size="{edges}"/></geometry></{role}>'


def ball(center: Sequence[float], radius: float) -> str:
    """A sphere of a link, in the link's axes."""
    xyz = " ".join(map(str, center))
    return f'<collision><origin xyz="{xyz}"/><geometry><sphere radius="{radius}"/></geometry></collision>'


def biped(
    leg: Sequence[str] = LEG,
    arm: Sequence[str] = ARM,
    foot: str = "flat",
    tilt: float = 0.0,
    toe: bool = False,
    waist: str = "",
    neck: bool = False,
    fingers: int = 0,
    bends: tuple[float, float] = (0, 0),
    hips: Sequence[float] = (0.0,),
    ahead: float = AHEAD,
    raised: bool = False,
    hand: float = 0.0,
    lean: float = 0.0,
    arm_mass: float = 0.5,
    wide: float = 0.1,
) -> Body:
    """A body with legs, and arms unless they have no joints.

    Args:
        leg: joints of a leg from the hip on, PLACE_AXIS.
        arm: likewise.
        foot: ``flat`` or ``point``, or ``none`` for legs without shapes.
        tilt: of the right foot's plate about x [rad].
        toe: a toe hinged to the front of every foot.
        waist: axis of a joint between pelvis and chest.
        neck: a joint above the chest.
        fingers: of two joints each, at every hand.
        bends: limits of the knees.
        hips: places of pairs of legs along x.
        ahead: how far the middle of a sole lies ahead of the ankle [m].
        raised: arms point up.
        hand: edge of a cube at the end of every arm [m], none if 0.
        lean: how far the feet are ahead of the hips [m].
        arm_mass: of every link of an arm [kg].
        wide: width of a sole [m].
    """
    body = Body()
    pelvis = body.link((0, 0, 0), 4.0, (0, 0, 0.1), box((0, 0, 0.08), (0.12, 0.16, 0.1)))
    chest = pelvis
    if waist:
        chest = body.link((0, 0, 0.15), 4.0, (0, 0, 0.25), box((0, 0, 0.1), (0.12, 0.2, 0.2)))
        body.joint(pelvis, chest, waist)
    if neck:
        head = body.link((0, 0, 0.4), 1.0, (0, 0, 0.45), box((0, 0, 0.05), (0.1, 0.1, 0.1)))
        body.joint(chest, head, "yaw")
    for x in hips:
        for side in (-1, 1):
            before = len(body.places)
            end = body.chain(leg, pelvis, side * HIP_Y, bends)
            _foot(body, end, side, foot, tilt if side < 0 else 0.0, toe, ahead, wide)
            if x + lean:
                _shift(body, before, x + lean)
    for side in (-1, 1) if arm else ():
        end = body.chain(arm, chest, side * SHOULDER_Y, raised=raised, mass=arm_mass)
        if hand:
            _, y, z = body.places[end]
            at = (0.0, y, z + (0.1 if raised else -0.1))
            body.joint(end, body.link(at, 0.1, at, box((0, 0, 0), (hand, hand, hand))), "")
        for k in range(fingers):
            parent = end
            for z in (-0.12, -0.15):
                at = (0.02 * k, side * SHOULDER_Y, z)
                child = body.link(at, 0.02, (at[0], at[1], z - 0.01))
                body.joint(parent, child, "pitch")
                parent = child
    return body


def _foot(
    body: Body, end: int, side: int, kind: str, tilt: float, toe: bool, ahead: float, wide: float
) -> None:
    x, y, _ = body.places[end]
    if kind == "none":
        return
    if kind == "point":
        foot = body.link((x, y, SOLE), 0.2, (x, y, SOLE + 0.02), ball((0, 0, 0.015), 0.015))
    else:
        length = 0.14 if toe else 0.2
        middle = ahead - (0.03 if toe else 0.0)
        plate = box((middle, side * 0.01, PLATE / 2), (length, wide, PLATE), f"{tilt} 0 0")
        foot = body.link((x, y, SOLE), 0.4, (x, y, SOLE + 0.02), plate)
    body.joint(end, foot, "")
    if toe:
        at = (x + 0.06, y, SOLE + 0.015)
        tip = body.link(at, 0.1, at, box((0.03, side * 0.01, -0.005), (0.06, wide, PLATE)))
        body.joint(foot, tip, "pitch", (-0.5, 1.0))


def _shift(body: Body, before: int, x: float) -> None:
    """Links from a number on are moved ahead: only what hangs on the pelvis has another place."""
    first = f'<parent link="part0"/><child link="part{before}"/>'
    for k, joint in enumerate(body.joints):
        if first in joint:
            body.joints[k] = joint.replace('<origin xyz="0.0 ', f'<origin xyz="{x} ', 1)


QUARTER = pi / 2
