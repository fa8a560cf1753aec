"""Pictures show the robot where it is, lit from the lamp's side, with its shadow on the other."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

import screwkin as sk
from screwkin.algebra.se3 import UNTURNED, Pose, Vector, as_array
from screwkin.errors import OutputError, RobotRemark
from screwkin.model.meshes import hull_faces
from screwkin.model.records import Shape
from screwkin.model.robot import Box, Link, Robot
from screwkin.model.shapes import box_points
from screwkin.model.urdf import ORANGE, SLATE, WHITE
from screwkin.sim.camera import Camera, Picture, _milliseconds, following, save_gif, save_png, view_of
from screwkin.sim.render import pictures
from screwkin.sim.solids import solids_of
from screwkin.sim.triangles import draw_triangles

SMALL = Camera(width=160, height=120)


@pytest.fixture(scope="module")
def robot() -> Robot:
    return sk.load_robot("bioloid")


def one_picture(robot: Robot, camera: Camera = SMALL) -> Picture:
    home = sk.home(robot)
    return pictures(robot, np.zeros(1), home.T_world_base[None], home.q[None], camera)[0]


def near(picture: Picture, colour: tuple[float, ...], tolerance: float = 0.06) -> np.ndarray:
    """Pixels of a colour's hue, whatever the light."""
    pixels = picture.astype(float) / 255
    light = pixels.sum(axis=-1, keepdims=True)
    wanted = np.array(colour[:3]) / sum(colour[:3])
    return np.asarray(np.abs(pixels / np.maximum(light, 1e-9) - wanted).max(axis=-1) < tolerance)


def test_the_point_looked_at_is_in_the_middle_at_its_distance() -> None:
    pixel, depth = view_of(SMALL, np.array([1.0, 2.0, 0.3]), 0.72).project(np.array([1.0, 2.0, 0.3]))
    assert np.allclose(pixel, [80, 60], rtol=0, atol=1e-12)
    assert depth == pytest.approx(0.72)


def test_the_perspective_is_that_of_a_pinhole() -> None:
    """Field of view: a point half the angle above the axis lies on the picture's upper edge."""
    camera = replace(SMALL, yaw=0.0, pitch=0.0)
    view = view_of(camera, np.zeros(3), 2.0)
    up = 2.0 * np.tan(np.deg2rad(19.0))
    pixels, depth = view.project(np.array([[0, 0, up], [0, 0, -up], [up, 0, 0], [0, 1, 0], [0, -1, up / 2]]))
    assert np.allclose(pixels, [[80, 0], [80, 120], [140, 60], [80, 60], [80, 0]], rtol=0, atol=1e-9)
    assert np.allclose(depth, [2, 2, 2, 3, 1], rtol=0, atol=1e-12)


def test_yaw_and_pitch_place_the_eye_before_right_of_and_above_a_robot_that_faces_x() -> None:
    eye = view_of(Camera(), np.zeros(3), 1.0).eye
    c, s = np.cos(np.deg2rad(18.0)), np.sin(np.deg2rad(18.0))
    angle = np.deg2rad(40.0)
    assert np.allclose(eye, [c * np.sin(angle), -c * np.cos(angle), s], rtol=0, atol=1e-12)


def test_the_camera_follows_the_way_but_not_the_sway() -> None:
    time = np.arange(0, 20, 0.1)
    base = np.tile(np.eye(4), (200, 1, 1))
    base[:, 0, 3] = 0.1 * time
    base[:, 1, 3] = 0.04 * np.sin(2 * np.pi * time)
    base[:, 2, 3] = 0.15
    at = following(time, base)
    assert at[-1, 0] == pytest.approx(2.0 - 0.1 * 0.6, abs=0.01)
    assert np.abs(at[50:, 1]).max() < 0.02
    assert np.allclose(at[:, 2], at[0, 2])


def test_torso_thighs_and_calves_are_white_slate_and_orange(robot: Robot) -> None:
    picture = one_picture(robot)
    assert picture.shape == (120, 160, 3)
    assert picture.dtype == np.uint8
    slate, orange = near(picture, SLATE), near(picture, ORANGE)
    assert slate.sum() > 300
    assert orange.sum() > 200
    assert np.argwhere(orange).mean() > 0
    middle = picture[38, 78].astype(float)
    assert np.ptp(middle) < 8
    assert middle.max() < 255 * WHITE[0]


