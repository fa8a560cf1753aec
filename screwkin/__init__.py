"""screwkin: humanoid robots by screw theory. Names load on first use (see ``__all__``)."""

from __future__ import annotations

from importlib import import_module
from typing import Any

_HOMES = {
    "screwkin.api.body": (
        "home link_poses frame_pose jacobian center_of_mass com_jacobian momentum mass_matrix"
        " inverse_dynamics ground_wrench"
    ),
    "screwkin.gait.balance": "zmp",
    "screwkin.gait.files": "load_gait",
    "screwkin.gait.walk": "walk",
    "screwkin.trajectory": "Trajectory load_trajectory",
    "screwkin.api.mechanism": "network_matrix virtual_motion secondary_rates solve_pose",
    "screwkin.mechanism.choice": "closed_mechanism",
    "screwkin.model.robot": "Robot",
    "screwkin.model.state": "State",
    "screwkin.model.table": "load_robot",
    "screwkin.errors": "ScrewkinError",
}
_HOME_OF = {name: module for module, names in _HOMES.items() for name in names.split()}

__version__ = "0.1.0"
__all__ = sorted(_HOME_OF)


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module 'screwkin' has no attribute {name!r}")
    return getattr(import_module(_HOME_OF[name]), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
