"""Forces of feet and joints against the contact forces of both engines, on two feet and on one."""

from __future__ import annotations

import numpy as np
import pytest

import screwkin as sk
from screwkin.sim.backend import Command


@pytest.fixture(scope="module")
def robot():
    return sk.load_robot("bioloid")


@pytest.fixture(params=["mujoco", "pybullet"])
def engine(request, robot):
    library = pytest.importorskip(request.param)
    assert library
    if request.param == "mujoco":
        from screwkin.sim.mujoco import MuJoCoBackend as Backend
    else:
        from screwkin.sim.pybullet import PyBulletBackend as Backend
    backend = Backend(robot)
    yield backend
    backend.close()


def settled(robot, backend, state, seconds=1.0):
    """What is seen after standing a while, and the wrench on every foot about its tip."""
    backend.reset(state)
    for _ in range(round(seconds / backend.dt)):
        backend.step(Command(state.q, np.zeros(len(state.q)), state.T_world_base))
    seen = backend.observe()
    links = [limb.link for limb in robot.limbs if limb.kind == "leg"]
    wrenches = np.zeros((len(links), 6))
    for contact in seen.contacts:
        k, force = links.index(contact.link), np.array(contact.force)
        arm = np.array(contact.point) - seen.T_world_foot[k, :3, 3]
        wrenches[k] += np.r_[np.cross(arm, force), force]
    return seen, wrenches


def test_the_other_foot_and_all_servos_follow_from_one_foots_wrench(robot, engine):
    """Six internal freedoms: the engine's wrench on the right foot is imposed, the rest is computed."""
    seen, theirs = settled(robot, engine, sk.home(robot))
    state, rest = sk.State(seen.T_world_base, seen.q), np.zeros(18)
    total = sk.ground_wrench(robot, state, rest, rest)
    p, other = seen.T_world_foot[:, :3, 3], total.copy()
    other -= np.r_[theirs[0, :3] + np.cross(p[0], theirs[0, 3:]), theirs[0, 3:]]
    other[:3] -= np.cross(p[1], other[3:])
    wish = {"right_foot": theirs[0], "left_foot": other}
    forces = sk.contact_forces(robot, state, rest, rest, internal=wish)
    assert forces.wrenches[:, 5].sum() == pytest.approx(16.677, abs=1e-9)
    np.testing.assert_allclose(forces.wrenches, theirs, atol=1e-3 * 8.34)
    np.testing.assert_allclose(forces.efforts, seen.torque, atol=2e-3)


def test_on_one_foot_wrench_and_torques_are_the_engines(robot, engine):
    walk = sk.walk(robot, sk.load_gait("walk"), steps=2)
    right = walk.feet.index("right_foot")
    alone = walk.contact[:, right] & (walk.contact.sum(axis=1) == 1)
    ankle = walk.T_world_tip["right_foot"][:, :2, 3]
    k = int(np.argmin(np.where(alone, np.linalg.norm(walk.com[:, :2] - ankle, axis=1), np.inf)))
    seen, theirs = settled(robot, engine, sk.State(walk.T_world_base[k], walk.q[k]), 0.3)
    assert not theirs[1 - right].any()
    state, rest = sk.State(seen.T_world_base, seen.q), np.zeros(18)
    forces = sk.contact_forces(robot, state, rest, rest, ["right_foot"])
    np.testing.assert_allclose(forces["right_foot"], theirs[right], atol=1e-3 * 16.7)
    np.testing.assert_allclose(forces.efforts, seen.torque, atol=5e-3)
