"""Limbs of four and five joints: closed forms by a tip that is free to turn, and poses met but for that."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import screwkin as sk
from screwkin.algebra.se3 import as_array, unstack
from screwkin.errors import InputError, UnknownNameError
from screwkin.ik.all_branches import branch_solutions
from screwkin.ik.closed import closed_form
from screwkin.ik.implicit import limb_in_jax
from screwkin.ik.methods import solve_limb
from screwkin.ik.numeric import IkSettings
from screwkin.ik.programs import limb_branches
from screwkin.kinematics.serial_chain import SerialChain, forward, residual
from screwkin.kinematics.status import Status
from screwkin.mechanism.followers import followers
from screwkin.model.robot import Robot
from screwkin.model.table import parse_robot
from tests.bodies import LEG, humanoid
from tests.ik.legs import Leg, apart, offset_leg, random_tip, spherical_leg, unit

REGULAR = 1e-3
"""Inverse condition number below which branches nearly fall together."""
LEGS = {"no yaw": LEG[1:], "no ankle roll": LEG[:-1], "neither": LEG[1:-1]}


@cache
def robot_of(name: str) -> Robot:
    return parse_robot(humanoid(LEGS[name], arm=(), ahead=0.03))


def drawn(robot: Robot, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions of the right leg within its limits, and the poses of its tip in the base frame."""
    chain = SerialChain.of(robot, "right_leg")
    own = np.random.default_rng(1).uniform(chain.lower, chain.upper, (count, len(chain.joints)))
    q = np.tile(sk.home(robot).q, (count, 1))
    q[:, list(chain.joints)] = own
    return own, sk.frame_pose(robot, sk.State(np.eye(4), q), "right_foot")


@pytest.mark.parametrize("name", LEGS)
def test_every_pose_of_a_leg_s_own_is_solved_with_the_branch_that_made_it(name: str) -> None:
    robot = robot_of(name)
    own, T = drawn(robot, 300)
    solutions = sk.limb_ik(robot, "right_leg", T)
    assert solutions.method == "closed"
    assert (solutions.status == Status.CONVERGED).all()
    assert solutions.residual[solutions.valid].max() < 1e-12
    assert np.nanmin(apart(solutions.q, own[:, None]), axis=1).max() < 1e-7
    pose = sk.solve_pose(robot, {"base": np.eye(4), "right_foot": T})
    assert pose.ok
    np.testing.assert_allclose(pose.state.q[:, : own.shape[1]], solutions.best, atol=1e-9)


def random_leg(seed: int, kind: str) -> SerialChain:
    """Axes in general position but for what the kind says; five joints."""
    rng = np.random.default_rng(seed)
    axes, points = unit(rng, 5), rng.normal(size=(5, 3))
    middle = slice(2, 5) if kind == "yaw, roll, three pitches" else slice(1, 4)
    axes[middle] = axes[middle][0] * rng.choice([-1.0, 1.0], size=(3, 1))
    leg = offset_leg()
    return type(leg)(axes, points, random_tip(rng)).chain()


@pytest.mark.parametrize("kind", ["yaw, roll, three pitches", "roll, three pitches, roll"])
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_three_parallel_axes_and_two_others_have_a_closed_form(kind: str, seed: int) -> None:
    chain = random_leg(seed, kind)
    q = np.random.default_rng(seed).uniform(-np.pi, np.pi, (100, 5))
    T = as_array(forward(chain.screws, unstack(q), chain.tip)[0], (100,))
    solved = solve_limb(chain, T, "auto", np.zeros((100, 5)), IkSettings(), (100,))
    assert solved.method == "closed"
    assert np.nanmin(apart(solved.q, q[:, None]), axis=1).max() < 1e-6
    assert solved.residual[solved.valid].max() < 1e-11


