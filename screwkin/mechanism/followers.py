"""Which couplings of a tip's virtual chain follow where its limb has too few joints to impose all six.

A limb of five joints moves its tip in five directions: five couplings of the chain are imposed and one
rotation follows; of four joints, two follow. Positions are imposed first, then a level sole, then the
heading: so that a rotation about the vertical follows where that leaves the limb well conditioned, else a
lean sideways, else one fore and aft. Rotations that follow stand last in the chain: they turn the tip about
its own axes, and what is imposed does not depend on them.
"""

from __future__ import annotations

import numpy as np

from screwkin.compiler.program import kept
from screwkin.kinematics.serial_chain import SerialChain, volume
from screwkin.mechanism.chains import SPATIAL
from screwkin.model.records import open_scalars
from screwkin.model.robot import Robot
from screwkin.model.state import reference_posture

POSITION = SPATIAL[:3]
ORDERS = {
    5: (("rx", "ry", "rz"), ("rz", "ry", "rx"), ("rz", "rx", "ry")),
    4: (("ry", "rx", "rz"), ("rx", "ry", "rz"), ("rz", "ry", "rx")),
}
"""Orders of the chain's rotations by the limb's number of joints, the preferred first."""
GOOD = 0.25
"""Share of the best conditioning from which a preferred choice is taken."""
AROUND = 0.3
"""How far from the reference posture, joint by joint, the choice looks [rad or m]."""


@kept
def tip_chain(robot: Robot, limb: str) -> tuple[str, ...]:
    """Couplings of the virtual chain of a limb's tip, those that follow last.

    A chain that the table orders otherwise than x, y, z is the user's choice and stays. So does the chain of
    a limb with any other number of joints than four or five; of coupled ones those that lead count.

    Args:
        robot: the robot.
        limb: name of one of its limbs.
    """
    chosen = robot.limb(limb)
    path = robot.path_to(chosen.link)
    numbers = (chosen.frame, *(robot.tree[i].screw for i in path))
    joints = len(robot.leading(chosen.link))
    if chosen.chain != SPATIAL or joints not in ORDERS:
        return chosen.chain
    if any(True for _ in open_scalars(numbers)):
        return chosen.chain
    orders = ORDERS[joints]
    volumes = [_volume(robot, limb, order[joints - 3 :]) for order in orders]
    best = max(volumes)
    order = next(o for o, v in zip(orders, volumes, strict=True) if v >= GOOD * best)
    return (*POSITION, *order)


def followers(robot: Robot, limb: str) -> tuple[str, ...]:
    """Rotations of a tip's chain that follow, in its order; none of a limb with six joints or more.

    Args:
        robot: the robot.
        limb: name of one of its limbs.
    """
    chain = tip_chain(robot, limb)
    count = max(len(robot.leading(robot.limb(limb).link)), len(POSITION))
    return chain[count:] if len(chain) == len(SPATIAL) else ()


def _volume(robot: Robot, limb: str, free: tuple[str, ...]) -> float:
    """Mean volume of the screws of a limb's joints and of its tip's free rotations.

    Of the reference posture and of postures around it, one joint at a time: a straight knee decides nothing.
    """
    chain = SerialChain.of(robot, limb, free, coupled=True)
    q = np.zeros((2 * len(chain.joints) + 1, len(chain.joints)))
    own = len(chain.joints) - len(free)
    q[:, :own] = np.array(reference_posture(robot), dtype=float)[list(chain.joints[:own])]
    q[1:] += AROUND * np.concatenate([np.eye(len(chain.joints)), -np.eye(len(chain.joints))])
    return float(volume(chain, q).mean())
