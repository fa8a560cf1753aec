"""Pinocchio by its Python interface: one call per sample, and its own parallel batch calls."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.contest import Contestant, Contestants, Result
from benchmarks.workloads import Dynamic, Motion, Reach
from screwkin.algebra.se3 import as_array
from screwkin.analysis.ik_others import pinocchio_model
from screwkin.model.robot import Robot
from screwkin.model.urdf import urdf_frames, urdf_from_robot

Array = Any
NAME = "Pinocchio, Python"
TOLERANCE, DAMPING, MOST = 1e-8, 1e-6, 100


class Body:
    """A robot as Pinocchio reads it from URDF, and where its joints and tips are."""

    def __init__(self, robot: Robot) -> None:
        import pinocchio as pin

        self.pin = pin
        self.model = pin.buildModelFromXML(urdf_from_robot(robot), pin.JointModelFreeFlyer())
        self.model.gravity.linear = np.array([0.0, 0.0, -9.81])
        self.data = self.model.createData()
        joints = [self.model.joints[self.model.getJointId(name)] for name in robot.joint_names]
        self.q = [joint.idx_q for joint in joints]
        self.v = [joint.idx_v for joint in joints]
        frames = urdf_frames(robot)
        self.tips = []
        for limb in robot.limbs:
            place = as_array(frames[limb.link].inverse @ limb.frame).astype(float)
            last = self.model.getJointId(robot.joints[robot.joint_above[limb.link]].name)
            columns = as_slice([self.v[i] for i in robot.path_to(limb.link)])
            self.tips.append((limb, last, pin.SE3(place), columns))

    def configuration(self, T: Array, q: Array) -> Array:
        """(B, nq)."""
        out = np.empty((len(q), self.model.nq))
        out[:, :3], out[:, 3:7] = T[:, :3, 3], Rotation.from_matrix(T[:, :3, :3]).as_quat()
        out[:, self.q] = q
        return out

    def velocity(self, T: Array, twist: Array, qd: Array) -> Array:
        """(B, nv): [v; omega] in base axes, joint rates."""
        out, back = np.empty((len(qd), self.model.nv)), T[:, :3, :3].swapaxes(1, 2)
        out[:, :3], out[:, 3:6] = (back @ twist[:, 3:, None])[..., 0], (back @ twist[:, :3, None])[..., 0]
        out[:, self.v] = qd
        return out

    def acceleration(self, T: Array, twist: Array, change: Array, qdd: Array) -> Array:
        """(B, nv): derivatives of the velocity's components in turning axes."""
        seen = change.copy()
        seen[:, 3:] -= np.cross(twist[:, :3], twist[:, 3:])
        return self.velocity(T, seen, qdd)


def as_slice(columns: list[int]) -> slice | list[int]:
    """Neighbouring columns as a slice, which NumPy takes without copying."""
    first, last = columns[0], columns[-1] + 1
    return slice(first, last) if columns == list(range(first, last)) else columns


def skew(w: Array) -> Array:
    """Matrices (B, 3, 3) W with W p = w x p."""
    out = np.zeros((len(w), 3, 3))
    out[:, 2, 1], out[:, 0, 2], out[:, 1, 0] = w.T
    return out - out.swapaxes(1, 2)


def seen_from_base(given: Motion) -> tuple[dict[str, Array], dict[str, Array], dict[str, Array]]:
    """By tip: v of the base's motion at the world origin taken from the tip's, the spins that carry p, omega.

    With them the tip's velocity beside the base's is v - W p, wherever its point p will be.
    """
    spin = given.waist[:, :3]
    at_origin = given.waist[:, 3:] - np.cross(spin, given.T_world_base[:, :3, 3])
    v, W, omega = {}, {}, {}
    for name, wanted in given.tips.items():
        v[name], W[name] = wanted[:, -3:] - at_origin, skew(spin)
        if wanted.shape[1] == 6:
            omega[name] = wanted[:, :3] - spin
    return v, W, omega


