"""What a robot feels of a simulation: an observation as it is, then each error of its senses by itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import screwkin as sk
from screwkin.algebra.se3 import X, Z, as_array, rotate
from screwkin.errors import InputError
from screwkin.kinematics.limits import limited_joints, limits_of
from screwkin.model.robot import Robot
from screwkin.sim.backend import Contact, Observation
from screwkin.sim.feedback import Loop, Senses, WalkController
from screwkin.sim.kinematic import KinematicBackend
from screwkin.sim.perturbation import NONE, Perturbation
from screwkin.sim.perturbation_files import perturbation_from_texts
from screwkin.sim.run import simulate
from screwkin.stabiliser.walk import Felt, stabilised

FEET = ("right_foot", "left_foot")
PERIOD = 0.01


@pytest.fixture(scope="module")
def robot() -> Robot:
    return sk.load_robot("bioloid")


def standing(robot: Robot, turn: float = 0.0, contacts: tuple[Contact, ...] = ()) -> Observation:
    """Turned about the vertical, feet where the legs at home have them."""
    q = np.array(sk.home(robot).q)
    base = np.eye(4)
    base[:3, :3] = as_array(rotate(Z, turn))
    feet = np.array([sk.frame_pose(robot, sk.State(base, q), tip) for tip in FEET])
    still = np.zeros(len(q))
    return Observation(0.0, base, q, still, still, feet, np.zeros((2, 6)), contacts)


@given(turn=st.floats(-3.0, 3.0), part=st.floats(0.0, 1.0), at=st.floats(-0.02, 0.02))
def test_feet_feel_how_hard_and_where_the_floor_presses(turn: float, part: float, at: float) -> None:
    """Two forces along the floor's normal under a foot: their sum, and the point that divides them."""
    robot = sk.load_robot("bioloid")
    seen = standing(robot, turn)
    link = robot.limb("left_foot").link
    points = [seen.T_world_foot[1] @ [x, 0.01, 0.0, 1.0] for x in (at, at + 0.01)]
    forces = (4.0 * part, 4.0 - 4.0 * part)
    contacts = tuple(
        Contact(link, tuple(p[:3].tolist()), (0.3, 0.0, f)) for p, f in zip(points, forces, strict=True)
    )
    felt = Senses(robot, NONE, FEET).feel(replace(seen, contacts=contacts), PERIOD)
    assert felt.force == pytest.approx([0.0, 4.0])
    assert felt.pressure[1] == pytest.approx([at + 0.01 * (1.0 - part), 0.01], abs=1e-9)
    np.testing.assert_allclose(felt.attitude, as_array(rotate(Z, turn)), atol=1e-12)
    assert (felt.q == seen.q).all()


def test_feet_without_cells_feel_nothing_of_the_floor(robot: Robot) -> None:
    contacts = (Contact(robot.limb("left_foot").link, (0.0, 0.0, 0.0), (0.0, 0.0, 5.0)),)
    felt = Senses(robot, Perturbation(cells=0), FEET).feel(standing(robot, contacts=contacts), PERIOD)
    assert (felt.force == 1.0).all()
    assert (felt.pressure == 0.0).all()
    assert perturbation_from_texts(["cells=0"]) == Perturbation(cells=0)
    with pytest.raises(InputError, match="whole numbers from 0 to 1"):
        Perturbation(cells=2)


def test_a_heading_drifts_and_gravity_does_not(robot: Robot) -> None:
    """A rate's bias about the vertical turns the heading as time passes; a lean stays what it is."""
    senses = Senses(robot, Perturbation(imu_rate_bias=(0.3, 0.2, 0.1)), FEET)
    seen = standing(robot)
    leaning = replace(
        seen, T_world_base=np.block([[as_array(rotate(X, 0.2)), np.zeros((3, 1))], [0, 0, 0, 1]])
    )
    felt = [senses.feel(leaning, PERIOD).attitude for _ in range(50)]
    np.testing.assert_allclose(felt[-1], as_array(rotate(Z, 0.1 * 49 * PERIOD) @ rotate(X, 0.2)), atol=1e-12)


