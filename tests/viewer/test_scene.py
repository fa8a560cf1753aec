"""What is drawn of robots, as data: bodies, axes, frames and circuits of every bundled table."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import screwkin as sk
from screwkin.algebra.se3 import as_array
from screwkin.viewer.marks import circuit_line, placed_frames, screw_axes
from screwkin.viewer.scene import displacements, first_pose, pieces_of

EVERY = sk.robot_names()


def volume(piece):
    """Signed volume [m^3], positive where all triangles turn about normals that point out."""
    a, b, c = np.moveaxis(piece.vertices[piece.faces], 1, 0)
    return float(np.einsum("fi,fi->", a, np.cross(b, c)) / 6)


@pytest.mark.parametrize("name", EVERY)
def test_every_link_that_reaches_somewhere_is_seen_and_bodies_are_solid(name):
    robot = sk.load_robot(name)
    pieces = pieces_of(robot)
    assert {piece.link for piece in pieces} <= set(range(len(robot.links)))
    assert pieces
    assert min(map(volume, pieces)) > 0.0
    for i, link in enumerate(robot.links):
        own = [piece for piece in pieces if piece.link == i]
        if link.boxes and not link.shapes:
            boxes = sum(float(np.prod(as_array(box.size))) for box in link.boxes)
            assert sum(map(volume, own)) == pytest.approx(boxes, rel=1e-9)
        carries = [j.child for j in robot.tree if j.parent == link.name and i != 0]
        if carries and not link.boxes and not link.shapes:
            ends = {tuple(as_array(j.screw.s0)) for j in robot.tree if link.name in (j.parent, j.child)}
            assert len(own) >= min(len(ends) - 1, 1)


@given(seed=st.integers(0, 2**32 - 1), name=st.sampled_from(EVERY))
def test_carried_frames_are_those_of_the_library_and_joints_hold_their_links_together(seed, name):
    robot, draw = sk.load_robot(name), np.random.default_rng(seed)
    q = draw.uniform(-1.0, 1.0, (2, len(robot.joints)))
    T = np.tile(np.eye(4), (2, 1, 1))
    T[:, :3, 3] = draw.normal(size=(2, 3))
    Ts = displacements(robot, T, q)
    for frame in placed_frames(robot):
        expected = sk.frame_pose(robot, sk.State(T, q), frame.name)
        assert np.allclose(Ts[:, frame.link] @ frame.pose, expected, atol=1e-12)
    for axis, joint in zip(screw_axes(robot), robot.tree, strict=True):
        below, above = (Ts[:, robot.link_names.index(link)] for link in (joint.child, joint.parent))
        assert axis.slides == (joint.type == "prismatic")
        way = np.diff(axis.ends, axis=0)[0]
        assert np.allclose(np.cross(way, as_array(joint.screw.s).astype(float)), 0.0, atol=1e-12)
        if joint.type == "revolute":  # its axis is the one line that both of its links carry
            ends = np.column_stack([axis.ends, np.ones(2)])
            assert np.allclose(below @ ends.T, above @ ends.T, atol=1e-12)


@pytest.mark.parametrize("name", EVERY)
def test_a_circuit_is_a_closed_line_through_its_joints_and_to_its_tip(name):
    robot = sk.load_robot(name)
    mechanism = sk.closed_mechanism(robot)
    T, q = first_pose(robot)
    Ts = displacements(robot, T, q)
    for circuit, row in zip(mechanism.circuit_names, mechanism.circuits, strict=True):
        way = circuit_line(mechanism, circuit, Ts, T)
        assert way.legs.shape == (len(way.points), 2, 3)
        assert np.linalg.norm(np.diff(way.legs, axis=1), axis=-1).min() > 0.0
        places = {joint.name: joint for joint in robot.tree if joint.name in row}
        for joint in places.values():
            D = Ts[robot.link_names.index(joint.child)]
            point = D[:3, :3] @ as_array(joint.screw.s0).astype(float) + D[:3, 3]
            assert np.linalg.norm(way.points - point, axis=1).min() < 1e-9
        tips = [limb.tip for limb in robot.limbs if any(c.startswith(limb.tip + ".") for c in row)]
        for tip in tips:
            point = sk.frame_pose(robot, sk.State(T, q), tip)[:3, 3]
            assert np.linalg.norm(way.points - point, axis=1).min() < 1e-9
        assert any(way.virtual) == any("." in coupling for coupling in row)
