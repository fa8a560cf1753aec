"""What PyBullet is asked in a step, and what is made of it."""

from collections import Counter
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import screwkin as sk
from screwkin.model.state import State
from screwkin.motors.library import motors_of
from screwkin.sim.backend import Command
from screwkin.sim.motors import MotorServos
from screwkin.sim.pybullet import PyBulletBackend
from screwkin.sim.pybullet_look import Look, rotations_of_quats

ROBOT = sk.load_robot("bioloid")


class Counted:
    """The module of the engine, with the calls of its functions counted."""

    def __init__(self, p: Any) -> None:
        self._module, self.calls = p, Counter[str]()

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._module, name)
        if not callable(value):
            return value
        self.calls[name] += 1
        return value


@given(st.integers(0, 2**32 - 1))
def test_rotations_are_those_of_quaternions(seed: int) -> None:
    quats = np.random.default_rng(seed).normal(size=(7, 4))
    quats /= np.linalg.norm(quats, axis=1, keepdims=True)
    np.testing.assert_allclose(rotations_of_quats(quats), Rotation.from_quat(quats).as_matrix(), atol=1e-14)


@pytest.fixture(scope="module")
def standing() -> PyBulletBackend:
    pytest.importorskip("pybullet")
    backend = PyBulletBackend(ROBOT, servos=MotorServos(motors_of(ROBOT), 1e-3, "table"))
    home = sk.home(ROBOT)
    backend.reset(State(np.array(home.T_world_base), np.array(home.q)))
    return backend


def stand(backend: PyBulletBackend, count: int) -> None:
    home = sk.home(ROBOT)
    q = np.array(home.q)
    for _ in range(count):
        backend.step(Command(q, 0 * q, np.array(home.T_world_base)))
        backend.observe()


def test_each_question_is_asked_once_in_a_step(
    standing: PyBulletBackend, monkeypatch: pytest.MonkeyPatch
) -> None:
    stand(standing, 20)
    counted = Counted(standing._p)
    monkeypatch.setattr(standing, "_p", counted)
    monkeypatch.setattr(standing, "_look", standing._looked())
    stand(standing, 50)
    asked = {name: n for name, n in counted.calls.items() if name.startswith("get") and "Matrix" not in name}
    assert len(asked) == 5, asked
    assert max(asked.values()) <= 51
    assert counted.calls["setJointMotorControlArray"] <= 100


def test_the_mass_matrix_that_rotors_answer_to_is_the_robots(standing: PyBulletBackend) -> None:
    """PyBullet's own, of joints alone, at another posture than home: the balls are in both."""
    p, here, body, joints = standing._p, standing._here, standing._body, standing._tree
    q = np.random.default_rng(3).uniform(-0.4, 0.4, len(joints))
    for joint, angle in zip(joints, q.tolist(), strict=True):
        p.resetJointState(body, joint, angle, 0.0, **here)
    look = Look(p, here, body, joints)
    rotors = standing._rotors
    assert rotors is not None
    com, turned = look.com - look.com[0], rotations_of_quats(look.turned)
    own = rotors._inertia(com, turned, rotors._twists(com[1:], turned[1:]))
    theirs = np.array(p.calculateMassMatrix(body, q.tolist(), **here))
    np.testing.assert_allclose(own[6:, 6:], theirs[6:, 6:], atol=1e-7)