@pytest.mark.parametrize("name", ["bioloid", "poppy12", "linkages/four-bar"])
def test_a_robot_without_boxes_is_one_figure_of_sticks_through_all_that_its_table_places(name: str) -> None:
    robot = sk.load_robot(name)
    bare = replace(robot, links=tuple(replace(link, boxes=(), shapes=()) for link in robot.links))
    sticks = solids_of(bare, 0.01).boxes.corners
    ends = np.stack([sticks[:, :4].mean(axis=1), sticks[:, 4:].mean(axis=1)], axis=1)
    carrying = {joint.parent for joint in bare.tree} | {limb.link for limb in bare.limbs}
    carrying |= {one for closure in bare.closures for one in (closure.link_a, closure.link_b)}
    placed = [joint.screw.s0 for joint in bare.tree] + [limb.frame.p for limb in bare.limbs]
    placed += [corner for sole in bare.soles for corner in sole.corners]
    placed += [link.com for link in bare.links if link.mass and link.name not in carrying - {bare.base_link}]
    for point in placed:
        assert np.linalg.norm(ends - as_array(point), axis=-1).min() < 1e-6
    reached = np.zeros(len(ends), dtype=bool)
    reached[0] = True
    for _ in ends:
        apart = np.linalg.norm(ends[:, :, None, None] - ends[reached][None, None], axis=-1)
        reached |= apart.min(axis=(1, 2, 3)) < 1e-6
    assert reached.all()


@pytest.mark.parametrize("name", ["bioloid", "poppy12"])
def test_sticks_are_seen(name: str) -> None:
    robot = sk.load_robot(name)
    bare = replace(robot, links=tuple(replace(link, boxes=(), shapes=()) for link in robot.links))
    assert (np.ptp(one_picture(bare).astype(int), axis=-1) > 25).sum() > 40


def test_a_box_hides_what_stands_behind_it_and_the_first_of_two_equal_faces_is_seen(robot: Robot) -> None:
    """Drawn in table order, whatever is nearer must win; where two faces coincide they must not flicker."""
    unseen = Box(Vector(0, 0, 0), Vector(1e-6, 1e-6, 1e-6))

    def scene(*boxes: Box) -> Robot:
        shown = [*boxes, *[unseen] * (len(robot.links) - len(boxes))]
        return replace(
            robot,
            links=tuple(replace(link, boxes=(box,)) for link, box in zip(robot.links, shown, strict=True)),
        )

    wide = Box(Vector(0, 0, 0), Vector(0.2, 0.2, 0.2))
    ahead = Box(Vector(0.15, -0.15, 0), Vector(0.05, 0.05, 0.1))
    behind = Box(Vector(-0.15, 0.15, 0), Vector(0.05, 0.05, 0.1))
    plain = one_picture(scene(wide))
    assert near(one_picture(scene(wide, ahead)), SLATE).sum() > 50
    assert near(one_picture(scene(wide, behind)), SLATE).sum() == near(plain, SLATE).sum()
    assert np.array_equal(one_picture(scene(wide, wide)), plain)


def test_a_shape_looks_like_the_box_of_its_size_and_a_mesh_like_the_same_shape(
    robot: Robot, tmp_path: Path
) -> None:
    """The two ways of drawing, faces one by one and triangles all at once, against each other."""

    def scene(**seen: object) -> Picture:
        links = [replace(link, boxes=()) for link in robot.links[1:]]
        trunk = replace(robot.links[0], **{"boxes": (), **seen})
        return one_picture(replace(robot, links=(trunk, *links)))

    box = Box(Vector(0, 0.02, 0), Vector(0.2, 0.1, 0.15))
    boxed = scene(boxes=(box,)).astype(int)
    shape = Shape("visual", "box", Pose(UNTURNED, box.center), tuple(box.size), "", WHITE[:3])
    shaped = scene(shapes=(shape,)).astype(int)
    assert (np.abs(boxed - shaped).max(axis=-1) > 3).mean() < 0.01
    corners = box_points(Box(Vector(0, 0, 0), Vector(1, 1, 1)))
    faces = "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in hull_faces(corners))
    path = tmp_path / "cube.obj"
    path.write_text("".join(f"v {x} {y} {z}\n" for x, y, z in corners) + faces)
    mesh = replace(shape, kind="mesh", file=str(path))
    np.testing.assert_array_equal(scene(shapes=(mesh,)), shaped)
    red = scene(boxes=(box,), shapes=(replace(shape, colour=(1.0, 0.0, 0.0)),))
    assert near(red, (1.0, 0.0, 0.0)).sum() > 500
    with pytest.warns(RobotRemark, match=r"not in pictures: mesh .*none\.obj: cannot be read"):
        missing = scene(boxes=(box,), shapes=(replace(mesh, file=str(tmp_path / "none.obj")),))
    np.testing.assert_array_equal(missing, boxed)