def test_a_heading_wanders_by_the_noise_of_its_rate(robot: Robot) -> None:
    """After n cycles by the noise times the root of n of them, about no direction; nothing leans."""
    seen, n, far = standing(robot), 50, []
    for seed in range(60):
        senses = Senses(robot, Perturbation(imu_rate_noise=0.2, seed=seed), FEET)
        attitude = [senses.feel(seen, PERIOD).attitude for _ in range(n + 1)][-1]
        far.append(np.arctan2(attitude[1, 0], attitude[0, 0]))
        assert attitude[2, 2] == pytest.approx(1.0, abs=1e-12)
    deviation = 0.2 * PERIOD * np.sqrt(n)
    assert np.std(far) == pytest.approx(deviation, rel=0.3)
    assert abs(np.mean(far)) < 4.0 * deviation / np.sqrt(60)


def test_noise_has_its_deviation_a_bias_stays_and_a_late_sense_is_of_before(robot: Robot) -> None:
    seen = standing(robot)
    noisy = Senses(robot, Perturbation(imu_noise=0.01, imu_bias=(0.05, 0.0, 0.0), seed=4), FEET)
    about = np.array([noisy.feel(seen, PERIOD).attitude for _ in range(400)])
    roll = np.arctan2(about[:, 2, 1], about[:, 2, 2])
    assert roll.mean() == pytest.approx(0.05, abs=4 * 0.01 / 20)
    assert roll.std() == pytest.approx(0.01, rel=0.2)
    late = Senses(robot, Perturbation(sense_lag=0.02), FEET)
    felt = [late.feel(replace(seen, q=seen.q + k), PERIOD).q[0] - seen.q[0] for k in range(6)]
    assert felt == [0.0, 0.0, 0.0, 1.0, 2.0, 3.0]


def test_whatever_is_felt_commands_keep_to_limits_and_speeds(robot: Robot) -> None:
    """Thrown about: no joint beyond its limits, none faster than its servo; it says how far it came."""
    gait = sk.load_gait("preview").replace(Tc=0.4, stride=0.08, lift=0.012, lead=0.6, horizon=1.0)
    walk = stabilised(robot, sk.walk(robot, gait, steps=2))
    controller, rng = WalkController(walk), np.random.default_rng(3)
    (low, high), speeds = limits_of(robot), np.array([joint.velocity for joint in limited_joints(robot)])
    sent = [controller.reset()]
    assert not any(controller.settings["deviation"].values())
    for k in range(400):
        turn = as_array(rotate(X, 0.6 * np.sin(0.3 * k)) @ rotate(Z, rng.normal()))
        felt = Felt(turn, rng.normal(size=18), rng.uniform(0, 20, 2), rng.normal(size=(2, 2)))
        sent.append(controller.answer(felt))
    q = np.array(sent)
    assert (q >= low).all()
    assert (q <= high).all()
    rates = np.abs(np.diff(q, axis=0)) / controller.period
    assert (rates <= speeds * (1 + 1e-9)).all()
    assert rates.max() == pytest.approx(speeds.max())  # it was at its limit
    assert max(controller.settings["deviation"].values()) > 0.1


def test_feet_that_a_controller_has_in_the_air_are_off_the_floor_and_no_others(robot: Robot) -> None:
    """Where joints follow exactly: a foot is lifted or moved on only while it is said not to stand."""
    gait = sk.load_gait("preview").replace(Tc=0.4, stride=0.08, lift=0.012, lead=0.6, horizon=1.0)
    plan = sk.walk(robot, gait, steps=3)
    walk = stabilised(robot, plan)
    loop = Loop(WalkController(walk, feedback=False), Senses(robot, NONE, walk.body.tips))
    run = simulate(robot, plan, KinematicBackend(robot, dt=0.005), loop=loop)
    assert run.contact is not None
    q_before = np.vstack([run.q[:1], run.q[:-1]])
    states = [sk.State(np.tile(np.eye(4), (len(q), 1, 1)), q) for q in (q_before, run.q)]
    for i, tip in enumerate(FEET):
        swings, other = ~run.contact[:, i], FEET[1 - i]
        assert not (swings & ~run.contact[:, 1 - i]).any()
        a, b = (
            np.linalg.inv(sk.frame_pose(robot, state, other)) @ sk.frame_pose(robot, state, tip)
            for state in states
        )
        moves = np.abs(a - b).max(axis=(1, 2)) > 2e-4
        both = run.contact.all(axis=1)
        assert moves[swings].mean() > 0.9
        assert not (moves & both).any()
    assert len(np.flatnonzero(np.diff((~run.contact.all(axis=1)).astype(int)) == 1)) == 3
