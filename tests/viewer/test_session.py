"""What controls do, without a browser: clocks, joints that loops tie, motions scrubbed and planned anew."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import screwkin as sk
from screwkin.dynamics.on_floor import soles_on_floor
from screwkin.errors import NoSolutionError
from screwkin.viewer.controls import dragged, gait_sliders, joint_sliders
from screwkin.viewer.scene import first_pose
from screwkin.viewer.session import advanced, begun, handled, replanned, with_motion
from screwkin.viewer.track import Playhead, track_of
from tests.analysis.conftest import robot, trajectory

__all__ = ["robot", "trajectory"]
LOOPED = ["linkages/four-bar", "linkages/slider-crank", "linkages/bennett", "linkages/stewart"]
times = st.floats(0.0, 20.0)


@given(duration=st.floats(0.1, 10.0), start=times, first=times, second=times, speed=st.floats(0.1, 2.0))
def test_a_clock_stays_within_its_motion_and_time_adds_up(duration, start, first, second, speed):
    clock = replace(Playhead(duration).at(start), playing=True, speed=speed)
    assert 0.0 <= clock.time <= duration
    once, twice = clock.after(first + second), clock.after(first).after(second)
    assert once.time == pytest.approx(twice.time, rel=1e-9)
    assert once.time == pytest.approx(min(clock.time + speed * (first + second), duration), rel=1e-9)
    assert not once.playing or once.time < duration
    stopped = replace(clock, playing=False)
    assert stopped.after(first) == stopped
    again = replace(stopped, time=duration).toggled()
    assert (again.playing, again.time) == (True, 0.0)
    assert clock.toggled().toggled() == (clock if clock.time < duration else replace(clock, time=0.0))


@given(name=st.sampled_from(LOOPED), by=st.floats(-0.02, 0.02), which=st.integers(0, 2))
def test_dragging_a_joint_keeps_every_loop_closed(name, by, which):
    linkage = sk.load_robot(name)
    _, q = first_pose(linkage)
    joint = linkage.joint_names[which]
    moved = dragged(linkage, q, joint, q[which] + by)
    assert moved[which] == pytest.approx(q[which] + by, abs=1e-9)
    for closure in linkage.closures:
        ends = []
        for link, frame in ((closure.link_a, closure.frame_a), (closure.link_b, closure.frame_b)):
            carried, home = (
                sk.link_poses(linkage, sk.State(np.eye(4), at))[linkage.link_names.index(link)]
                for at in (moved, np.zeros(len(q)))
            )
            ends.append(carried @ np.linalg.inv(home) @ sk_pose(frame))
        assert np.allclose(*ends, atol=1e-8)


def sk_pose(frame):
    from screwkin.algebra.se3 import as_array

    return as_array(frame).astype(float)


def test_a_linkage_that_cannot_follow_says_so_and_stays():
    linkage = sk.load_robot("linkages/four-bar")
    session = begun(linkage)
    with pytest.raises(NoSolutionError, match="no closed posture"):
        dragged(linkage, session.q, "rocker", 3.1)
    after = handled(session, {"joint rocker": 3.1})
    assert "no closed posture" in after.note
    assert np.array_equal(after.q, session.q)


def test_sliders_span_the_limits_and_contain_where_the_robot_is(robot):
    _, q = first_pose(robot)
    for joint, slider, value in zip(robot.joints, joint_sliders(robot, q), q, strict=True):
        assert slider.lower <= value <= slider.upper
        assert (slider.lower, slider.upper) == (joint.lower, joint.upper)
        assert slider.label == f"{joint.name} [rad]"
    gait = sk.load_gait("walk")
    values = {slider.name: slider for slider in gait_sliders(robot, gait)}
    assert list(values) == ["stride", "Tc", "lift", "sway", "waist_height"]
    assert all(slider.lower < slider.value < slider.upper for slider in values.values())


def test_a_motion_is_shown_at_its_samples(robot, trajectory):
    track = track_of(robot, trajectory)
    for sample in (0, 17, trajectory.samples - 1):
        assert track.sample(track.time[sample]) == sample
    assert track.sample(-1.0) == 0
    assert track.sample(1e9) == trajectory.samples - 1
    session = handled(with_motion(begun(robot), trajectory), {"time": "1.0"})
    k = int(np.abs(trajectory.time - 1.0).argmin())
    assert np.array_equal(session.q, trajectory.q[k])
    assert np.array_equal(session.T_world_base, trajectory.T_world_base[k])
    x, y = 1e3 * trajectory.zmp[k]
    assert f"ZMP x {x:.1f} mm, y {y:.1f} mm" in session.reading


def test_the_zmp_lies_in_the_polygon_that_is_drawn_as_deep_as_the_margin_says(robot, trajectory):
    from shapely import Point, Polygon

    track = track_of(robot, trajectory)
    soles = soles_on_floor(robot, trajectory.feet, trajectory.T_world_tip)
    for k in range(0, trajectory.samples, 7):
        polygon = Polygon(track.polygon(k)[:, :2])
        point = Point(*trajectory.zmp[k])
        inside = polygon.exterior.distance(point) * (1 if polygon.contains(point) else -1)
        assert inside == pytest.approx(trajectory.margin[k], abs=1e-6)
        assert np.array_equal(track.soles[0][k, :, :2], soles[k, 0])


def test_playing_goes_on_in_time_and_a_dragged_joint_stops_it(robot, trajectory):
    session = handled(with_motion(begun(robot), trajectory), {"speed": "0.5", "play": True})
    session = advanced(session, 1.0)
    assert session.clock.time == pytest.approx(0.5)
    stopped = handled(session, {"joint right_knee": 0.7})
    assert not stopped.clock.playing
    assert stopped.q[robot.joint_names.index("right_knee")] == 0.7
    assert np.array_equal(handled(stopped, {"home": True}).q, first_pose(robot)[1])


def test_a_gait_is_planned_once_for_all_that_was_changed_and_goes_on_where_it_was(robot, trajectory):
    plans = []

    def plan(of, gait, steps):
        plans.append((gait.numbers["stride"], gait.numbers["Tc"], steps))
        return trajectory

    session = replanned(begun(robot, sk.load_gait("paper"), 3), plan)
    session = handled(session, {"time": 2.0})
    share = session.clock.time / session.clock.duration
    import screwkin.gait.walk as module

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "planned_walk", plan)
        session = handled(session, {"gait stride": 0.04, "gait Tc": 1.25})
    assert plans[1:] == [(0.04, 1.25, 3)]
    assert session.clock.time == pytest.approx(share * session.clock.duration)
    assert "margin at least" in session.note


def test_a_gait_that_cannot_be_walked_leaves_the_motion_and_says_why(robot, trajectory):
    session = with_motion(begun(robot, sk.load_gait("paper"), 1), trajectory)
    after = handled(session, {"gait waist_height": 0.4})
    assert after.note.startswith("not planned: ")
    assert after.track is session.track


def test_advice_ends_the_note_of_a_gait_that_nobody_changed(robot):
    """Once a slider was moved, what cannot be walked is the slider's."""

    def plan(*_):
        raise NoSolutionError("the right leg cannot reach")

    session = begun(robot, sk.load_gait("paper"), advice="; or another gait")
    assert replanned(session, plan).note == "not planned: the right leg cannot reach; or another gait"
    assert handled(session, {"gait waist_height": 0.4}).note.startswith("not planned: ")
    assert "another" not in handled(session, {"gait waist_height": 0.4}).note


def test_without_a_motion_nothing_plays(robot):
    session = begun(robot)
    assert session.reading == "no motion yet"
    assert not handled(session, {"play": True}).clock.playing
    assert handled(session, {"time": 1.0}).sample is None
    assert replanned(session) is session
