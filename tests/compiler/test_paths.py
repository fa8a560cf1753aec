"""Every path of every kernel against the public formulas, for bundled robots and for random ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.compiler import native
from screwkin.compiler.emit_python import source
from screwkin.compiler.graph import FUNCTIONS
from screwkin.compiler.program import Recorder
from screwkin.compiler.run import chosen_path, python_function, run
from screwkin.compiler.series import TURNS
from screwkin.dynamics.quantities import balance
from screwkin.ik.closed import recognised
from screwkin.kinematics import body
from screwkin.kinematics.mass import GRAVITY
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.mechanism.tip_motion import follows, motion_program
from tests.kinematics.machines import random_state, random_tree

PATHS = ["python", "numpy", *(["C"] if native.compiler() else [])]
ROBOTS = ("bioloid", "bioloid24", "poppy12")


def moving(robot, count=40, seed=0):
    """States near home, somewhere in the world, with motions of base and tips."""
    rng = np.random.default_rng(seed)
    home = sk.home(robot)
    turned = random_state(robot, seed, (count,)).T_world_base
    state = sk.State(turned, home.q + 0.3 * rng.uniform(-1, 1, (count, len(home.q))))
    return state, rng


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("name", ROBOTS)
def test_rates_and_tips_are_those_of_davies_method(name, path):
    robot = sk.load_robot(name)
    state, rng = moving(robot)
    upright = sk.State(
        sk.home(robot).T_world_base, state.q
    )  # Euler rates of the waist are singular at 90 deg
    program, mechanism = motion_program(robot), sk.closed_mechanism(robot)
    inputs = {g.name: rng.uniform(-1, 1, (len(state.q), *g.shape)) for g in program.inputs}
    inputs |= {"T_world_base": upright.T_world_base, "q": upright.q}
    found = run(program, inputs, path=path)
    wanted = {tip: inputs[f"twist_{tip}"] for tip in robot.tip_names}
    primary = sk.virtual_motion(mechanism, upright, inputs["base_twist"], wanted)
    rates = sk.secondary_rates(mechanism, upright, primary)
    real = [mechanism.secondary.index(joint) for joint in robot.joint_names]
    np.testing.assert_allclose(found["qd"], rates[:, real], rtol=1e-11, atol=1e-11)
    for k, tip in enumerate(robot.tip_names):
        expected = sk.frame_pose(robot, upright, tip)
        np.testing.assert_allclose(found["T_world_tip"][:, k], expected, atol=1e-14)


@pytest.mark.parametrize("name", ROBOTS)
def test_accelerations_are_the_slopes_of_the_rates(name):
    """Base and tips move with constant rates of change; the kernel's accelerations against differences."""
    robot = sk.load_robot(name)
    program, rates = motion_program(robot, True), motion_program(robot)
    state, rng = moving(robot, 8)
    inputs = {g.name: rng.uniform(-0.05, 0.05, (8, *g.shape)) for g in program.inputs}
    inputs |= {"T_world_base": state.T_world_base, "q": state.q}
    found = run(program, inputs, path="numpy")

    def qd_at(h):
        """Rates a moment later: everything moved on, twists changed by their derivatives."""
        later = dict(inputs)
        omega, v = np.split(inputs["base_twist"] + 0.5 * h * inputs["base_acceleration"], 2, axis=1)
        from scipy.spatial.transform import Rotation

        T = inputs["T_world_base"].copy()
        T[:, :3, :3] = Rotation.from_rotvec(h * omega).as_matrix() @ T[:, :3, :3]
        T[:, :3, 3] += h * v
        later["T_world_base"] = T
        later["q"] = inputs["q"] + h * found["qd"] + 0.5 * h * h * found["qdd"]
        tips = [(f"twist_{tip}", f"acceleration_{tip}") for tip in robot.tip_names]
        for name, rate in [("base_twist", "base_acceleration"), *tips]:
            later[name] = inputs[name] + h * inputs[rate]
        return run(rates, {g.name: later[g.name] for g in rates.inputs}, path="numpy")["qd"]

    h = 1e-4
    slope = (qd_at(h) - qd_at(-h)) / (2 * h)
    np.testing.assert_allclose(found["qdd"], slope, rtol=1e-6, atol=1e-6 * np.abs(slope).max())


