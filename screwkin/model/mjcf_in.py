"""A robot read from MJCF: MuJoCo compiles the file, and its bodies at rest are written as URDF and read so.

Includes, defaults and orientations in all their forms are thereby MuJoCo's own. All joint positions are
MuJoCo's; a body with several joints gets massless links between them. Keyframes are postures, equalities of
joints couplings, those of bodies closures. What has no place in a table (tendons, ball joints) is a remark or
refused.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import IDENTITY, Pose, pose_from_array
from screwkin.errors import Fault, TableError, UnknownNameError, needed_for
from screwkin.model.mesh_files import find_mesh
from screwkin.model.mjcf_loops import base_body, is_loop, with_loops
from screwkin.model.mjcf_size import check_size
from screwkin.model.mjcf_springs import with_model_springs
from screwkin.model.records import FLOOR, Posture
from screwkin.model.robot import Robot
from screwkin.model.toml_out import robot_toml, rpy_of
from screwkin.model.urdf_in import UrdfRobot, parse_urdf

_FREE, _BALL, _SLIDE, _HINGE = range(4)  # mjtJoint
_GEOMS: Mapping[int, str] = {2: "sphere", 3: "capsule", 5: "cylinder", 6: "box", 7: "mesh"}  # mjtGeom
_FLAT = 2  # mjtBuiltin
_JOINT_EQUALITY = 2  # mjtEq
_NAME = re.compile(r"\s*([A-Za-z_][^\s/>]*)")
_MOTIONLESS = 1e-12  # coefficients of a coupling that count as none


def is_mjcf(text: str) -> bool:
    """Whether an XML text is MJCF, by its first element."""
    at = -1
    while (at := text.find("<", at + 1)) >= 0:
        if text.startswith("<!--", at):
            at = text.find("-->", at)
            if at < 0:
                return False
        elif first := _NAME.match(text, at + 1):
            return first[1] == "mujoco"
    return False


def parse_mjcf(text: str, path: str = "<text>", repair: bool = False) -> UrdfRobot:
    """The robot of an MJCF text; its base floats if its one body on the ground has a free joint.

    Args:
        text: XML.
        path: where it comes from: meshes and includes are named from its folder.
        repair: as of ``parse_urdf``.

    Raises:
        TableError: MuJoCo cannot compile it, it asks for too much memory, or it has joints or bodies that
            no table can hold.
        MissingDependencyError: mujoco is absent.
    """
    with needed_for("Reading MJCF"):
        import mujoco
    check_size(text, path)
    folder, notes = Path(path).parent, dict[str, list[str]]()
    try:
        whole = Path(path).is_file()
        spec = mujoco.MjSpec.from_file(path) if whole else mujoco.MjSpec.from_string(text)
        files = _meshes(spec, folder, notes)
        model = spec.compile()
    except ValueError as wrong:
        found = f"MuJoCo cannot compile it ({' '.join(str(wrong).split())})"
        raise TableError(path, [Fault("file", "", found, "Mend the MJCF")]) from None
    data = mujoco.MjData(model)
    _check(model, path)
    data.qpos[:] = model.qpos0
    for j in range(model.njnt):
        if model.jnt_type[j] != _FREE:
            data.qpos[model.jnt_qposadr[j]] = 0.0
    mujoco.mj_kinematics(model, data)
    root = ElementTree.Element("robot", name=spec.modelname or Path(path).stem)
    writer = _Writer(model, data, files, notes, root)
    writer.write()
    read = parse_urdf(ElementTree.tostring(root, encoding="unicode"), path, repair)
    robot = replace(
        read.robot,
        source=f"MJCF {Path(path).name}",
        postures=tuple(_postures(mujoco, model, read.robot, notes)),
        text="",
    )
    robot = with_model_springs(model, robot, writer.note)
    robot = with_loops(mujoco, model, robot, writer.place_in(read.robot), writer.note)
    own = tuple(f"{note}: {', '.join(names)}" for note, names in notes.items())
    return UrdfRobot(Robot.from_text(robot_toml(robot), path), (*own, *read.remarks))


def _meshes(spec: Any, folder: Path, notes: dict[str, list[str]]) -> dict[str, str]:
    """Paths of meshes by name; those whose files are absent leave the model, with their geoms."""
    files, absent = dict[str, str](), set[str]()
    for mesh in list(spec.meshes):
        if not mesh.file:
            continue
        name = mesh.name or Path(mesh.file).stem
        path = find_mesh(str(Path(spec.compiler.meshdir, mesh.file)), folder)
        if path is None:
            absent.add(name)
            notes.setdefault("mesh files not found, so neither seen nor measured", []).append(mesh.file)
            spec.delete(mesh)
        else:
            mesh.file = files[name] = str(path)
    for geom in list(spec.geoms):
        if geom.meshname in absent:
            spec.delete(geom)
    for texture in spec.textures:  # they are not read, but must be there
        texture.file, texture.builtin, texture.width, texture.height = "", _FLAT, 6, 6
    return files


def _check(model: Any, path: str) -> None:
    """Ball joints, and several bodies that float, have no place in a table."""
    faults = []
    for j in range(model.njnt):
        if model.jnt_type[j] == _BALL:
            fix = "Write three hinges about x, y and z instead"
            faults.append(Fault(f"<joint> {model.joint(j).name!r}", "type", "is a ball", fix))
    free = [model.body(model.jnt_bodyid[j]).name for j in range(model.njnt) if model.jnt_type[j] == _FREE]
    if len(free) > 1:
        faults.append(Fault("file", "freejoint", f"several bodies float: {free}", "Leave only the robot in"))
    if faults:
        raise TableError(path, faults)


class _Writer:
    """Writes the bodies of a model at rest as URDF."""

    def __init__(
        self, model: Any, data: Any, files: Mapping[str, str], notes: dict[str, list[str]], root: Any
    ) -> None:
        self._model, self._data, self._files, self._notes, self._root = model, data, files, notes, root
        self._places: dict[str, Array] = {}
        self._mimic = dict(self._couplings())

    def write(self) -> None:
        """All bodies, parents first; of a floating robot without what stands on the ground."""
        model = self._model
        free = [b for b in range(1, model.nbody) if model.body_dofnum[b] and self._joints(b)[0][1] == _FREE]
        if not free:
            self._link("world", np.eye(4), 0)
        for b in range(1, model.nbody):
            top = model.body_rootid[b]
            if free and top != free[0]:
                self.note("on the ground beside the robot, left out", self._name(b))
                continue
            self._body(b, floating=b in free)
        for count, what in ((model.ntendon, "tendons"), (model.nflex, "flexible bodies")):
            if count:
                self.note("left out", what)

    def place_in(self, robot: Robot) -> Callable[[int], tuple[str, Pose] | None]:
        """Where a body is in the robot that was read: its link, or the floor, and its zero pose."""

        def place(b: int) -> tuple[str, Pose] | None:
            if not b:
                return (FLOOR if robot.base == "floating" else robot.base_link), IDENTITY
            try:
                return robot.frame(self._name(b))
            except UnknownNameError:
                return None

        return place

    def note(self, text: str, name: str) -> None:
        """Remark on something by its name."""
        self._notes.setdefault(text, []).append(name)

    def _name(self, b: int) -> str:
        return str(self._model.body(b).name or f"body_{b}") if b else "world"

    def _joints(self, b: int) -> list[tuple[int, int]]:
        first = self._model.body_jntadr[b]
        return [(j, int(self._model.jnt_type[j])) for j in range(first, first + self._model.body_jntnum[b])]

    def _body(self, b: int, floating: bool) -> None:
        T = _matrix(self._data.xpos[b], self._data.xmat[b].reshape(3, 3))
        name, parent = self._name(b), self._name(self._model.body_parentid[b])
        joints = [j for j, kind in self._joints(b) if kind != _FREE]
        if floating:
            self._link(name, T, b)
            return
        if not joints:
            self._link(name, T, b)
            self._joint(f"{name}_fixed", "fixed", parent, name)
            return
        for j in joints:
            last = j == joints[-1]
            child = name if last else f"{name}_{self._joint_name(j)}"
            place = T.copy()
            place[:3, 3] = self._data.xanchor[j]
            self._link(child, place, b if last else 0)
            self._moving(j, parent, child)
            parent = child

    def _joint_name(self, j: int) -> str:
        return str(self._model.joint(j).name or f"joint_{j}")

    def _link(self, name: str, place: Array, b: int) -> None:
        """A link in its place, with the mass and the geoms of a body, or with nothing."""
        self._places[name] = place
        element = ElementTree.SubElement(self._root, "link", name=name)
        model = self._model
        if not b:
            return
        T = np.linalg.inv(place) @ _matrix(self._data.xpos[b], self._data.xmat[b].reshape(3, 3))
        if model.body_mass[b] > 0:
            inertial = ElementTree.SubElement(element, "inertial")
            _origin(inertial, T @ _matrix(model.body_ipos[b], _rotation(model.body_iquat[b])))
            ElementTree.SubElement(inertial, "mass", value=repr(float(model.body_mass[b])))
            moments = dict(zip(("ixx", "iyy", "izz"), map(repr, model.body_inertia[b].tolist()), strict=True))
            ElementTree.SubElement(inertial, "inertia", moments)
        for g in range(model.body_geomadr[b], model.body_geomadr[b] + model.body_geomnum[b]):
            self._geom(element, T, g)

    def _geom(self, link: Any, T_link_body: Array, g: int) -> None:
        model = self._model
        kind = _GEOMS.get(int(model.geom_type[g]))
        T = T_link_body @ _matrix(model.geom_pos[g], _rotation(model.geom_quat[g]))
        if kind is None:
            self.note("shapes left out, of an unknown kind or without an extent", f"geom {g}")
            return
        size = model.geom_size[g].tolist()
        given = {
            "sphere": {"radius": size[0]},
            "capsule": {"radius": size[0], "length": 2 * size[1]},
            "cylinder": {"radius": size[0], "length": 2 * size[1]},
        }.get(kind, {})
        words = {key: repr(value) for key, value in given.items()}
        if kind == "box":
            words = {"size": _words(2 * model.geom_size[g])}
        elif kind == "mesh":
            mesh = int(model.geom_dataid[g])
            file = self._files.get(model.mesh(mesh).name)
            if file is None:
                self.note("meshes that stand in the file itself, left out", model.mesh(mesh).name)
                return
            T = T @ np.linalg.inv(_matrix(model.mesh_pos[mesh], _rotation(model.mesh_quat[mesh])))
            words = {"filename": file, "scale": _words(model.mesh_scale[mesh])}
        seen = model.geom_contype[g] == 0 and model.geom_conaffinity[g] == 0
        element = ElementTree.SubElement(link, "visual" if seen else "collision")
        _origin(element, T)
        ElementTree.SubElement(ElementTree.SubElement(element, "geometry"), kind, words)
        m = int(model.geom_matid[g])
        rgba = model.geom_rgba[g] if m < 0 else model.mat_rgba[m]
        material = ElementTree.SubElement(element, "material", name=f"geom_{g}")
        ElementTree.SubElement(material, "color", rgba=_words(rgba))

    def _joint(self, name: str, kind: str, parent: str, child: str) -> Any:
        element = ElementTree.SubElement(self._root, "joint", name=name, type=kind)
        _origin(element, np.linalg.inv(self._places[parent]) @ self._places[child])
        ElementTree.SubElement(element, "parent", link=parent)
        ElementTree.SubElement(element, "child", link=child)
        return element

    def _moving(self, j: int, parent: str, child: str) -> None:
        model, name = self._model, self._joint_name(j)
        limited = bool(model.jnt_limited[j])
        turns = model.jnt_type[j] == _HINGE
        kind = "prismatic" if not turns else "revolute" if limited else "continuous"
        element = self._joint(name, kind, parent, child)
        axis = self._places[child][:3, :3].T @ self._data.xaxis[j]
        ElementTree.SubElement(element, "axis", xyz=_words(axis))
        lower, upper = model.jnt_range[j].tolist() if limited else (-1e9, 1e9)
        limits = {"lower": lower, "upper": upper, "effort": self._effort(j), "velocity": 1e9}
        ElementTree.SubElement(element, "limit", {key: repr(float(x)) for key, x in limits.items()})
        if j in self._mimic:
            leader, ratio, offset = self._mimic[j]
            coupling = {"joint": leader, "multiplier": repr(ratio), "offset": repr(offset)}
            ElementTree.SubElement(element, "mimic", coupling)

    def _effort(self, j: int) -> float:
        """The greatest torque or force that the joint, else its motor, allows."""
        model = self._model
        if model.jnt_actfrclimited[j]:
            return float(np.abs(model.jnt_actfrcrange[j]).max())
        motors = [
            float(np.abs(model.actuator_forcerange[a]).max() * abs(model.actuator_gear[a][0]))
            for a in range(model.nu)
            if model.actuator_trntype[a] == 0
            and model.actuator_trnid[a][0] == j
            and model.actuator_forcelimited[a]
        ]
        return max(motors, default=1e9) or 1e9

    def _couplings(self) -> Iterator[tuple[int, tuple[str, float, float]]]:
        """Joints that follow others linearly; loops are closures, every other equality is a remark."""
        model = self._model
        for e in range(model.neq):
            name = model.equality(e).name or f"equality {e}"
            one, two = int(model.eq_obj1id[e]), int(model.eq_obj2id[e])
            c = model.eq_data[e][:5]
            if is_loop(model, e):
                continue
            if not model.eq_active0[e]:
                self.note("not active, left out", name)
                continue
            if model.eq_type[e] != _JOINT_EQUALITY or two < 0 or np.abs(c[2:]).max() > _MOTIONLESS:
                self.note("left out, add a [[closure]] or mimic for it", name)
                continue
            refs = [float(model.qpos0[model.jnt_qposadr[j]]) for j in (one, two)]
            yield one, (self._joint_name(two), float(c[1]), refs[0] + float(c[0]) - float(c[1]) * refs[1])


def _postures(mujoco: Any, model: Any, robot: Robot, notes: dict[str, list[str]]) -> Iterator[Posture]:
    """Keyframes within the limits, the base as high as they say."""
    at = {model.joint(j).name or f"joint_{j}": int(model.jnt_qposadr[j]) for j in range(model.njnt)}
    data = mujoco.MjData(model)
    for k in range(model.nkey):
        qpos, name = model.key_qpos[k], model.key(k).name or f"key_{k}"
        if not all(joint.name in at for joint in robot.joints):
            notes.setdefault("keyframes left out, for joints were renamed", []).append(name)
            continue
        q = tuple(float(qpos[at[joint.name]]) for joint in robot.joints)
        if all(joint.lower <= x <= joint.upper for joint, x in zip(robot.joints, q, strict=True)):
            data.qpos[:] = qpos
            mujoco.mj_kinematics(model, data)
            yield Posture(name, _height(model, data, robot), q)
        else:
            notes.setdefault("keyframes beyond limits, left out", []).append(name)


def _height(model: Any, data: Any, robot: Robot) -> float:
    """Of a floating base over the ground: of the place that its last joint turns about."""
    if robot.base == "fixed":
        return 0.0
    body = base_body(model, robot)
    return float(data.xanchor[model.body_jntadr[body] + model.body_jntnum[body] - 1][2])


def _matrix(p: Array, R: Array) -> Array:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, p
    return T


def _rotation(quat_wxyz: Array) -> Array:
    w, x, y, z = quat_wxyz / np.linalg.norm(quat_wxyz)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _origin(element: Any, T: Array) -> None:
    rpy = rpy_of(pose_from_array(T).R)
    ElementTree.SubElement(element, "origin", xyz=_words(T[:3, 3]), rpy=_words(rpy))


def _words(numbers: Any) -> str:
    return " ".join(repr(float(number)) for number in numbers)
