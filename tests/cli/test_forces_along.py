"""``screwkin forces TRAJ``: the largest forces, files, the simulator beside, and what is refused."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest

import screwkin as sk

WEIGHT = 16.677


def test_the_feet_of_a_walk_carry_the_ground_wrench(cli, walked, tmp_path):
    told = cli("forces", walked / "trajectory.npz", "--no-plots", "-o", tmp_path / "f", "--json").data
    assert WEIGHT < told["max_contact_force"] < 1.3 * WEIGHT
    assert 0.5 < told["max_effort"] < 1.5
    assert told["efforts"][told["max_effort_joint"]] == told["max_effort"]
    assert told["contact_forces"][told["max_contact_force_foot"]] == told["max_contact_force"]
    assert 0 < told["friction_needed"] < 0.5
    assert (told["engine"], told["simulated"]) == (None, None)
    assert [path.name for path in (tmp_path / "f").iterdir()] == ["forces.npz"]
    walk = sk.load_trajectory(walked / "trajectory.npz")
    with np.load(tmp_path / "f" / "forces.npz") as found:
        assert np.abs(found["efforts"]).max() == told["max_effort"]
        state = sk.State(walk.T_world_base, walk.q)
        motion = (walk.qd, walk.qdd, walk.base_twist, walk.base_acceleration)
        needed = sk.ground_wrench(sk.load_robot("bioloid"), state, *motion)
        np.testing.assert_allclose(found["wrenches"].sum(axis=1)[:, 3:], needed[:, 3:], atol=1e-9)


def test_pictures_stand_beside_the_simulator_that_validated_the_walk(cli, walked, tmp_path):
    """The engine of validation.json plays again; away from steps its feet agree with the plan."""
    shutil.copy(walked / "trajectory.npz", tmp_path)
    path = tmp_path / "trajectory.npz"
    verdict = tmp_path / "validation.json"
    assert cli("validate", path, "--engine", "kinematic", "--no-plots").code == 3
    validated = {**json.loads(verdict.read_text()), "engine": "pybullet+mujoco"}
    verdict.write_text(json.dumps(validated))
    called = cli("forces", path, "-o", tmp_path / "f")
    assert called.code == 0
    assert "largest effort in mujoco" in called.out
    names = {file.name for file in (tmp_path / "f").iterdir()}
    assert names == {"forces.npz", "foot_forces.png", "pressure.png", "efforts.png", "efforts_arms.png"}
    walk = sk.load_trajectory(path)
    with np.load(tmp_path / "f" / "forces.npz") as found:
        time = found["simulated_time"]
        inside = (time > 0.05) & (time < walk.time[-1] - 0.05)
        alone = np.interp(time, walk.time, walk.contact.sum(axis=1)) == 1
        calm = inside & alone & np.roll(alone, 40) & np.roll(alone, -40)  # away from steps
        assert calm.sum() > 100
        for k in range(2):
            planned = np.interp(time, walk.time, found["wrenches"][:, k, 5])
            seen = found["simulated_force"][:, k, 2]
            np.testing.assert_allclose(seen[calm], planned[calm], atol=0.03 * WEIGHT)
    verdict.write_text(json.dumps({**validated, "trajectory_sha256": "0" * 64}))
    assert cli("forces", path, "--no-plots", "-o", tmp_path / "g", "--json").data["engine"] is None


def test_a_floor_too_smooth_for_the_walk_has_no_forces(cli, walked, refused, tmp_path):
    path = walked / "trajectory.npz"
    message = refused(cli("forces", path, "--friction", "0.01", "-o", tmp_path / "f"), 3)
    assert "no forces within friction at right_foot, left_foot" in message
    assert not (tmp_path / "f").exists()
    free = cli("forces", path, "--pull", "--no-plots", "-o", tmp_path / "f", "--json").data
    assert free["max_contact_force"] > WEIGHT


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--load", "right_knee=1"), "--load: for robots, and .* is a trajectory"),
        (("--friction", "-1"), "--friction -1 is no coefficient"),
        (("--friction", "0.5", "--pull"), "--pull is without friction"),
        (("--engine", "kinematic"), "--engine kinematic measures no forces"),
        (("--engine", "mujocco"), "unknown engine 'mujocco'"),
    ],
)
def test_options_that_do_not_fit_are_refused(cli, walked, refused, words, message):
    import re

    assert re.search(message, refused(cli("forces", walked / "trajectory.npz", *words), 2))


def test_a_robot_writes_no_files(cli, refused):
    assert "--output: for a trajectory.npz" in refused(cli("forces", "bioloid", "-o", "x"), 2)
