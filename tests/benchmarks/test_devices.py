"""The device benchmark: results are compared before they are timed, and batches are shared among devices."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import screwkin as sk
from benchmarks import devices
from screwkin.kinematics import body

ROOT = Path(__file__).parents[2]

SHARDED = """
import json
from dataclasses import asdict
import jax, numpy as np
import screwkin as sk
from benchmarks.devices import measured
from screwkin.kinematics import body
q = np.random.default_rng(0).uniform(-2, 2, (64, 12))
given = {"T_world_base": np.tile(np.eye(4), (64, 1, 1)), "q": q}
program = body.tip_poses.program(sk.load_robot("poppy12"))
rows = [measured(program, given, dtype, jax.devices(), 2) for dtype in ("float64", "float32")]
print(json.dumps([asdict(row) for row in rows]))
"""


def test_batches_are_shared_among_devices() -> None:
    flags = {"XLA_FLAGS": "--xla_force_host_platform_device_count=4", "JAX_PLATFORMS": "cpu"}
    told = subprocess.run(
        [sys.executable, "-c", SHARDED],
        cwd=ROOT,
        env=os.environ | flags,
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    rows = json.loads(told.splitlines()[-1])
    assert [(row["devices"], row["samples"], row["agreement"]) for row in rows] == [(4, 64, 1.0)] * 2
    assert all(row["alone"][1] <= row["alone"][0] for row in rows)
    found = {"device": "cpu", "count": 4, "jax": "1", "host": {"processor": "x", "cores": 4}, "rows": rows}
    table = devices.markdown(found)
    assert table.count("| `poppy12_tip_poses` |") == 2


def test_wrong_results_are_not_timed(monkeypatch: pytest.MonkeyPatch) -> None:
    import jax

    program = body.tip_poses.program(sk.load_robot("poppy12"))
    given = {"T_world_base": np.tile(np.eye(4), (8, 1, 1)), "q": np.zeros((8, 12))}
    honest = devices.run
    monkeypatch.setattr(
        devices, "run", lambda *told, **options: {k: x + 1e-6 for k, x in honest(*told, **options).items()}
    )
    with pytest.raises(AssertionError, match=r"0\.00% of the samples agree"):
        devices.measured(program, given, "float64", jax.devices()[:1], 1)


def test_every_kernel_gets_inputs_that_it_can_answer() -> None:
    robot = sk.load_robot("bioloid")
    told = {program.name: (program, given) for program, given in devices.inputs(robot, 40)}
    legs = {f"{side}_leg_pose_pose" for side in ("left", "right")}
    arms = {f"{side}_arm_pose_position" for side in ("left", "right")}
    assert set(told) == {"bioloid_rates", "bioloid_balance", "bioloid_right_leg_nearest"} | legs | arms
    for program, given in told.values():
        assert {group.name for group in program.inputs} == set(given)
        for name, x in devices.run(program, given, path="numpy").items():
            assert len(x) == 40
            assert np.isfinite(x).all(), name
    for name in legs | arms:
        reached = devices.run(*told[name], path="numpy")
        certified = reached["certified"][:, 0] > 0
        assert certified.mean() > 0.9
        assert reached["error"][certified].max() < 1e-12