def rounded_leg(seed: int, size: float) -> SerialChain:
    """Roll, yaw and three pitches, as a table that was rounded holds them: axes turned and moved a little."""
    rng = np.random.default_rng(seed)
    axes = np.array([[-1, 0, 0], [0, 0, -1], [0, 1, 0], [0, -1, 0], [0, 1, 0]], dtype=float)
    axes *= rng.choice([-1.0, 1.0], size=(5, 1))
    y, thigh, shank = rng.uniform((0.03, 0.1, 0.1), (0.1, 0.4, 0.4))
    points = np.array([[0, 0, 0], [0, y, -0.1 * thigh], [0, y, -0.1 * thigh], [0, y, -thigh], [0, y, -thigh]])
    points[4:, 2] -= shank
    tip = np.eye(4)
    tip[:3, 3] = points[4] - [0, 0, 0.04]
    axes += size * rng.normal(size=(5, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return Leg(axes, points + 0.2 * size * rng.normal(size=(5, 3)), tip).chain()


def general_leg(seed: int) -> SerialChain:
    rng = np.random.default_rng(seed)
    return Leg(unit(rng, 5), 0.3 * rng.normal(size=(5, 3)), random_tip(rng)).chain()


def assert_own_poses_are_solved(chain: SerialChain, seed: int, free: tuple[str, ...], count: int) -> None:
    """Poses of a limb's own within limits as legs have: all are solved, with the branch that made them."""
    low, high = np.array([-0.6, -1.3, -1.8, -2.3, -0.8]), np.array([0.6, 1.3, 1.8, 2.3, 0.8])
    chain = replace(chain, lower=low, upper=high)
    q = np.random.default_rng([seed, 1]).uniform(low, high, (count, 5))
    T = as_array(forward(chain.screws, unstack(q), chain.tip)[0], (count,))
    longer = chain.freed(free, range(5, 5 + len(free)))
    start = np.zeros((count, 5 + len(free)))
    solved = solve_limb(longer, T, "auto", start, IkSettings(), (count,))
    assert solved.method == "branches"
    sizes = np.linalg.svd(residual(longer, np.c_[q, start[:, 5:]], T)[1], compute_uv=False)
    regular = sizes[:, -1] > REGULAR * sizes[:, 0]
    assert regular.mean() > 0.95
    assert solved.in_limits.any(axis=1)[regular].all()
    assert solved.residual[solved.valid].max() < 1e-9
    assert np.nanmin(apart(solved.q[..., :5], q[:, None]), axis=1)[regular].max() < 1e-5


@pytest.mark.parametrize("free", [(), ("rx",)], ids=["pose", "lean free"])
@pytest.mark.parametrize("size", [4e-6, 1e-7])
@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in range(1, 20))])
def test_rounded_legs_of_five_joints_find_their_own_poses(
    seed: int, size: float, free: tuple[str, ...]
) -> None:
    """Where the tip's free axis lies in the plane of the hip's, roots of the relative fall together."""
    assert_own_poses_are_solved(rounded_leg(seed, size), seed, free, 400)


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in range(1, 20))])
def test_legs_of_five_joints_of_any_geometry_find_their_own_poses(seed: int) -> None:
    assert_own_poses_are_solved(general_leg(seed), seed, (), 400)


@pytest.mark.parametrize("seed", range(3))
def test_a_program_alone_solves_legs_that_lie_in_one_plane(seed: int) -> None:
    """About axes through the tip two branches would share the hip's angles, and rounding decide."""
    chain = rounded_leg(seed, 0.0)
    q = np.random.default_rng(seed).uniform(-1.0, 1.0, (200, 5))
    T = as_array(forward(chain.screws, unstack(q), chain.tip)[0], (200,))
    found, _, kind, certified = limb_branches(chain, False)((T, np.zeros(5)))
    assert (certified[:, 0] > 0.5).mean() > 0.9
    own = ((apart(found, q[:, None]) < 1e-9) & (kind > 0.5)).any(axis=1)
    assert own[certified[:, 0] > 0.5].all()


def test_rounded_legs_are_solved_where_their_yaw_turns_four_axes_parallel() -> None:
    """The nearest closed form is singular there, of six joints and the limb's own, about any one axis."""
    rng, solved = np.random.default_rng(3), []
    for seed in range(3):
        chain = rounded_leg(seed, 4e-6)
        q = rng.uniform(-1.2, 1.2, (200, 5))
        q[:, 1] = np.pi / 2 + 10 ** rng.uniform(-5, -2, 200)
        T = as_array(forward(chain.screws, unstack(q), chain.tip)[0], (200,))
        found = branch_solutions(chain, T, np.zeros((200, 5)), (0.0, 0.0), (200,))
        assert found.residual[found.valid].max() < 1e-12
        solved.append(found.valid.any(axis=1).mean())
    assert np.mean(solved) > 0.93, solved