def rates(robot: Robot, given: Motion) -> Contestants:
    """W1: computeJointJacobians, then one small solve per limb."""
    body = Body(robot)
    pin, model, data = body.pin, body.model, body.data
    q = body.configuration(given.T_world_base, given.q)
    v, W, omega = seen_from_base(given)
    W |= {name: W[name] + skew(turning) for name, turning in omega.items()}  # told at the world origin

    def run() -> Result:
        poses, out = np.empty((len(q), len(body.tips), 4, 4)), np.empty((len(q), model.nv))
        right = np.empty(6)
        for k in range(len(q)):
            J = pin.computeJointJacobians(model, data, q[k])
            for i, (limb, last, place, columns) in enumerate(body.tips):
                name, tip = limb.tip, data.oMi[last] * place
                poses[k, i] = tip.homogeneous
                p, A = tip.translation, J[:, columns]
                if name in omega:
                    right[:3], right[3:] = v[name][k] - W[name][k] @ p, omega[name][k]
                    out[k, columns] = np.linalg.solve(A, right)
                else:
                    at_tip = A[:3] - pin.skew(p) @ A[3:]
                    out[k, columns] = np.linalg.solve(at_tip, v[name][k] - W[name][k] @ p)
        return {"poses": poses, "rates": out[:, body.v]}

    return {NAME: Contestant(run)}


def reach(robot: Robot, given: Reach) -> Contestants:
    """W2: damped least squares as in Pinocchio's example, with full steps."""
    import pinocchio as pin

    chain = given.chain
    model = pinocchio_model(pin, chain)
    data, last = model.createData(), model.njoints - 1
    home = as_array(chain.tip).astype(float)
    reach_ = pin.SE3(home[:3, :3], home[:3, 3] - as_array(chain.screws[-1].s0).astype(float))
    wanted = [pin.SE3(T) * reach_.inverse() for T in given.target]

    def run() -> Result:
        found, solved = np.empty((len(wanted), model.nq)), np.zeros(len(wanted), dtype=bool)
        q = given.guess
        for k, target in enumerate(wanted):
            q = q.copy() if given.follows else given.guess.copy()
            for _ in range(MOST + 1):
                pin.forwardKinematics(model, data, q)
                gap = data.oMi[last].actInv(target)
                error = pin.log6(gap).vector
                if np.linalg.norm(error) <= TOLERANCE:
                    solved[k] = True
                    break
                J = pin.Jlog6(gap.inverse()) @ pin.computeJointJacobian(model, data, q, last)
                q = q + J.T @ np.linalg.solve(J @ J.T + DAMPING * np.eye(6), error)
            found[k] = q
        return {"q": found, "solved": solved}

    told = f"damped least squares, full steps, damping {DAMPING:g}, to {TOLERANCE:g}, at most {MOST}"
    return {NAME: Contestant(run, note=told)}


def balance(robot: Robot, given: Dynamic, threads: int = 2) -> Contestants:
    """W4: centroidal dynamics per sample; and the ZMP alone by the parallel call."""
    body = Body(robot)
    pin, model, data = body.pin, body.model, body.data
    q = body.configuration(given.T_world_base, given.q)
    v = body.velocity(given.T_world_base, given.twist, given.qd)
    a = body.acceleration(given.T_world_base, given.twist, given.acceleration, given.qdd)
    weight = np.array([0.0, 0.0, 9.81 * pin.computeTotalMass(model)])

    def run() -> Result:
        com, momentum, wrench = (np.empty((len(q), size)) for size in (3, 6, 6))
        for k in range(len(q)):
            pin.computeCentroidalMomentumTimeVariation(model, data, q[k], v[k], a[k])
            com[k] = data.com[0]
            momentum[k, :3], momentum[k, 3:] = data.hg.angular, data.hg.linear
            wrench[k, :3], wrench[k, 3:] = data.dhg.angular, data.dhg.linear
        wrench[:, 3:] += weight
        wrench[:, :3] += np.cross(com, wrench[:, 3:])
        return {"com": com, "momentum": momentum, "zmp": zmp(wrench)}

    found = {NAME: Contestant(run)}
    if hasattr(pin, "rneaInParallel") and hasattr(pin, "ModelPool"):
        pool = pin.ModelPool(model, threads)
        columns = [np.asfortranarray(x.T) for x in (q, v, a)]
        R, p = given.T_world_base[:, :3, :3], given.T_world_base[:, :3, 3]

        def parallel() -> Result:
            tau = pin.rneaInParallel(threads, pool, *columns)[:6].T
            force, moment = (R @ tau[:, :3, None])[..., 0], (R @ tau[:, 3:, None])[..., 0]
            return {"zmp": zmp(np.concatenate([moment + np.cross(p, force), force], axis=1))}

        told = f"ZMP alone, {threads} threads"
        found["Pinocchio, rneaInParallel"] = Contestant(parallel, note=told)
    return found


def zmp(wrench: Array) -> Array:
    """(B, 2) from the ground's wrench [m; f] about the world origin (B, 6)."""
    return np.stack([-wrench[:, 1], wrench[:, 0]], axis=1) / wrench[:, 5:]
