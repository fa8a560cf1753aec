"""Rates and accelerations of a limb's joints from the motions of base and tip, in the axes that suit best.

Screws are constant on their own links, so in the axes of a link amid the limb most of their components are 0:
only the wanted motion is turned there. Formulas over records, any scalar.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from screwkin.algebra.scalar import Scalar
from screwkin.algebra.screws import AT_REST, Displacement, Screw, advance, carry, turn
from screwkin.algebra.se3 import Pose, Rotation, Twist, Vector, bracket, cross
from screwkin.kinematics.positions import pose_in_base
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.mechanism.limb_rates import Split, point_rates, pose_rates, split_of
from screwkin.model.robot import Limb, Robot


@dataclass(frozen=True)
class LimbMotion:
    """A limb of six joints, whose tip has a given twist, or of three, whose tip has a given velocity.

    Attributes:
        path: indices of its joints in q.
        split: see ``limb_rates``; None for three joints.
        length: of the limb [m].
        tip: pose of the tip; world axes, from the base origin.
        point: where screws are expressed, see ``point_of``; world axes, likewise.
        axes: from the axes of the link in which screws are expressed to world axes.
        twists: the screws, in the link's axes at the point.
    """

    path: tuple[int, ...]
    split: Split | None
    length: float
    tip: Pose
    point: Vector
    axes: Rotation
    twists: tuple[Twist, ...]

    @classmethod
    def of(
        cls, robot: Robot, limb: Limb, D: Sequence[Displacement], q: Sequence[Scalar], joints: int
    ) -> LimbMotion:
        """The limb where ``D`` (world axes, from the base origin) has its links.

        Args:
            robot: the robot.
            limb: one of its limbs.
            D: displacements of all links.
            q: joint positions.
            joints: number of the limb's joints before the link in whose axes screws are expressed.
        """
        chain = SerialChain.of(robot, limb.name)
        split, path = split_of(chain), chain.joints
        carried = dict(zip(robot.link_names, D, strict=True))
        links = [robot.joints[path[0]].parent, *(robot.joints[i].child for i in path)]
        link, fixed = reference_point(chain, split)
        point = carried[links[link]] @ fixed
        twists = seen_screws(chain, split, [q[i] for i in path], joints)
        tip = pose_in_base(robot, D, limb.tip)
        return cls(path, split, chain.length, tip, point, carried[links[joints]].R, twists)

    def _turned(self, omega: Vector, v: Vector) -> Twist:
        return turn(self.axes.T, Twist(omega, v))

    def _solved(self, wanted: Twist) -> tuple[list[Scalar], Scalar]:
        if len(self.path) == 6:
            return pose_rates(self.twists, self.split, wanted, self.length)
        return point_rates(self.twists, wanted.v, self.length)

    def _here(self, tip: Twist) -> Vector:
        """Velocity at the point of a body that moves with a twist given at the tip."""
        return tip.v + cross(tip.omega, self.point - self.tip.p)

    def rates(self, base: Twist, tip: Twist) -> tuple[list[Scalar], Scalar]:
        """Joint rates, and the limb's determinant.

        Args:
            base: its twist at the base origin, world axes.
            tip: twist at the tip's origin; of three joints only its velocity matters.
        """
        v = self._here(tip) - (base.v + cross(base.omega, self.point))
        return self._solved(self._turned(tip.omega - base.omega, v))

    def accelerations(
        self, base: Twist, tip: Twist, base_rate: Twist, tip_rate: Twist, rates: Sequence[Scalar]
    ) -> list[Scalar]:
        """Joint accelerations; ``base_rate`` and ``tip_rate`` are the derivatives of the two twists."""
        p = self.point
        V = self._turned(base.omega, base.v + cross(base.omega, p))
        spin = base_rate.v - cross(base.omega, base.v)
        known = self._turned(base_rate.omega, spin + cross(base_rate.omega, p))
        for twist, rate in zip(self.twists, rates, strict=True):
            known = known + bracket(V, twist) * rate
            V = V + twist * rate
        # A fixed point's spatial acceleration is the body point's, less alpha x r and omega x its velocity.
        if len(self.path) == 6:
            alpha, r = tip_rate.omega, p - self.tip.p
            v = tip_rate.v - cross(tip.omega, tip.v) + cross(alpha, r)
            wanted = self._turned(alpha, v)
        else:
            back = self.axes.T
            wanted = Twist(known.omega, back @ tip_rate.v - cross(V.omega, V.v))
        return self._solved(wanted - known)[0]


def reference_point(chain: SerialChain, split: Split | None) -> tuple[int, Vector]:
    """Where a limb's screws are expressed: the split's point, else the tip.

    Returns:
        Number of joints before the link to which the point belongs, and the point in the zero pose.
    """
    return (split.first, split.point) if split else (len(chain.screws), chain.tip.p)


def seen_screws(
    chain: SerialChain, split: Split | None, q: Sequence[Scalar], joints: int
) -> tuple[Twist, ...]:
    """A limb's screws at ``point_of``, axes of the link after that many joints."""
    seen = displacements_seen_from(chain.screws, q, joints)
    link, fixed = reference_point(chain, split)
    here = seen[link] @ fixed
    screws = [carry(d, screw) for d, screw in zip(seen, chain.screws, strict=False)]
    return tuple(Screw(s.s, s.s0 - here, s.pitch).twist for s in screws)


def displacements_seen_from(screws: Sequence[Screw], q: Sequence[Scalar], joints: int) -> list[Displacement]:
    """Displacements of a chain's links, base first, relative to the link after that many joints.

    The zero pose is the frame of reference: the link itself is at rest.
    """
    inward, outward = [AT_REST], [AT_REST]
    for k in reversed(range(joints)):
        inward.append(advance(inward[-1], screws[k], -q[k]))
    for k in range(joints, len(screws)):
        outward.append(advance(outward[-1], screws[k], q[k]))
    return [*inward[:0:-1], *outward]