def test_no_poses_have_no_solutions_and_jax_arrays_follow() -> None:
    chain = rounded_leg(3, 4e-6)
    T = as_array(forward(chain.screws, unstack(np.full((2, 5), 0.2)), chain.tip)[0], (2,))
    none = solve_limb(chain, T[:0], "auto", np.zeros((0, 5)), IkSettings(), (0,))
    assert none.method == "branches"
    assert none.q.shape[::2] == (0, 5)
    with jax.enable_x64(True):
        found = limb_in_jax(chain, jnp.asarray(T), "auto", np.zeros(5), IkSettings(), True)
    wanted = solve_limb(chain, T, "auto", np.zeros((2, 5)), IkSettings(), (2,))
    np.testing.assert_allclose(found.best, wanted.best, atol=1e-9)


@pytest.mark.parametrize("name", LEGS)
def test_a_free_rotation_follows_and_all_else_is_met(name: str) -> None:
    robot = robot_of(name)
    free = followers(robot, "right_leg")
    T = np.tile(sk.frame_pose(robot, sk.home(robot), "right_foot"), (50, 1, 1))
    T[:, :3, 3] += np.random.default_rng(2).uniform((-0.05, -0.05, 0.0), 0.05, (50, 3))
    solution = sk.solve_pose(robot, {"right_foot": T}, free={"right_foot": free})
    assert solution.ok
    assert solution.state.q.shape == (50, len(robot.joints))
    got = sk.frame_pose(robot, solution.state, "right_foot")
    np.testing.assert_allclose(got[:, :3, 3], T[:, :3, 3], atol=1e-12)
    turned = Rotation.from_matrix(got[:, :3, :3]).as_euler("ZYX" if free == ("rx",) else "YXZ")
    imposed = {("rz",): [0, 1], ("rx",): [0, 1], ("rx", "rz"): [0]}[free]
    np.testing.assert_allclose(turned[:, imposed], 0.0, atol=1e-12)
    own = sk.limb_ik(robot, "right_leg", np.linalg.inv(sk.home(robot).T_world_base) @ T, free=free)
    assert own.joint_names == SerialChain.of(robot, "right_leg").names
    np.testing.assert_allclose(own.best, solution.state.q[:, : own.q.shape[-1]], atol=1e-12)
    newton = sk.solve_pose(robot, {"right_foot": T}, method="newton", free={"right_foot": free})
    np.testing.assert_allclose(newton.state.q, solution.state.q, atol=1e-9)


def test_a_leg_of_six_joints_with_a_free_rotation_uses_it() -> None:
    robot = sk.load_robot("bioloid")
    T = sk.frame_pose(robot, sk.home(robot), "right_foot")
    T[:3, :3] = Rotation.from_euler("z", 3.0).as_matrix()
    one = sk.solve_pose(robot, {"right_foot": T}, free={"right_foot": ("rz",)})
    assert one.ok
    np.testing.assert_allclose(sk.frame_pose(robot, one.state, "right_foot")[:3, 3], T[:3, 3], atol=1e-11)


def test_wrong_names_of_free_rotations_are_refused() -> None:
    robot = robot_of("no yaw")
    T = np.eye(4)
    with pytest.raises(InputError, match="valid: rx, ry, rz"):
        sk.limb_ik(robot, "right_leg", T, free=("px",))
    with pytest.raises(UnknownNameError, match="unknown tip 'toe'"):
        sk.solve_pose(robot, {"right_foot": T}, free={"toe": ("rz",)})
    with pytest.raises(InputError, match="NumPy arrays"):
        sk.limb_ik(robot, "right_leg", jnp.eye(4), free=("rz",))


def test_a_limb_without_closed_form_says_what_its_longer_relatives_lack() -> None:
    leg = spherical_leg()
    rng = np.random.default_rng(0)
    chain = type(leg)(unit(rng, 5), rng.normal(size=(5, 3)), random_tip(rng)).chain()
    with pytest.raises(InputError, match="no closed form"):
        closed_form(chain)
