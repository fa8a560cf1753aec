"""The player of a page: what it stores is the motion, and its few lines of mathematics are the library's."""

import base64
import json
import re
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

import screwkin as sk
from screwkin.algebra.screws import Screw, displacement
from screwkin.algebra.se3 import Vector, as_array
from screwkin.model.shapes import box_points
from screwkin.report.player import UNIT, Packed, player_html
from screwkin.viewer.scene import displacements


def stored(data, described):
    """The array of a page, read as ``player.js`` reads it."""
    count = int(np.prod(described["shape"]))
    raw = np.frombuffer(data, np.uint8)[described["offset"] :][: 4 * count]
    steps = raw.reshape(4, count).T.copy().view("<i4").reshape(described["shape"])
    whole = np.cumsum(steps, axis=0, dtype=np.int32)
    return np.where(whole == -(2**31), np.nan, whole * described["scale"])


def inflated(text):
    return zlib.decompress(base64.b64decode(text))


@given(
    values=arrays(
        float,
        array_shapes(min_dims=1, max_dims=3, max_side=5),
        elements=st.floats(-2000, 2000) | st.just(np.nan),
    ),
    unit=st.sampled_from([1e-6, 1e-3, 1.0]),
)
def test_arrays_come_back_to_half_a_unit_and_what_is_no_number_too(values, unit):
    packed = Packed()
    packed.add(np.arange(3.0), 1.0)
    described = packed.add(values, unit)
    back = stored(inflated(packed.data), described)
    assert np.array_equal(np.isnan(back), np.isnan(values))
    assert np.nanmax(np.abs(back - values), initial=0.0) <= 0.5001 * unit + 1e-12


@pytest.fixture(scope="module")
def parts(account, check):
    """Header and data of a page with a plan and a simulation."""
    html = player_html(account, check)
    part = {
        name: re.search(rf'id="player-{name}">([^<]*)</script>', html)[1]
        for name in ("header", "data", "three")
    }
    return json.loads(part["header"]), inflated(part["data"]), part["three"]


def test_the_motion_of_a_page_is_that_of_the_trajectory(account, check, parts):
    header, data, _ = parts
    plan, simulated = header["motions"]
    trajectory = account.trajectory
    q = stored(data, plan["arrays"]["q"])
    rows = np.searchsorted(trajectory.time, stored(data, plan["arrays"]["time"]) - 1e-6)
    assert np.abs(q - trajectory.q[rows]).max() < UNIT
    assert np.abs(stored(data, plan["arrays"]["zmp"]) - account.balance.zmp[rows]).max() < UNIT
    assert np.abs(stored(data, plan["arrays"]["margin"]) - account.balance.margin[rows]).max() < UNIT
    assert rows[0] == 0
    assert rows[-1] == trajectory.samples - 1
    time = stored(data, simulated["arrays"]["time"])
    at = np.abs(check.run.time[:, None] - time).argmin(axis=0)
    assert np.abs(stored(data, simulated["arrays"]["q"]) - check.run.q[at]).max() < UNIT
    assert check.engine in simulated["name"]


def test_links_carried_as_the_page_carries_them_are_where_the_library_has_them(account, parts):
    header, data, _ = parts
    robot, arrays_of = account.robot, header["motions"][0]["arrays"]
    q, base, turn = (stored(data, arrays_of[key]) for key in ("q", "base", "turn"))
    for k in (0, len(q) // 2, len(q) - 1):
        carried = {link: np.eye(4) for link in header["robot"]["roots"]}
        for joint in header["robot"]["joints"]:
            theta = joint["ratio"] * q[k, joint["coordinate"]] + joint["offset"]
            screw = Screw(Vector(*joint["s"]), Vector(*joint["s0"]), joint["pitch"])
            assert not joint["slides"]
            D = as_array(displacement(screw, theta) @ sk_identity())
            carried[joint["child"]] = carried[joint["parent"]] @ D
        x, y, z, w = turn[k]
        T = np.eye(4)
        T[:3, :3] = rotation(x, y, z, w)
        T[:3, 3] = base[k]
        zero = sk.link_poses(robot, sk.State(np.eye(4), np.zeros(q.shape[1])))
        expected = sk.link_poses(robot, sk.State(account.trajectory.T_world_base, account.trajectory.q))
        row = np.searchsorted(account.trajectory.time, stored(data, arrays_of["time"])[k] - 1e-6)
        for link, D in carried.items():
            assert np.abs(T @ D @ zero[link] - expected[row, link]).max() < 1e-5


def sk_identity():
    from screwkin.algebra.se3 import IDENTITY

    return IDENTITY


def rotation(x, y, z, w):
    """The matrix of a unit quaternion, by its formula."""
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def test_the_library_is_inside_with_its_licence_named(parts):
    text = inflated(parts[2]).decode()
    assert text.startswith("/* three.js")
    assert "MIT" in text[:200]


def test_the_library_holds_what_the_script_uses_and_its_recipe_names_that_alone(parts):
    root = Path(__file__).resolve().parents[2]
    script = (root / "screwkin" / "report" / "player.js").read_text(encoding="utf-8")
    used = set(re.findall(r"\bTHREE\.(\w+)", script))
    recipe = (root / "docs" / "viewing.md").read_text(encoding="utf-8").split("`entry.js` exports")[1]
    named = {name for part in re.findall(r"`([^`]+)`", recipe.split(";")[0]) for name in part.split()}
    assert named - {"three", "three/addons/controls/OrbitControls.js"} == used
    exported = re.search(r"\{((?:\w+:\(\)=>[\w$]+,?){5,})\}", inflated(parts[2]).decode())[1]
    assert set(re.findall(r"(\w+):", exported)) == used


def test_a_robot_of_a_sly_name_stays_text(account, parts):
    header, _, _ = parts
    assert "</" not in json.dumps(header)
    assert header["robot"]["links"] == list(account.robot.link_names)


def test_the_camera_sees_all_of_the_robot_whatever_it_is_drawn_of(account, parts):
    """The bundled robot's boxes, and the tips, which are no corner of theirs, at every sample."""
    middle, radius = (parts[0]["robot"][key] for key in ("middle", "radius"))
    robot, plan = account.robot, account.trajectory
    carried = displacements(robot, plan.T_world_base, plan.q)
    corners = [
        (box_points(box) @ carried[:, i, :3, :3].swapaxes(1, 2) + carried[:, i, None, :3, 3])
        for i, link in enumerate(robot.links)
        for box in link.boxes
    ]
    points = np.concatenate([*corners, *(T[:, None, :3, 3] for T in plan.T_world_tip.values())], axis=1)
    points[..., :2] -= plan.T_world_base[:, None, :2, 3]
    far = np.linalg.norm(points - [0.0, 0.0, middle], axis=-1).max()
    assert far < 1.02 * radius < 1.25 * far


def test_the_camera_sees_a_robot_that_leaves_its_plan(account, check):
    """One that rises by half a metre in the simulation, as no plan has it."""
    T = check.run.T_world_base.copy()
    T[:, 2, 3] += np.linspace(0.0, 0.5, len(T))
    away = replace(check, run=replace(check.run, T_world_base=T))
    header = json.loads(re.search(r'id="player-header">([^<]*)</script>', player_html(account, away))[1])
    middle, radius = header["robot"]["middle"], header["robot"]["radius"]
    assert middle - radius <= 0.0
    assert middle + radius > T[-1, 2, 3]
