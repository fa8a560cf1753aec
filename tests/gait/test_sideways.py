"""Legs without a roll axis at the ankle do not let the waist shift over level soles: against solved poses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.anatomy.humanoid import humanoid
from screwkin.gait.fitting import OUTSIDE, _Judged, _refusal
from screwkin.gait.paces import usual_pace
from screwkin.gait.sideways import sideways
from screwkin.model.urdf_in import parse_urdf
from tests.anatomy.bodies import LEG, biped

LEGS = {
    "six": (LEG, True),
    "no ankle roll": (("hip_yaw", "hip_roll", "hip_pitch", "knee_pitch", "ankle_pitch"), False),
    "roll first": (("hip_roll", "hip_yaw", "hip_pitch", "knee_pitch", "ankle_pitch"), False),
    "no yaw": (("hip_roll", "hip_pitch", "knee_pitch", "ankle_pitch", "ankle_roll"), True),
    "neither": (("hip_roll", "hip_pitch", "knee_pitch", "ankle_pitch"), False),
}
BY = 0.01


@pytest.mark.parametrize("name", LEGS)
def test_a_waist_shifts_over_level_soles_where_a_solver_finds_the_pose(name: str) -> None:
    leg, shifts = LEGS[name]
    robot = humanoid(parse_urdf(biped(leg=leg).text()).robot)
    assert sideways(robot).shifts is shifts
    state = sk.home(robot)
    feet = {limb.tip: sk.frame_pose(robot, state, limb.tip) for limb in robot.limbs if limb.kind == "leg"}
    T = state.T_world_base.copy()
    T[1, 3] += BY
    q = _nearest(robot, T, feet, state.q)
    missed = max(
        np.abs(sk.frame_pose(robot, sk.State(T, q), tip)[:3] - at[:3]).max() for tip, at in feet.items()
    )
    assert bool(missed < 1e-9) is shifts


def _nearest(robot, T, feet, q):
    """Joint positions with the least squares of the feet's errors."""
    from scipy.optimize import least_squares

    def error(x):
        state = sk.State(T, x)
        return np.concatenate(
            [(sk.frame_pose(robot, state, tip)[:3] - at[:3]).ravel() for tip, at in feet.items()]
        )

    return least_squares(error, q, xtol=1e-15, ftol=1e-15, gtol=1e-15).x


@pytest.mark.parametrize(
    ("name", "ways"), [("six", 6), ("no ankle roll", 5), ("roll first", 5), ("neither", 4)]
)
def test_freedoms_are_those_that_the_network_matrix_leaves(name: str, ways: int) -> None:
    """Base and joints against feet that stand: 6 + n columns less the rank of the feet's Jacobians."""
    robot = humanoid(parse_urdf(biped(leg=LEGS[name][0], arm=()).text()).robot)
    state = sk.home(robot)
    rows = np.vstack([sk.jacobian(robot, state, x.tip) for x in robot.limbs if x.kind == "leg"])
    assert rows.shape[1] == 6 + len(robot.joints)
    assert sideways(robot).freedoms == ways == rows.shape[1] - np.linalg.matrix_rank(rows, tol=1e-6)


@pytest.mark.parametrize("limit", [0.1, 0.3])
def test_a_lean_up_to_the_hips_limits_moves_the_com_as_the_pose_says(limit: float) -> None:
    robot = humanoid(parse_urdf(biped(leg=LEGS["no ankle roll"][0]).text()).robot)
    rolls = [robot.path_to(x.link)[1] for x in robot.limbs if x.kind == "leg"]
    joints = (
        replace(joint, lower=-limit, upper=limit) if i in rolls else joint
        for i, joint in enumerate(robot.joints)
    )
    robot = replace(robot, joints=tuple(joints))
    found, home = sideways(robot), sk.home(robot)
    assert found.lean == pytest.approx(limit)
    feet = {x.tip: sk.frame_pose(robot, home, x.tip) for x in robot.limbs if x.kind == "leg"}
    turned = sk.State(home.T_world_base.copy(), home.q.copy())
    c, s = np.cos(limit), np.sin(limit)
    turned.T_world_base[:3, :3] = [[1, 0, 0], [0, c, -s], [0, s, c]]
    turned.q[rolls] -= limit
    for tip, at in feet.items():
        np.testing.assert_allclose(sk.frame_pose(robot, turned, tip)[:3, :3], at[:3, :3], atol=1e-9)
    away = sk.center_of_mass(robot, turned)[1] - sk.center_of_mass(robot, home)[1]
    assert found.aside == pytest.approx(abs(away), rel=1e-6)
    assert found.edge == pytest.approx(min(abs(c.y) for sole in robot.soles for c in sole.corners), abs=1e-9)


def test_the_refusal_of_a_robot_whose_zmp_leaves_the_soles_says_why_geometry_bars_it() -> None:
    robot = humanoid(parse_urdf(biped(leg=LEGS["no ankle roll"][0], arm=()).text()).robot)
    rolls = [robot.path_to(x.link)[1] for x in robot.limbs if x.kind == "leg"]
    stiff = tuple(
        replace(joint, lower=-0.02, upper=0.02) if i in rolls else joint
        for i, joint in enumerate(robot.joints)
    )
    wide = replace(robot, joints=stiff)
    found = sideways(wide)
    assert 0 < found.aside < found.edge
    assert f"{1e3 * found.aside:.1f} mm aside" in str(found)
    assert f"{1e3 * (found.edge - found.aside):.1f} mm further in" in str(found)
    six = humanoid(parse_urdf(biped(leg=LEG, arm=()).text()).robot)
    assert str(sideways(six)) == ""
    base = usual_pace(wide)
    for reason, told in ((f"{OUTSIDE} 3.0 mm out of the support polygon", True), ("axis3 is slow", False)):
        assert (str(found) in _refusal(wide, base, [_Judged(base, (reason,))])) is told
