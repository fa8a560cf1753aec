"""Groups of the SRDF beside a URDF: arms end where the groups of both do; what fits nothing is a remark."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

import screwkin as sk
from screwkin.algebra.se3 import as_array
from screwkin.anatomy.groups import groups_beside
from screwkin.anatomy.humanoid import anatomy
from screwkin.anatomy.record import Anatomy
from tests.anatomy.bodies import biped

ARM = ("shoulder_pitch", "shoulder_roll", "elbow_pitch", "elbow_yaw", "wrist_pitch")


def seen(folder: Path, groups: str = "", rpy: str = "0 0 0", waist: str = "") -> Anatomy:
    """A body of five joints an arm, beside an SRDF of such groups."""
    (folder / "body.urdf").write_text(biped(arm=ARM, waist=waist).text(rpy), encoding="utf-8")
    if groups:
        (folder / "body.srdf").write_text(f'<robot name="body">{groups}</robot>', encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return anatomy(sk.load_robot(folder / "body.urdf"))


def joints_of(robot: sk.Robot, limb: str) -> list[str]:
    return [robot.tree[i].name for i in robot.path_to(robot.limb(limb).link)]


def cut(robot: sk.Robot, side: str, count: int) -> tuple[str, str, list[str]]:
    """Last link and parent link of an arm's first joints, and their names."""
    path = robot.path_to(robot.limb(f"{side}_arm").link)[-len(ARM) :][:count]
    return robot.tree[path[0]].parent, robot.tree[path[-1]].child, [robot.tree[i].name for i in path]


def written(kind: str, parent: str, link: str, joints: list[str]) -> str:
    """A group of a kind."""
    if kind == "chain":
        return f'<chain base_link="{parent}" tip_link="{link}"/>'
    if kind == "from the base":
        return f'<chain base_link="frame" tip_link="{link}"/>'
    return "".join(f'<joint name="{joint}"/>' for joint in joints)


@pytest.mark.parametrize(
    ("kind", "count", "waist", "rpy"),
    [
        ("chain", 3, "", "0 0 0"),
        ("from the base", 4, "yaw", "0 0 0"),
        ("joints", 3, "yaw", "0 0 0"),
        ("joints", 4, "", "0 0 1.5707963267948966"),
        ("chain", 5, "yaw", "0 0 1.5707963267948966"),
    ],
)
def test_arms_end_where_the_groups_of_both_do(
    tmp_path: Path, kind: str, count: int, waist: str, rpy: str
) -> None:
    plain = seen(tmp_path, rpy=rpy, waist=waist)
    cuts = {side: cut(plain.robot, side, count) for side in ("left", "right")}
    texts = [f'<group name="{side}_reach">{written(kind, *one)}</group>' for side, one in cuts.items()]
    found = seen(tmp_path, "".join(texts), rpy, waist=waist)
    for side, (_, link, joints) in cuts.items():
        limb = found.robot.limb(f"{side}_arm")
        assert joints_of(found.robot, limb.name)[-count:] == joints
        place = found.robot.link(link).frame.p
        np.testing.assert_allclose(as_array(limb.frame.p), as_array(place), atol=1e-9)
        assert any(f"the group {side}_reach of the SRDF" in f.why for f in found.limbs)
    assert joints_of(found.robot, "left_leg") == joints_of(plain.robot, "left_leg")


def test_the_longer_of_two_groups_counts_and_one_of_a_single_side_does_not(tmp_path: Path) -> None:
    plain = seen(tmp_path)
    texts = []
    for count in (3, 4):
        for side in ("left", "right"):
            texts.append(
                f'<group name="{side}{count}">{written("chain", *cut(plain.robot, side, count))}</group>'
            )
    texts.append(f'<group name="left5">{written("chain", *cut(plain.robot, "left", 5))}</group>')
    robot = seen(tmp_path, "".join(texts)).robot
    for side in ("left", "right"):
        assert joints_of(robot, f"{side}_arm")[-4:] == cut(plain.robot, side, 4)[2]


def test_a_group_of_strange_links_is_a_remark_and_nothing_else_changes(tmp_path: Path) -> None:
    plain = seen(tmp_path)
    found = seen(tmp_path, '<group name="wings"><chain base_link="part0" tip_link="feather"/></group>')
    assert any("group wings of body.srdf names links that are not here: feather" in r for r in found.remarks)
    assert [f.answer for f in found.limbs] == [f.answer for f in plain.limbs]


@pytest.mark.parametrize(
    "group",
    [
        '<group name="none"/>',
        '<group name="both"><group name="a"/><group name="b"/></group>',
        '<group name="gap"><joint name="axis0"/><joint name="axis2"/></group>',
        '<group name="across"><chain base_link="part3" tip_link="part9"/></group>',
        '<group name="strange"><joint name="wing"/></group>',
    ],
)
def test_groups_that_are_no_chains_change_nothing(tmp_path: Path, group: str) -> None:
    plain = seen(tmp_path)
    found = seen(tmp_path, group)
    assert [f.answer for f in found.limbs] == [f.answer for f in plain.limbs]
    assert found.remarks == plain.remarks


def test_a_robot_without_a_file_or_with_a_damaged_one_has_no_groups(tmp_path: Path) -> None:
    robot = seen(tmp_path).robot
    assert groups_beside(robot) == ((), ())
    (tmp_path / "body.srdf").write_text("no xml", encoding="utf-8")
    assert groups_beside(robot) == ((), ())
    assert groups_beside(sk.robot_from_text(robot.text)) == ((), ())
