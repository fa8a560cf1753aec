"""placo's walk of a robot: planned in placo's own environment, read back as a trajectory."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np

import screwkin as sk
from benchmarks.environments import ROOT, environment
from benchmarks.peers.placo import urdf_with_tips
from benchmarks.walking.foreign import trajectory_of
from screwkin.errors import InputError
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.model.robot import Robot

NEEDS = ("placo",)
_LOW = (
    0.97  # height of the CoM, as a share of that at home: placo holds it still, which takes room in the knees
)


def placo_walk(robot: Robot, Tc: float, stride: float, lift: float, steps: int) -> sk.Trajectory:
    """Its walk straight ahead; made once and read from then on.

    Args:
        robot: with two feet, in the order right and left, and arms.
        Tc: time of a step [s].
        stride: of two steps [m].
        lift: of a swinging foot [m].
        steps: how many.

    Raises:
        InputError: placo cannot be installed, or it has no such walk.
    """
    place = ROOT / "placo" / f"{robot.name}-{Tc:g}-{stride:g}-{lift:g}-{steps}"
    walk = place / "walk.npz"
    if not walk.exists():
        python = environment("placo", NEEDS)
        if python is None:
            raise InputError("placo cannot be installed in an environment of its own")
        place.mkdir(parents=True, exist_ok=True)
        (place / "robot.urdf").write_text(_urdf(robot))
        (place / "gait.json").write_text(json.dumps(_gait(robot, Tc, stride, lift, steps)))
        script = Path(__file__).with_name("placo_walk.py")
        files = [str(place / name) for name in ("robot.urdf", "gait.json")]
        ran = subprocess.run([str(python), str(script), *files, str(walk)], capture_output=True, text=True)
        if ran.returncode:
            raise InputError(f"placo has no walk of Tc {Tc:g}: {ran.stderr.strip().splitlines()[-1:]}")
    with np.load(walk) as data:
        T = np.array(data["T_world_base"])
        T[:, 1, 3] -= T[0, 1, 3]  # placo's origin lies below the left foot
        return trajectory_of(robot, data["time"], data["q"], T, data["contact"])


def _urdf(robot: Robot) -> str:
    """With links at the tips, and one that placo calls trunk at the base."""
    ends = f'<parent link="{robot.base_link}"/><child link="trunk"/><origin xyz="0 0 0"/>'
    trunk = f'<link name="trunk"/><joint name="to_trunk" type="fixed">{ends}</joint>'
    return urdf_with_tips(robot).replace("</robot>", trunk + "</robot>")


def _gait(robot: Robot, Tc: float, stride: float, lift: float, steps: int) -> dict[str, object]:
    """What ``placo_walk`` reads: the robot's own stance and soles."""
    home = sk.home(robot)
    legs, arms = ([limb for limb in robot.limbs if (limb.kind == "leg") is leg] for leg in (True, False))
    right, left = (np.asarray(sk.frame_pose(robot, home, leg.tip)) for leg in legs)
    sole = np.ptp([[corner.x, corner.y] for corner in robot.soles[0].corners], axis=0)
    return {
        "Tc": Tc,
        "stride": stride,
        "lift": lift,
        "steps": steps,
        "height": _LOW * float(np.asarray(sk.center_of_mass(robot, home))[2]),
        "spacing": float(left[1, 3] - right[1, 3]),
        "sole": sole.tolist(),
        "joints": dict(zip(robot.joint_names, map(float, home.q), strict=True)),
        "arms": [robot.joint_names[i] for limb in arms for i in SerialChain.of(robot, limb.tip).joints],
    }
