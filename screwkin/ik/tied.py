"""Limbs of which a linkage ties joints on the way to the tip to one another, as rods tie a knee to a heel.

Such a limb has fewer positions than joints on its way: those that lead. The others follow as the linkage is
put together at the reference posture, and their rates from the loop's own Jacobian.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.scalar import Scalar
from screwkin.compiler.program import kept
from screwkin.errors import InputError
from screwkin.ik.linkage import loop_residual, tree_thetas, with_followers
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.mechanism.linkages import Linkage, limb_linkages
from screwkin.model.robot import Robot
from screwkin.model.state import reference_posture


@dataclass(frozen=True, eq=False)
class TiedChain(SerialChain):
    """A limb's chain whose joints are those that lead; its screws are those of the whole way.

    Attributes:
        robot: whose limb it is.
        way: indices in ``robot.tree`` of the joints on the way.
        ties: its linkages that tie joints of the way.
    """

    robot: Robot | None = None
    way: tuple[int, ...] = ()
    ties: tuple[Linkage, ...] = ()

    def moved(self, q: Array) -> tuple[list[Scalar], Array]:
        """Positions (B,) of all screws, and their rates (B, screws, joints) per unit rate of every joint."""
        assert self.robot is not None
        rest, own = np.array(reference_posture(self.robot), dtype=float), len(self.joints)
        whole = np.tile(rest, (len(q), 1))
        whole[:, list(self.joints)] = q
        rates = np.zeros((len(q), whole.shape[1], own))
        rates[:, list(self.joints), np.arange(own)] = 1.0
        for tie in self.ties:
            whole = with_followers(self.robot, tie, whole).q
            _, J = loop_residual(self.robot, tie.closures, whole)
            following = np.linalg.pinv(J[..., list(tie.followers)]) @ J[..., list(tie.imposed)]
            rates[:, list(tie.followers)] = -following @ rates[:, list(tie.imposed)]
        gears = [self.robot.gears[i] for i in self.way]
        ratios = np.array([float(ratio) for _, ratio in gears])
        return tree_thetas(self.robot, self.way, whole), rates[:, [i for i, _ in gears]] * ratios[:, None]


@kept
def tied_linkages(robot: Robot, limb: str) -> tuple[Linkage, ...]:
    """A limb's linkages of which joints on its way follow others.

    Raises:
        InputError: a loop ties joints of the limb to those of another limb.
    """
    return tuple(one for one in limb_linkages(robot, limb) if set(one.path) - set(one.imposed))


def limb_chain(robot: Robot, limb: str, free: tuple[str, ...] = ()) -> SerialChain:
    """The chain of a limb in the joints that lead: all of its way, but those coupled or tied to others.

    Args:
        robot: the robot.
        limb: name of a limb, or of its tip.
        free: rotations of the tip that are free, as of ``SerialChain.of``.

    Raises:
        UnknownNameError: no such limb.
        InputError: a loop ties joints of the limb to those of another limb, or rotations of a limb are free
            whose joints are tied.
    """
    name = robot.limb(limb).name
    if not tied_linkages(robot, name):
        return SerialChain.of(robot, name, free, coupled=True)
    if free:
        raise InputError(f"{robot.name}: loops tie joints of {name}; give whole poses, no free rotations")
    return _tied_chain(robot, name)


def refuse_tied(robot: Robot, limb: str, what: str) -> None:
    """Refuse a limb whose joints loops tie to one another where they are taken as free.

    Raises:
        InputError: names the closures.
    """
    if ties := tied_linkages(robot, limb):
        names = ", ".join(tie.name for tie in ties)
        raise InputError(
            f"{robot.name} has closures ({names}) that tie joints of {limb} to one another, and {what} takes "
            "them as free; use limb_ik"
        )


@kept
def _tied_chain(robot: Robot, limb: str) -> TiedChain:
    whole, ties = SerialChain.of(robot, limb, coupled=True), tied_linkages(robot, limb)
    following = {i for tie in ties for i in tie.followers}
    leading = {i for tie in ties for i in tie.imposed}
    own = [k for k, i in enumerate(whole.joints) if i not in following]
    values = {f.name: getattr(whole, f.name) for f in fields(whole) if f.init}
    values |= {key: tuple(values[key][k] for k in own) for key in ("names", "joints")}
    values |= {key: values[key][own] for key in ("lower", "upper")}
    turns = [bool(whole.turning[k]) and whole.joints[k] not in leading for k in own]
    return TiedChain(
        **{**values, "turning": np.array(turns), "gears": ()},
        robot=robot,
        way=robot.path_to(robot.limb(limb).link),
        ties=ties,
    )
