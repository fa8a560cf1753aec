"""Footholds of different heights and floors that slope: swings clear edges, all contacts count."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linprog

import screwkin as sk
from screwkin.analysis.consistency import motion_faults
from screwkin.cli import run
from screwkin.dynamics.margin import support_margin
from screwkin.dynamics.on_floor import soles_on_floor
from screwkin.dynamics.support import sole_corners
from screwkin.dynamics.terrain import Terrain
from screwkin.errors import GaitError, NoSolutionError, TrajectoryError
from screwkin.gait.files import parse_gait
from screwkin.gait.ground import ground_of
from screwkin.gait.listed import load_footsteps, with_footsteps
from screwkin.gait.write import gait_toml
from screwkin.sim.mujoco import MuJoCoBackend
from screwkin.sim.pybullet import PyBulletBackend
from screwkin.sim.run import Schedule, simulate

ROBOT = sk.load_robot("bioloid")
GAIT = sk.load_gait("auto").replace(bend=0.88)
DEEP = sk.load_gait("auto").replace(bend=0.7, period=8, lift=0.02, roll=0.02)
"""Knees bent so far that a foot stays flat on the tread behind."""
SOLE = 0.104
TREAD = SOLE + 0.0085


def stairs(heights: list[float], tread: float = TREAD) -> list[tuple[float, float, float, float]]:
    """Both feet on every tread, the last one twice as deep."""
    rows = [*enumerate(heights, 1), (len(heights) + 1, heights[-1])]
    return [(k * tread, side * 0.042165, 0.0, z) for k, z in rows for side in (-1, 1)]


@cache
def walked(*heights: float) -> sk.Trajectory:
    return sk.walk(ROBOT, DEEP, sk.footsteps(stairs(list(heights))))


@cache
def sloping(uphill: float, upleft: float) -> sk.Trajectory:
    return sk.walk(ROBOT, GAIT.replace(uphill=f"{uphill}*deg", upleft=f"{upleft}*deg"), 3)


@given(st.integers(0, 2**32 - 1))
def test_the_zmp_is_inside_exactly_where_pushing_forces_parallel_to_the_ground_s_hold_the_robot(
    seed: int,
) -> None:
    """Against a linear program over forces at the corners, which stand at any heights."""
    rng = np.random.default_rng(seed)
    T = np.tile(np.eye(4), (2, 1, 1))
    T[:, :3, 3] = rng.uniform(-0.1, 0.1, (2, 3))
    poses = {"right_foot": T[:1], "left_foot": T[1:]}
    corners = np.concatenate([T[i, :3, 3] + sole_corners(ROBOT, foot) for i, foot in enumerate(poses)])
    f = np.array([*rng.uniform(-3, 3, 2), 10.0])
    point = np.array([*rng.uniform(-0.15, 0.15, 2), 0.0])
    wrench = np.concatenate([np.cross(point, f), f])
    soles = soles_on_floor(ROBOT, tuple(poses), poses, Terrain(ground=-1.0), wrench[None])
    margin = support_margin(point[None, :2], soles, np.ones((1, 2), dtype=bool))[0]
    if abs(margin) < 1e-9:
        return
    u, v = np.cross(f, [0, 1, 0]), np.cross(f, [1, 0, 0])  # moments about f itself are free
    moments = np.cross(corners - point, f).T
    balance = np.vstack([np.ones(len(corners)), u @ moments, v @ moments])
    assert (margin > 0) == (linprog(np.zeros(8), A_eq=balance, b_eq=[1, 0, 0]).status == 0)


@pytest.mark.parametrize("heights", [(0.015,), (-0.015, 0.0)])
def test_soles_clear_every_edge_and_stand_flat_on_their_blocks(heights: tuple[float, ...]) -> None:
    walk = walked(*heights)
    terrain = ground_of(walk)
    for i, foot in enumerate(walk.feet):
        T = walk.T_world_tip[foot]
        corners = np.einsum("tij,kj->tki", T[:, :3, :3], sole_corners(ROBOT, foot)) + T[:, None, :3, 3]
        above = terrain.above_ground(corners)
        assert above.min() > -1e-9
        assert np.abs(above[walk.contact[:, i]]).max() < 1e-9
    assert walk.T_world_tip["left_foot"][-1, 2, 3] == heights[-1]
    rise = walk.T_world_base[-1, 2, 3] - walk.T_world_base[0, 2, 3]
    assert rise == pytest.approx(heights[-1], abs=1e-9)
    assert walk.margin.min() > 0.015
    assert motion_faults(ROBOT, walk) == ()  # rates and accelerations are those of the positions
    assert "this walk supposes that the floor has" in walk.meta["notes"][0]


def test_nothing_changes_where_the_whole_world_is_higher() -> None:
    """The margin of a walk does not depend on where z = 0 lies."""
    walk = walked(0.015)
    up = np.zeros((4, 4))
    up[2, 3] = 0.3
    raised = {name: T + up for name, T in walk.T_world_tip.items()}
    balance = sk.zmp(ROBOT, walk)
    f = balance.wrench[:, 3:]
    point = balance.zmp + 0.3 * -f[:, :2] / f[:, 2:]
    soles = soles_on_floor(ROBOT, walk.feet, raised, ground_of(walk), balance.wrench)
    np.testing.assert_allclose(support_margin(point, soles, walk.contact), walk.margin, atol=1e-12)


@pytest.mark.parametrize(("uphill", "upleft"), [(3.0, 0.0), (2.0, -2.0)])
def test_on_a_slope_soles_are_parallel_to_it_and_the_com_stays_above_the_feet(
    uphill: float, upleft: float
) -> None:
    walk = sloping(uphill, upleft)
    assert walk.margin.min() > 0.015
    R = Terrain(*np.radians([uphill, upleft])).R
    for foot in walk.feet:
        normals = walk.T_world_tip[foot][:, :3, 2]
        np.testing.assert_allclose(normals, np.tile(R[:, 2], (walk.samples, 1)), atol=1e-12)
    feet = np.mean([walk.T_world_tip[foot][0, :3, 3] for foot in walk.feet], axis=0)
    np.testing.assert_allclose(walk.com[0, :2], feet[:2], atol=1e-4)  # above, not along the normal
    assert motion_faults(ROBOT, walk) == ()
    assert ground_of(walk) == Terrain(*np.radians([uphill, upleft]))


def test_a_level_floor_leaves_no_trace() -> None:
    level = sloping(0.0, 0.0)
    plain = sk.walk(ROBOT, GAIT, 3)
    assert "terrain" not in plain.meta
    assert not {"uphill", "upleft"} & set(plain.meta["gait"]["gait"])
    for name in ("q", "qd", "qdd", "zmp", "margin"):
        np.testing.assert_array_equal(getattr(level, name), getattr(plain, name))


def test_edges_that_a_foot_would_meet_are_named_by_step() -> None:
    edge = r"meets the edge of the block .* in step 1: footholds of different"
    with pytest.raises(NoSolutionError, match=edge):
        sk.walk(ROBOT, DEEP, sk.footsteps(stairs([0.015], tread=0.09)))
    with pytest.raises(NoSolutionError, match=r"right_leg.* in step [12], onto x 0.1125"):
        sk.walk(ROBOT, DEEP, sk.footsteps(stairs([0.15])))


def test_slopes_that_no_gait_can_walk_are_refused() -> None:
    with pytest.raises(GaitError, match="A floor slopes by 45 deg at most"):
        GAIT.replace(uphill="60*deg")
    with pytest.raises(
        GaitError, match="key uphill: key points alone lead the waist of a gait of kind 'geometric'"
    ):
        sk.load_gait("walk").replace(uphill=0.05)


def test_a_recorded_terrain_that_is_none_is_refused() -> None:
    walk = walked(0.015)
    spoilt = replace(walk, meta={**walk.meta, "terrain": 3})
    with pytest.raises(TrajectoryError, match="a terrain is an object"):
        sk.zmp(ROBOT, spoilt)


def test_heights_are_written_and_read_back(tmp_path: Path) -> None:
    steps = sk.footsteps(stairs([0.015]))
    gait = with_footsteps(GAIT.replace(uphill=0.01), steps)
    again = parse_gait(gait_toml(gait))
    assert (again.places, again.uphill) == (steps.places, 0.01)
    file = tmp_path / "steps.csv"
    file.write_text("x,y,yaw,z\n" + "\n".join(",".join(map(repr, row)) for row in stairs([0.015])))
    assert load_footsteps(file) == steps


@pytest.mark.parametrize("backend", [PyBulletBackend, MuJoCoBackend])
def test_in_both_engines_a_robot_stands_on_a_block_and_on_the_plane_of_a_slope(backend: type) -> None:
    steps = sk.footsteps([(TREAD, -0.042165, 0.0, 0.01)])
    walk = sk.walk(ROBOT, DEEP.replace(uphill="2*deg", lead=0), steps)
    names = ("time", "q", "qd", "qdd", "T_world_base", "base_twist", "base_acceleration")
    names += ("contact", "com", "zmp", "margin")
    tips = {name: T[-2:] for name, T in walk.T_world_tip.items()}
    still = replace(walk, T_world_tip=tips, **{name: getattr(walk, name)[-2:] for name in names})
    world = backend(ROBOT, terrain=ground_of(walk))
    try:
        seen = simulate(ROBOT, still, world, Schedule(settle=0.2, hold=0.1))
    finally:
        world.close()
    weight = ROBOT.mass * 9.81
    force = seen.foot_force[-100:].mean(axis=0)
    np.testing.assert_allclose(force.sum(axis=0), [0, 0, weight], atol=0.02 * weight)
    assert force[:, 2].min() > 0.1 * weight  # either foot stands
    moved = np.abs(seen.T_world_base[-1] - still.T_world_base[0]).max()
    assert moved < 1e-3
    assert seen.fallen_at is None
    assert not seen.touched


@pytest.mark.slow
@pytest.mark.parametrize("heights", [(0.015, 0.03, 0.045), (-0.015, -0.03, -0.045)])
def test_three_stairs_of_15_mm_are_walked_in_both_engines_with_the_tables_servos(
    heights: tuple[float, ...],
) -> None:
    walk = sk.walk(ROBOT, DEEP.replace(period=10), sk.footsteps(stairs(list(heights))))
    check = sk.validate(ROBOT, walk, engine="auto", servo="table")
    assert check.passed, check.reasons


@pytest.mark.slow
@pytest.mark.parametrize(("uphill", "upleft"), [(3.0, 0.0), (-3.0, 0.0), (0.0, 3.0)])
def test_slopes_of_3_degrees_are_walked_in_both_engines_with_the_tables_servos(
    uphill: float, upleft: float
) -> None:
    gait = GAIT.replace(period=6, uphill=f"{uphill}*deg", upleft=f"{upleft}*deg")
    check = sk.validate(ROBOT, sk.walk(ROBOT, gait, 6), engine="auto", servo="table")
    assert check.passed, check.reasons


def test_the_command_line_walks_stairs_and_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "stairs.csv"
    file.write_text("x,y,yaw,z\n" + "\n".join(",".join(map(repr, row)) for row in stairs([0.015])[:2]))
    words = ["walk", "bioloid", "--gait", "auto", "--set", "bend=0.57", "--set", "uphill=1*deg"]
    assert run([*words, "--footsteps", str(file), "--json", "--no-plots", "-o", str(tmp_path / "out")]) == 0
    shown = json.loads(capsys.readouterr().out)
    supposed = "this walk supposes that the floor rises by 1 deg ahead, has 2 blocks"
    assert any(supposed in warning for warning in shown["warnings"])
