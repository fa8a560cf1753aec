"""Efforts of the springs and dampers that a table gives to passive joints."""

from __future__ import annotations

from collections.abc import Sequence

from screwkin.algebra.scalar import Scalar, minus, plus, times
from screwkin.errors import InputError
from screwkin.model.robot import Robot


def refuse_bending(robot: Robot, what: str) -> None:
    """Refuse a robot whose links bend where they would be taken as rigid without a word.

    Raises:
        InputError: names the links.
    """
    if bending := [link.name for link in robot.links if link.spring]:
        raise InputError(
            f"{robot.name} has links that bend ({', '.join(bending)}), and {what} takes links as rigid; give "
            "a passive joint in them a stiffness, or leave out their spring; static_deflection bends them"
        )


def spring_efforts(robot: Robot, q: Sequence[Scalar], qd: Sequence[Scalar]) -> list[Scalar]:
    """Effort of every joint's spring and damper [N m or N]: k (rest - q) - d q'; 0 where there is none."""
    return [
        minus(times(minus(joint.rest, x), joint.stiffness), times(rate, joint.damping or 0))
        if joint.springs
        else 0
        for joint, x, rate in zip(robot.joints, q, qd, strict=True)
    ]


def beside_springs(
    robot: Robot, efforts: Sequence[Scalar], q: Sequence[Scalar], qd: Sequence[Scalar]
) -> list[Scalar]:
    """What of some efforts is needed beside those of springs and dampers."""
    return [minus(a, b) for a, b in zip(efforts, spring_efforts(robot, q, qd), strict=True)]


def with_joint_springs(
    robot: Robot, efforts: Sequence[Scalar], q: Sequence[Scalar], qd: Sequence[Scalar]
) -> list[Scalar]:
    """Some efforts and those of springs and dampers together."""
    return [plus(a, b) for a, b in zip(efforts, spring_efforts(robot, q, qd), strict=True)]
