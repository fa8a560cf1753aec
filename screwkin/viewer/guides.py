"""What explains a robot beside its body, put up in the scene when it is first asked for."""

from __future__ import annotations

from typing import Any

import numpy as np

from screwkin.errors import ScrewkinError
from screwkin.mechanism.choice import closed_mechanism
from screwkin.model.robot import Robot
from screwkin.sim.solids import robot_size
from screwkin.viewer.marks import circuit_line, placed_frames, screw_axes
from screwkin.viewer.nodes import Redrawn, put_mesh, quaternions
from screwkin.viewer.session import Session
from screwkin.viewer.strokes import bars

NO_CIRCUIT = "none"
TURNS, SLIDES = (214, 120, 20), (20, 130, 170)
REAL, VIRTUAL = (230, 60, 30), (150, 110, 220)


def link_node(name: str) -> str:
    """The node that carries what a link carries."""
    return f"/world/robot/{name}"


def put_axes(scene: Any, robot: Robot) -> list[Any]:
    """The screw axes of all joints with their names; returns what was put up."""
    size, handles = robot_size(robot), []
    for axis in screw_axes(robot):
        name = f"{link_node(robot.links[axis.link].name)}/axis {axis.joint}"
        colour = SLIDES if axis.slides else TURNS
        handles += [
            put_mesh(scene, name, bars(axis.ends[None], 0.008 * size), colour),
            scene.add_label(f"{name}/name", axis.joint, position=axis.ends[1]),
        ]
    return handles


def put_frames(scene: Any, robot: Robot) -> list[Any]:
    """The base, the tips and the table's further frames with their names; returns what was put up."""
    size, handles = robot_size(robot), []
    for frame in placed_frames(robot):
        name = f"{link_node(robot.links[frame.link].name)}/frame {frame.name}"
        handles += [
            scene.add_frame(
                name,
                axes_length=0.12 * size,
                axes_radius=0.006 * size,
                position=frame.pose[:3, 3],
                wxyz=quaternions(frame.pose[None])[0],
            ),
            scene.add_label(f"{name}/name", frame.name),
        ]
    return handles


class LitCircuit:
    """One circuit of the closed mechanism, lit up: red along the links, violet along virtual chains."""

    def __init__(self, scene: Any, robot: Robot) -> None:
        self._robot, self._thick = robot, 0.012 * robot_size(robot)
        self._parts = (
            (True, Redrawn(scene, "/world/circuit/virtual", VIRTUAL)),
            (False, Redrawn(scene, "/world/circuit/real", REAL)),
        )
        self.name = NO_CIRCUIT

    def show(self, session: Session) -> None:
        """Draw it where the session has the robot; nothing where no circuit is chosen."""
        if self.name == NO_CIRCUIT:
            for _, part in self._parts:
                part.remove()
            return
        line = circuit_line(closed_mechanism(self._robot), self.name, session.Ts, session.T_world_base)
        virtual = np.array(line.virtual, dtype=bool)
        for kind, part in self._parts:
            part.as_(bars(line.legs[virtual == kind], self._thick))


def circuits_of(robot: Robot) -> tuple[str, ...]:
    """Names of the circuits of a robot's closed mechanism, none where it has none."""
    try:
        return closed_mechanism(robot).circuit_names
    except ScrewkinError:
        return ()