@pytest.mark.parametrize("path", PATHS)
def test_centre_of_mass_momentum_and_zmp_are_those_of_the_formulas(path):
    robot = sk.load_robot("poppy12")
    state, rng = moving(robot)
    program = balance.program(robot)
    inputs = {g.name: rng.uniform(-1, 1, (len(state.q), *g.shape)) for g in program.inputs}
    inputs |= {"T_world_base": state.T_world_base, "q": state.q}
    found = run(program, inputs, path=path)
    moved = [inputs[k] for k in ("qd", "base_twist")]
    np.testing.assert_allclose(found["com"], sk.center_of_mass(robot, state), atol=1e-13)
    np.testing.assert_allclose(found["momentum"], sk.momentum(robot, state, *moved), atol=1e-12)
    force = sk.inverse_dynamics(
        robot, state, inputs["qd"], inputs["qdd"], inputs["base_twist"], inputs["base_acceleration"]
    )[:, :6]
    shift = np.cross(state.T_world_base[:, :3, 3], force[:, 3:])
    np.testing.assert_allclose(found["wrench"][:, 3:], force[:, 3:], atol=1e-12)
    np.testing.assert_allclose(found["wrench"][:, :3], force[:, :3] + shift, atol=1e-11)
    m, f = found["wrench"][:, :3], found["wrench"][:, 3:]
    zmp = np.stack([-m[:, 1], m[:, 0]], axis=1) / f[:, 2:]
    np.testing.assert_allclose(found["zmp"], zmp, rtol=1e-9)
    assert GRAVITY == 9.81


@pytest.mark.parametrize(
    ("seed", "path"),
    [
        pytest.param(seed, path, marks=pytest.mark.slow if path == "C" and seed > 1 else ())
        for seed in range(6)
        for path in PATHS
    ],
)
def test_random_trees_of_turning_sliding_and_helical_joints(seed, path):
    robot = random_tree(seed)
    state = random_state(robot, seed, (20,))
    for quantity in (body.link_poses, body.center_of_mass):
        found = run(quantity.program(robot), vars(state), path=path)[quantity.__name__]
        expected = quantity.definition.by_formula(
            robot, ("T_world_base", "q"), (), list(vars(state).values())
        )
        np.testing.assert_allclose(found, expected, atol=1e-13)


@pytest.mark.parametrize("name", ROBOTS)
def test_compact_jacobians_are_columns_of_the_public_one(name):
    robot = sk.load_robot(name)
    q = moving(robot)[0].q
    state = sk.State(np.eye(4), q)
    for limb in robot.limbs:
        found = run(body.limb_jacobian.program(robot, limb.name), {"q": q}, path="numpy")["limb_jacobian"]
        columns = [6 + i for i in robot.path_to(limb.link)]
        np.testing.assert_allclose(found, sk.jacobian(robot, state, limb.tip)[..., columns], atol=1e-14)


@pytest.mark.parametrize("name", ROBOTS)
def test_large_batches_give_what_small_ones_give(name):
    """Public functions change their path with what is asked, not their answer."""
    robot = replace(sk.load_robot(name))
    state, _ = moving(robot, 8 * 1000)
    few = sk.State(state.T_world_base[:400], state.q[:400])
    qd, twist = np.linspace(-2, 3, len(robot.joints)), np.linspace(-1, 1, 6)
    for ask in (
        lambda s: sk.momentum(robot, s, qd),
        lambda s: sk.momentum(robot, s, qd, twist),
        lambda s: sk.link_poses(robot, s),
        lambda s: sk.frame_pose(robot, s, robot.tip_names[0]),
        lambda s: sk.center_of_mass(robot, s),
    ):
        small = ask(few)
        np.testing.assert_allclose(ask(state)[:400], small, atol=1e-14)


def test_inputs_broadcast_and_an_empty_batch_is_no_fault():
    robot = sk.load_robot("poppy12")
    q = np.zeros((3, 1, 12))
    T = np.broadcast_to(np.eye(4), (5, 4, 4))
    found = run(body.tip_poses.program(robot), {"T_world_base": T, "q": q})["tip_poses"]
    assert found.shape == (3, 5, 2, 4, 4)
    none = run(body.tip_poses.program(robot), {"T_world_base": np.eye(4), "q": np.zeros((0, 12))})
    assert none["tip_poses"].shape == (0, 2, 4, 4)


