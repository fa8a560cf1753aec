"""screwkin: humanoid robots by screw theory. Names load on first use (see ``__all__``)."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from screwkin.analysis.validate import Validation, validate
    from screwkin.compliance.cartesian import cartesian_stiffness
    from screwkin.compliance.commands import compensate
    from screwkin.compliance.elastic_commands import elastic_commands
    from screwkin.compliance.stiffness import static_deflection
    from screwkin.dynamics.contact import ContactPatch
    from screwkin.dynamics.contact_forces import contact_forces
    from screwkin.dynamics.forward import forward_dynamics
    from screwkin.dynamics.quantities import ground_wrench, inverse_dynamics, mass_matrix, momentum
    from screwkin.errors import ScrewkinError
    from screwkin.export.bind import bind, prepare
    from screwkin.gait.balance import Balance, zmp
    from screwkin.gait.files import load_gait
    from screwkin.gait.fitting import fitting_gait
    from screwkin.gait.goals import steps_along, steps_to
    from screwkin.gait.joined import join
    from screwkin.gait.listed import footsteps
    from screwkin.gait.record import Gait
    from screwkin.gait.stand import stand
    from screwkin.gait.walk import walk
    from screwkin.ik.limb import limb_ik
    from screwkin.ik.pose import solve_pose
    from screwkin.kinematics.body import (
        center_of_mass,
        com_jacobian,
        frame_pose,
        jacobian,
        link_poses,
        tip_poses,
    )
    from screwkin.mechanism.actions import action_matrix
    from screwkin.mechanism.choice import closed_mechanism
    from screwkin.mechanism.closure import close_loops
    from screwkin.mechanism.mechanism import Mechanism
    from screwkin.mechanism.quantities import network_matrix, secondary_rates, virtual_motion
    from screwkin.mechanism.redundancy import least_rates
    from screwkin.mechanism.singularity import singularity_report
    from screwkin.mechanism.statics import static_forces
    from screwkin.mechanism.tip_motion import joint_rates
    from screwkin.mechanism.virtual_chain import VirtualChain
    from screwkin.model.library import robot_names
    from screwkin.model.robot import Robot
    from screwkin.model.state import State, home
    from screwkin.model.table import load_robot, robot_from_text
    from screwkin.trajectory import Trajectory, load_trajectory

_HOMES = {
    "analysis.validate": "Validation validate",
    "compliance.cartesian": "cartesian_stiffness",
    "compliance.commands": "compensate",
    "compliance.elastic_commands": "elastic_commands",
    "compliance.stiffness": "static_deflection",
    "dynamics.contact": "ContactPatch",
    "dynamics.contact_forces": "contact_forces",
    "dynamics.forward": "forward_dynamics",
    "dynamics.quantities": "ground_wrench inverse_dynamics mass_matrix momentum",
    "errors": "ScrewkinError",
    "export.bind": "bind prepare",
    "gait.balance": "Balance zmp",
    "gait.files": "load_gait",
    "gait.fitting": "fitting_gait",
    "gait.goals": "steps_along steps_to",
    "gait.joined": "join",
    "gait.listed": "footsteps",
    "gait.record": "Gait",
    "gait.stand": "stand",
    "gait.walk": "walk",
    "ik.limb": "limb_ik",
    "ik.pose": "solve_pose",
    "kinematics.body": "center_of_mass com_jacobian frame_pose jacobian link_poses tip_poses",
    "mechanism.actions": "action_matrix",
    "mechanism.choice": "closed_mechanism",
    "mechanism.closure": "close_loops",
    "mechanism.mechanism": "Mechanism",
    "mechanism.quantities": "network_matrix secondary_rates virtual_motion",
    "mechanism.redundancy": "least_rates",
    "mechanism.singularity": "singularity_report",
    "mechanism.statics": "static_forces",
    "mechanism.tip_motion": "joint_rates",
    "mechanism.virtual_chain": "VirtualChain",
    "model.library": "robot_names",
    "model.robot": "Robot",
    "model.state": "State home",
    "model.table": "load_robot robot_from_text",
    "trajectory": "Trajectory load_trajectory",
}
_HOME_OF = {name: f"screwkin.{module}" for module, names in _HOMES.items() for name in names.split()}

__version__ = "0.2.0"
__all__ = [
    "Balance",
    "ContactPatch",
    "Gait",
    "Mechanism",
    "Robot",
    "ScrewkinError",
    "State",
    "Trajectory",
    "Validation",
    "VirtualChain",
    "action_matrix",
    "bind",
    "cartesian_stiffness",
    "center_of_mass",
    "close_loops",
    "closed_mechanism",
    "com_jacobian",
    "compensate",
    "contact_forces",
    "elastic_commands",
    "fitting_gait",
    "footsteps",
    "forward_dynamics",
    "frame_pose",
    "ground_wrench",
    "home",
    "inverse_dynamics",
    "jacobian",
    "join",
    "joint_rates",
    "least_rates",
    "limb_ik",
    "link_poses",
    "load_gait",
    "load_robot",
    "load_trajectory",
    "mass_matrix",
    "momentum",
    "network_matrix",
    "prepare",
    "robot_from_text",
    "robot_names",
    "secondary_rates",
    "singularity_report",
    "solve_pose",
    "stand",
    "static_deflection",
    "static_forces",
    "steps_along",
    "steps_to",
    "tip_poses",
    "validate",
    "virtual_motion",
    "walk",
    "zmp",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module 'screwkin' has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(_HOME_OF[name]), name)  # from now on looked up at once
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