def test_the_nearest_of_many_triangles_is_seen_wherever_rays_meet_several() -> None:
    """Against rays cast through the centres of all pixels, one triangle at a time."""
    rng = np.random.default_rng(5)
    corners = rng.uniform(-0.5, 0.5, (40, 1, 3)) + rng.uniform(-0.3, 0.3, (40, 3, 3))
    shades = rng.uniform(0.1, 1, (40, 3))
    view = view_of(replace(SMALL, width=60, height=50), np.zeros(3), 2.0)
    canvas, nearness = np.zeros((50, 60, 3), dtype=np.float32), np.zeros((50, 60))
    draw_triangles(canvas, nearness, view, corners, shades)
    x, y = np.meshgrid(np.arange(60) + 0.5, np.arange(50) + 0.5)
    right, up, forward = view.axes
    rays = forward + ((x - 30) / view.focal)[..., None] * right - ((y - 25) / view.focal)[..., None] * up
    nearest, wanted = np.full(x.shape, np.inf), np.zeros_like(canvas)
    for triangle, shade in zip(corners, shades, strict=True):
        a, edges = triangle[0], np.column_stack([triangle[1] - triangle[0], triangle[2] - triangle[0]])
        columns = np.concatenate([np.broadcast_to(edges, (*x.shape, 3, 2)), -rays[..., None]], axis=-1)
        u, v, t = np.moveaxis(np.linalg.solve(columns, (view.eye - a)[:, None])[..., 0], -1, 0)
        hit = (np.minimum(np.minimum(u, v), 1 - u - v) >= 0) & (t > 0) & (t < nearest)
        nearest[hit], wanted[hit] = t[hit], shade
    assert (np.abs(canvas - wanted).max(axis=-1) > 1e-6).mean() < 0.002
    assert (wanted.max(axis=-1) > 0).mean() > 0.2


def test_the_shadow_lies_on_the_side_away_from_the_lamp(robot: Robot) -> None:
    bare = replace(robot, links=tuple(replace(link, boxes=()) for link in robot.links))
    floating = Link(**{**vars(robot.links[0]), "boxes": (Box(Vector(0, 0, 0), Vector(0.1, 0.1, 0.02)),)})
    above = Camera(width=160, height=160, yaw=0.0, pitch=-89.0, distance=8.0, light=(1.0, 0.0, 1.0))
    lit = one_picture(bare, above).astype(float).mean(axis=-1)
    with_box = (
        one_picture(replace(bare, links=(floating, *bare.links[1:])), above).astype(float).mean(axis=-1)
    )
    darker = lit - with_box
    assert np.all(darker[:, 100:] < 1.0)
    assert darker[80, 48] > 40.0


def test_the_floor_is_chequered_with_tiles_of_the_given_size(robot: Robot) -> None:
    bare = replace(robot, links=tuple(replace(link, boxes=()) for link in robot.links))
    camera = Camera(width=200, height=200, yaw=0.0, pitch=-89.9, distance=8.0)
    row = one_picture(bare, camera)[90].astype(float).mean(axis=-1)
    edges = np.flatnonzero(np.abs(np.diff(row)) > 8)
    metres = 2 * np.tan(np.deg2rad(19)) * (8 * 0.17 + 0.93 * 0.17 - 0.93 * 0.17) / 200
    tiles = np.diff(edges[np.concatenate([[True], np.diff(edges) > 3])]) * metres
    assert np.median(tiles) == pytest.approx(0.1, rel=0.2)


def test_a_film_is_an_endless_gif_of_all_its_pictures(robot: Robot, tmp_path: Path) -> None:
    home = sk.home(robot)
    T = np.tile(home.T_world_base, (5, 1, 1))
    T[:, 0, 3] = np.linspace(0, 0.2, 5)
    frames = pictures(robot, np.linspace(0, 1, 5), T, np.tile(home.q, (5, 1)), SMALL)
    with Image.open(save_gif(tmp_path / "walk.gif", frames, 0.32)) as film:
        assert film.n_frames == 5
        assert film.info["loop"] == 0
        for i, frame in enumerate(frames):
            film.seek(i)
            assert film.info["duration"] == (40 if i in (0, 4) else 80)
            shown = np.asarray(film.convert("RGB"), dtype=float)
            assert np.abs(shown - frame).mean() < 3.0
    assert [path.name for path in tmp_path.iterdir()] == ["walk.gif"]


@given(st.integers(2, 120), st.floats(0.5, 60.0))
def test_a_film_lasts_as_long_as_its_motion_and_shows_each_picture_at_its_time(
    count: int, length: float
) -> None:
    shown = _milliseconds(count, length)
    assert len(shown) == count
    assert all(time % 10 == 0 and time > 0 for time in shown)
    if length / count >= 0.03:  # shorter ones are held for the hundredth that a GIF can hold at least
        assert sum(shown) == pytest.approx(1000 * length, abs=5.001)
        ends = np.cumsum(shown)[:-1]
        np.testing.assert_allclose(
            ends, 1000 * length * (np.arange(count - 1) + 0.5) / (count - 1), atol=5.001
        )


def test_a_picture_survives_as_png_and_an_unwritable_place_is_told(robot: Robot, tmp_path: Path) -> None:
    picture = one_picture(robot)
    with Image.open(save_png(tmp_path / "home.png", picture)) as image:
        assert np.array_equal(np.asarray(image), picture)
    with pytest.raises(OutputError, match=r"cannot write .*home\.png"):
        save_png(tmp_path / "absent" / "home.png", picture)
    with pytest.raises(OutputError, match=r"cannot write .*walk\.gif"):
        save_gif(tmp_path / "absent" / "walk.gif", [picture], 0.1)