def test_generated_python_is_a_module_that_stands_alone():
    robot = sk.load_robot("poppy12")
    program = body.tip_poses.program(robot)
    home = sk.home(robot)
    told = python_function(program)(home.T_world_base.ravel().tolist(), home.q.tolist())
    expected = sk.frame_pose(robot, home, "left_foot")
    np.testing.assert_allclose(np.reshape(told[0], (2, 4, 4))[0], expected, atol=1e-14)
    assert "screwkin" not in source(program).split("\n", 1)[1], "the code itself imports math only"


@pytest.mark.parametrize("count", [1, 3, 4, 5, 8, 19])
@pytest.mark.parametrize("path", PATHS)
def test_arrays_may_bear_any_name_and_batches_any_size(path, count):
    """Names that C has a meaning for, results that are conditions, numbers or inputs."""
    recorder = Recorder("odd", "Odd names.")
    (a,), (b,) = recorder.input("samples", 1), recorder.input("int", 1)
    recorder.input("unread", 2)
    recorder.output("v0", [a + b, FUNCTIONS.where((a < b) | (b <= 0.0), a, FUNCTIONS.sqrt(b))])
    recorder.output("first", [a < b, 3.0, b])
    x, y = np.random.default_rng(count).uniform(-1, 1, (2, count, 1))
    found = run(recorder.program(), {"samples": x, "int": y, "unread": np.zeros(2)}, path=path)
    least = np.where((x < y) | (y <= 0), x, np.sqrt(np.abs(y)))
    np.testing.assert_allclose(found["v0"], np.hstack([x + y, least]), rtol=1e-15)
    np.testing.assert_array_equal(found["first"], np.hstack([x < y, np.full_like(x, 3), y]))


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("far", [1.0, 7.0, 1e3, TURNS])
def test_sines_and_angles_of_points_are_exact_to_rounding(path, far):
    recorder = Recorder("angles", "Sines of an angle, and the angle of their point.")
    (x,) = recorder.input("x", 1)
    s, c = FUNCTIONS.sin(x), FUNCTIONS.cos(x)
    recorder.output("told", [s, c, FUNCTIONS.atan2(s, c)])
    quarters = np.pi / 2 * np.arange(-6, 7) * max(1.0, np.floor(far / 10))
    angles = np.concatenate([np.random.default_rng(0).uniform(-far, far, 2000), quarters])
    found = run(recorder.program(), {"x": angles[:, None]}, path=path)["told"]
    np.testing.assert_allclose(found[:, 0], np.sin(angles), rtol=0, atol=7e-16)
    np.testing.assert_allclose(found[:, 1], np.cos(angles), rtol=0, atol=7e-16)
    expected = np.arctan2(found[:, 0], found[:, 1])
    np.testing.assert_allclose(found[:, 2], expected, rtol=0, atol=1e-15)


@pytest.mark.parametrize("path", PATHS)
def test_what_has_no_value_is_infinite_or_no_number_on_every_path(path):
    recorder = Recorder("beyond", "A reciprocal, a root, angles.")
    (x,) = recorder.input("x", 1)
    recorder.output("told", [1.0 / x, FUNCTIONS.sqrt(x), FUNCTIONS.atan2(1.0, x), FUNCTIONS.atan2(x, 1.0)])
    found = run(recorder.program(), {"x": np.array([[0.0], [-1.0], [np.nan]])}, path=path)["told"]
    eighth = np.pi / 4
    wanted = [[np.inf, 0.0, 2 * eighth, 0.0], [-1.0, np.nan, 3 * eighth, -eighth], 4 * [np.nan]]
    np.testing.assert_allclose(found, wanted, rtol=1e-15)


def test_without_a_compiler_samples_are_computed_by_python_and_numpy(monkeypatch):
    monkeypatch.setattr(native, "compiler", lambda: None)
    program = body.center_of_mass.program(random_tree(99))
    assert chosen_path(program, 1) == "python"
    assert chosen_path(program, 10**6) == "numpy"
    assert native.compiled(program) is None


def test_six_and_three_joint_limbs_alone_are_followed():
    bioloid = sk.load_robot("bioloid")
    mechanism = sk.closed_mechanism(bioloid)
    assert follows(bioloid, mechanism.secondary)
    assert not follows(bioloid, mechanism.secondary[1:])
    assert not follows(random_tree(1), random_tree(1).joint_names)
    arm = SerialChain.of(bioloid, "left_hand")
    assert recognised(arm, position=True)
    assert not recognised(arm)
