"""Pictures: every one is drawn and holds what it says; nothing global is left behind."""

from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pytest
from PIL import Image

import screwkin as sk
from screwkin.algebra.se3 import as_array
from screwkin.errors import InputError
from screwkin.report import balance, frames, motion, simulation
from screwkin.report.pictures import save_pictures
from screwkin.report.style import joint_colours, new_figure, save_figure, spans, styled, titled
from tests.bodies import humanoid


@pytest.fixture(scope="module")
def saved(account, check, tmp_path_factory):
    folder = tmp_path_factory.mktemp("pictures")
    shares = []
    return save_pictures(account, folder, check, shares.append), shares


def test_all_of_the_papers_figures_and_the_simulation_are_drawn(saved):
    names = {picture.path.stem for picture in saved[0]}
    paper = {"feet_x", "feet_z", "waist_x", "waist_y", "frames", "zmp_x", "zmp_y", "joints"}
    assert paper | {"top_view", "margin", "singular_values", "servos", "upright"} <= names


def test_every_picture_is_a_png_with_something_in_it(saved):
    for picture in saved[0]:
        with Image.open(picture.path) as image:
            assert image.format == "PNG"
            assert image.width == 1092
            grey = np.asarray(image.convert("L"))
        assert 0.01 < (grey < 250).mean() < 0.9, picture.path.name
        assert picture.caption.endswith(".")


def test_joints_have_the_colour_of_their_side_and_those_of_both_sides_another(account):
    body = sk.robot_from_text(humanoid(waist="yaw"), name="body")
    colours = joint_colours(replace(account, robot=body), "grey")
    sides = {side: {c for name, c in colours.items() if name.startswith(side)} for side in ("right", "left")}
    assert [len(found) for found in sides.values()] == [1, 1]
    assert len(sides["right"] | sides["left"] | {"grey"}) == 3
    assert {c for name, c in colours.items() if not name.startswith(("right", "left"))} == {"grey"}
    assert {*colours} == {*body.joint_names}


def test_progress_rises_to_one(saved):
    shares = saved[1]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_drawing_changes_nothing_global(account, tmp_path):
    before = dict(mpl.rcParams)
    with styled():
        save_figure(motion.feet_along_z(account), tmp_path / "z.png")
        assert mpl.rcParams["axes.spines.top"] is False
    assert dict(mpl.rcParams) == before


def test_the_same_data_make_the_same_bytes(account, tmp_path):
    for name in ("a", "b"):
        with styled():
            save_figure(motion.waist_along_y(account), tmp_path / f"{name}.png")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def lines(axes):
    """Lines of an axis by their label."""
    return {line.get_label(): line for line in axes.get_lines() if not line.get_label().startswith("_")}


def test_the_feet_are_drawn_where_they_are(account):
    trajectory = account.trajectory
    with styled():
        drawn = lines(motion.feet_along_z(account).axes[0])
    for foot in trajectory.feet:
        line = drawn[foot.replace("_", " ")]
        assert np.allclose(line.get_ydata(), 1e3 * trajectory.T_world_tip[foot][:, 2, 3])
        assert np.allclose(line.get_xdata(), trajectory.time)


@pytest.mark.parametrize("axis", [0, 1])
def test_zmp_and_gcom_are_drawn_in_the_unit_of_the_axis(account, axis):
    with styled():
        place, apart = balance.zmp_against_gcom(account, axis).axes
    unit = 1e3 if "[mm]" in place.get_ylabel() else 1.0
    drawn = lines(place)
    assert np.allclose(drawn["ZMP"].get_ydata(), unit * account.balance.zmp[:, axis])
    assert np.allclose(drawn["GCoM"].get_ydata(), unit * account.balance.com[:, axis])
    difference = lines(apart)["ZMP - GCoM"].get_ydata()
    assert np.allclose(difference, 1e3 * (account.balance.zmp - account.balance.com[:, :2])[:, axis])


def test_the_band_is_the_extent_of_the_soles_on_the_floor(account):
    with styled():
        place = balance.zmp_against_gcom(account, 1).axes[0]
    band = next(c for c in place.collections if c.get_label() == "support polygon").get_paths()[0].vertices
    trajectory, half = account.trajectory, 33.0  # mm: half of a sole's width
    for i in (0, 60, 100, 150, trajectory.samples - 2):
        feet = [f for k, f in enumerate(trajectory.feet) if trajectory.contact[i, k]]
        edges = [1e3 * trajectory.T_world_tip[f][i, 1, 3] + s * half for f in feet for s in (-1, 1)]
        here = band[np.abs(band[:, 0] - trajectory.time[i]) < 1e-9, 1]
        assert min(here) == pytest.approx(min(edges), abs=1e-6)
        assert max(here) == pytest.approx(max(edges), abs=1e-6)


def test_spikes_are_annotated_with_their_times(account):
    with styled():
        axes = balance.margin_over_time(account).axes[1]
    told = {text.get_text() for text in axes.texts}
    largest = max(account.balance.spikes, key=lambda spike: spike.distance)
    assert f"{largest.time:.2f}" in told
    assert told <= {f"{spike.time:.2f}" for spike in account.balance.spikes}


