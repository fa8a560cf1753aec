"""The quantities that formulas define, by name: what can be bound, prepared and written as C."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from screwkin.analysis.workspace import map_program
from screwkin.compiler.program import Program
from screwkin.dynamics.contact import contact_distribution
from screwkin.dynamics.forward import forward_dynamics
from screwkin.dynamics.quantities import balance, ground_wrench, inverse_dynamics, mass_matrix, momentum
from screwkin.errors import UnknownNameError
from screwkin.gait.driven import driven
from screwkin.gait.realise import free_rotations
from screwkin.ik.closed import recognised
from screwkin.ik.programs import limb_programs_of
from screwkin.kinematics.body import (
    center_of_mass,
    com_jacobian,
    frame_pose,
    jacobian,
    limb_jacobian,
    link_poses,
    tip_poses,
)
from screwkin.kinematics.formula import Quantity
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.mechanism.choice import closed_mechanism
from screwkin.mechanism.least_values import block_values
from screwkin.mechanism.network import coupling_screws
from screwkin.mechanism.quantities import network_matrix, virtual_motion
from screwkin.mechanism.secondary import secondary_door
from screwkin.mechanism.tip_motion import joint_rates, motion_program, solvable_limbs
from screwkin.model.robot import Robot

QUANTITIES: Mapping[str, Quantity] = {
    quantity.__name__: quantity
    for quantity in (
        link_poses,
        frame_pose,
        tip_poses,
        jacobian,
        limb_jacobian,
        center_of_mass,
        com_jacobian,
        momentum,
        mass_matrix,
        inverse_dynamics,
        forward_dynamics,
        contact_distribution,
        ground_wrench,
        balance,
        network_matrix,
        virtual_motion,
        joint_rates,
        coupling_screws,
    )
}
"""Every quantity that a formula defines. A new one needs its definition and its row here."""


def _walk(robot: Robot) -> list[Program]:
    moving = driven(robot).moving
    mechanism = closed_mechanism(moving)
    limbs = solvable_limbs(moving, mechanism.secondary)
    motion = [motion_program(moving, True, limbs)] if limbs else []
    forces = balance.definition.door(robot, balance.definition.inputs(robot), ()).guarded
    free = {tip: names for tip, names in free_rotations(mechanism).items() if len(names) < 3}
    return [*limb_programs_of(moving, free), *motion, block_values(moving, *mechanism.choice), forces]


def _maps(robot: Robot) -> list[Program]:
    chains = [SerialChain.of(robot, limb.name) for limb in robot.limbs]
    return [
        map_program(robot, chain)
        for chain in chains
        if len(chain.joints) > 5 and recognised(chain) is not None
    ]


def _rates(robot: Robot) -> list[Program]:
    return [secondary_door(robot, *closed_mechanism(robot).choice).guarded]


ALGORITHMS: Mapping[str, Callable[[Robot], list[Program]]] = {
    "limb_ik": limb_programs_of,
    "solve_pose": limb_programs_of,
    "secondary_rates": _rates,
    "walk": _walk,
    "workspace": _maps,
}
"""Functions that are more than a formula, and the programs in them: these can be prepared too."""


def quantity_of(name: str) -> Quantity:
    """The quantity of that name.

    Raises:
        UnknownNameError: no such quantity.
    """
    if name not in QUANTITIES:
        raise UnknownNameError("quantity", name, tuple(QUANTITIES))
    return QUANTITIES[name]


def subject_of(robot: Robot, quantity: Quantity) -> object:
    """What a quantity is of: the robot, or its closed mechanism."""
    return closed_mechanism(robot) if quantity.definition.parameters[0] == "mechanism" else robot


def choices_of(robot: Robot, quantity: Quantity) -> list[tuple[str, ...]]:
    """The choices that a quantity leaves: of a limb every limb, of a frame every tip; else an empty one."""
    choices = quantity.definition.choices
    if "limb" in choices:
        return [(limb.name,) for limb in robot.limbs]
    return [(tip,) for tip in robot.tip_names] if "frame" in choices else [()]


def programs(robot: Robot, name: str) -> list[Program]:
    """The programs of a quantity, all arrays with a default among the inputs: one for every choice."""
    quantity = quantity_of(name)
    subject, optional = subject_of(robot, quantity), quantity.definition.arrays_by_default
    return [quantity.program(subject, *choice, optional=optional) for choice in choices_of(robot, quantity)]
