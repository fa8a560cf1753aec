"""Arms that rest in a walk because closures hold their hands; and robots that closures keep from walking."""

from __future__ import annotations

from screwkin.errors import InputError
from screwkin.mechanism.holds import joined_tips, refuse_on_floor
from screwkin.model.robot import Robot


def held_arms(robot: Robot) -> dict[str, str]:
    """Arms whose hands closures hold to other hands, and why they rest, by limb.

    Raises:
        InputError: a closure holds the robot on the floor, or a foot to another tip.
    """
    refuse_on_floor(robot, "a walk", "solve_pose moves base and hands over feet that stay")
    resting: dict[str, str] = {}
    for pair in joined_tips(robot):
        legs = [tip for tip in pair if robot.limb(tip).kind == "leg"]
        if legs:
            raise InputError(
                f"{robot.name}: a closure holds {pair[0]} to {pair[1]}, and a walk leads every foot by "
                "itself; solve_pose moves both"
            )
        for tip, other in (pair, pair[::-1]):
            resting[robot.limb(tip).name] = f"a closure holds {tip} to {other}"
    return resting