def test_support_polygons_hold_the_zmp_of_a_sound_walk(account):
    from shapely.geometry import Point, Polygon

    phases = balance.support_polygons(account)
    covered = [i for begin, end, _ in phases for i in range(begin, end + 1)]
    assert covered == list(range(account.trajectory.samples))
    for begin, end, corners in phases:
        polygon = Polygon(corners)
        for i in range(begin, end + 1):
            point = Point(*account.balance.zmp[i])
            assert polygon.exterior.distance(point) == pytest.approx(account.balance.margin[i], abs=1e-9)
            assert polygon.contains(point)


def test_a_zmp_outside_is_marked(tipping):
    with styled():
        drawn = lines(balance.seen_from_above(tipping).axes[0])
    assert len(drawn["ZMP outside"].get_xdata()) == tipping.outside.sum() > 0


def test_swings_are_shaded_while_the_foot_is_in_the_air(account):
    with styled():
        figure = motion.feet_along_z(account)
    shaded = [p for p in figure.axes[0].patches if p.get_label() == "right foot in the air"]
    contact = account.trajectory.contact[:, account.trajectory.feet.index("right_foot")]
    first = account.trajectory.time[np.flatnonzero(~contact)[0]]
    assert shaded[0].get_x() == pytest.approx(first)


def test_joint_angles_are_in_degrees_and_named_without_the_side(account, robot):
    with styled():
        right, left = (lines(axes) for axes in motion.joint_angles(account).axes)
    knee = robot.joint_names.index("left_knee")
    assert np.allclose(left["knee"].get_ydata(), np.degrees(account.trajectory.q[:, knee]))
    assert set(right) == set(left) == {
        "hip yaw", "hip roll", "hip pitch", "knee", "ankle pitch", "ankle roll"
    }  # fmt: skip


def test_a_robot_without_arms_has_no_picture_of_them(account, robot):
    from dataclasses import replace

    legs = tuple(limb for limb in robot.limbs if limb.kind == "leg")
    assert motion.joint_angles(replace(account, robot=replace(robot, limbs=legs)), "arm") is None


def test_frames_are_taken_over_one_cycle_in_the_middle(account):
    from dataclasses import replace

    times = frames.frame_times(account)
    begin, end = account.boundaries[2], account.boundaries[4]
    assert times[0] == pytest.approx(begin)
    assert np.allclose(np.diff(times), (end - begin) / 6)
    for boundaries, start in (
        ([0, 1, 2, 3, 4, 5, 6], 2.0),
        ([0, 1, 2], 0.0),
    ):  # a cycle begins at an even step
        meta = {**account.trajectory.meta, "boundaries": boundaries}
        other = replace(account, trajectory=replace(account.trajectory, meta=meta))
        assert frames.frame_times(other)[0] == start


def test_gait_cycles_begin_and_end_at_every_other_step(account):
    from dataclasses import replace

    def at(boundaries):
        meta = {**account.trajectory.meta, "boundaries": boundaries}
        return replace(account, trajectory=replace(account.trajectory, meta=meta))

    assert frames.cycle_times(at([0, 1, 2, 3, 4, 5, 6])).tolist() == [0, 2, 4, 6]
    with pytest.raises(InputError, match="no gait cycle"):
        frames.cycle_times(at([0, 1]))


def test_what_is_near_the_viewer_hides_what_is_far(account):
    with styled():
        patches = frames.frames_drawn(account).axes[0].patches
    from matplotlib.colors import to_hex

    from screwkin.report.style import SIDES

    colours = [to_hex(patch.get_facecolor()).upper() for patch in patches]
    right, left = ([k for k, colour in enumerate(colours) if colour == side] for side in SIDES[:2])
    assert max(left) < min(right)  # the viewer stands at the robot's right


def test_a_link_without_boxes_is_drawn_as_a_line_to_what_it_carries(account, robot):
    from dataclasses import replace

    bare = replace(robot, links=tuple(replace(link, boxes=()) for link in robot.links))
    with styled():
        figure = frames.frames_drawn(replace(account, robot=bare))
    drawn = [line for line in figure.axes[0].get_lines() if len(line.get_xdata()) == 2]
    hips = [as_array(joint.screw.s0) for joint in robot.tree if joint.parent == robot.base_link]
    longest = max(np.linalg.norm(one - hips[0]) for one in hips)  # from the first hip to the other shoulder
    lengths = [np.hypot(*np.ptp(line.get_xydata(), axis=0)) for line in drawn]
    assert max(lengths[1:]) <= longest
    assert len(drawn) > 8


def test_where_nothing_was_measured_nothing_is_drawn(account, check):
    assert simulation.contact_zmp(account, check) is None


def test_spans_are_runs_of_true():
    assert spans([False, True, True, False, True]) == [(1, 3), (4, 4)]
    assert spans([True, True]) == [(0, 1)]
    assert spans([False]) == []


@pytest.mark.parametrize("rows", [1, 2, 3])
@pytest.mark.parametrize("height", [3.0, 4.6, 9.0])
def test_a_title_above_stacked_axes_covers_none_of_them_and_is_not_cut_off(rows, height):
    """Boxes as they are drawn do not meet."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure, _ = new_figure(height, rows)
    titled(figure, rows, "a gait: falls with 95 % intervals, and the plan's margin")
    draw = FigureCanvasAgg(figure).get_renderer()
    box = figure.get_suptitle() and figure.texts[0].get_window_extent(draw)
    assert all(not box.overlaps(axis.get_window_extent(draw)) for axis in figure.axes)
    assert box.y1 <= figure.bbox.y1
