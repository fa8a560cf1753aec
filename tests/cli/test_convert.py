"""``convert``: any of the three formats into any other, with a word on what is lost."""

import warnings

import numpy as np
import pytest

from screwkin.algebra.se3 import IDENTITY, as_array
from screwkin.cli.output import remarks_of_robots, shortened
from screwkin.errors import RobotRemark
from screwkin.kinematics.positions import link_displacements
from screwkin.model.dh_csv import load_dh
from screwkin.model.table import load_robot
from screwkin.model.urdf_in import load_urdf
from tests.model.chains import fk_by_matrices
from tests.model.urdf_texts import GRIP


def displacement(robot, q):
    """Displacement of the right foot's link, whatever it is called."""
    displaced = link_displacements(robot, [q[name] for name in robot.joint_names])
    child = robot.joint("right_ankle_roll").child
    return as_array(displaced[robot.link_names.index(child)] @ IDENTITY)


@pytest.mark.parametrize("first", [".toml", ".urdf", ".csv"])
@pytest.mark.parametrize("second", [".toml", ".urdf", ".csv"])
def test_motion_survives_every_pair_of_formats(cli, tmp_path, first, second):
    robot = load_robot("poppy12")
    assert cli("convert", "poppy12", f"one{first}").code == 0
    assert cli("convert", f"./one{first}", f"two{second}").code == 0
    path = tmp_path / f"two{second}"
    q = dict(zip(robot.joint_names, np.random.default_rng(1).uniform(-3, 3, 12), strict=True))
    if second == ".csv":  # where the tip is at home does not matter to its displacement
        (table,) = (t for t in load_dh(path) if "right_ankle_roll" in t.joint_names)
        values = np.array([q[name] for name in table.joint_names])
        found = fk_by_matrices(table, values) @ np.linalg.inv(fk_by_matrices(table, 0 * values))
    else:
        found = displacement(load_robot(path) if second == ".toml" else load_urdf(path).robot, q)
    np.testing.assert_allclose(found, displacement(robot, q), rtol=0, atol=1e-14)


def test_a_table_written_out_is_the_same_robot_in_numbers(cli, tmp_path):
    called = cli("convert", "bioloid", "flat.toml", "--json")
    assert called.data["remarks"] == []
    flat, robot = load_robot(tmp_path / "flat.toml"), load_robot("bioloid")
    assert flat.joint_names == robot.joint_names
    assert flat.mass == robot.mass
    assert [p.q for p in flat.postures] == [p.q for p in robot.postures]


@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_the_convention_of_a_dh_file_can_be_chosen(cli, tmp_path, convention):
    called = cli("convert", "bioloid", "legs.csv", "--convention", convention)
    assert called.code == 0
    assert "DH tables hold the chains' geometry only" in called.err
    tables = load_dh(tmp_path / "legs.csv")
    assert {table.convention for table in tables} == {convention}
    assert [table.tip for table in tables] == list(load_robot("bioloid").tip_names)


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["poppy12", "out.xml"], "OUT must end with .toml, .urdf, .csv"),
        (
            ["poppy12", "out.csv", "--convention", "craig"],
            "unknown convention 'craig'; valid: standard, modified",
        ),
        (["linkages/four-bar", "out.urdf"], "URDF has no closed loops"),
        (["none.urdf", "out.toml"], "cannot be read"),
        (["none.csv", "out.toml"], "cannot be read"),
        (["poppy12", "out.toml", "--repair"], "are for a URDF that is read"),
        (["nobody", "out.toml"], "unknown robot 'nobody'"),
        (["poppy12", "no/such/folder/out.toml"], "no/such/folder"),
    ],
)
def test_bad_input_is_told_once_and_writes_nothing(cli, refused, tmp_path, words, named):
    assert named in refused(cli("convert", *words), 2)
    assert not list(tmp_path.iterdir())


IMPOSSIBLE = """<robot name="r"><link name="a"/><link name="b"><inertial><mass value="1"/>
<inertia ixx="0.06" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint></robot>"""


def test_impossible_inertias_are_kept_or_repaired_on_request(cli, tmp_path):
    (tmp_path / "r.URDF").write_text(IMPOSSIBLE)
    kept = cli("convert", "r.URDF", "kept.toml")
    assert (kept.code, "though no body has it" in kept.err) == (0, True)
    with pytest.warns(RobotRemark, match="triangle"):
        assert load_robot(tmp_path / "kept.toml").link("b").inertia.xx == 0.06
    assert cli("convert", "r.URDF", "repaired.toml", "--repair").code == 0
    repaired = load_robot(tmp_path / "repaired.toml")
    assert repaired.link("b").inertia.xx == pytest.approx(0.05)
    assert repaired.source == "URDF r.URDF, with repaired inertias"


def test_remarks_about_a_robot_are_lines_of_the_command_line(cli, tmp_path):
    (tmp_path / "r.urdf").write_text(IMPOSSIBLE)
    called = cli("info", "r.urdf", "--json")
    assert called.code == 0
    assert called.data["joints"]
    lines = called.err.splitlines()
    assert len(lines) >= 2
    assert all(line.startswith("remark: r.urdf: ") for line in lines)


def test_couplings_survive_table_and_urdf_and_are_told_where_they_are_lost(cli, tmp_path):
    (tmp_path / "grip.urdf").write_text(GRIP)
    for words in ("grip.urdf grip.toml", "grip.toml again.urdf", "grip.toml grip.csv"):
        source, target = words.split()
        called = cli("convert", f"./{source}", target, "--json")
        assert called.code == 0
        lost = [remark for remark in called.data["remarks"] if "free in it: f2 = -f1" in remark]
        assert bool(lost) == (target == "grip.csv")
    (joint,) = load_urdf(tmp_path / "again.urdf").robot.coupled
    assert (joint.name, joint.leader, joint.ratio, joint.offset) == ("f2", "f1", -1, 0)
    assert cli("info", "./grip.toml", "--json").data["coupled_joints"] == {
        "f2": {"joint": "f1", "ratio": -1.0, "offset": 0.0}
    }
    assert "-f1" in cli("table", "./grip.toml").out


def test_remarks_stand_once_and_their_lists_of_names_are_cut(capsys):
    text = "remark: merged: " + ", ".join(f"link_{i}" for i in range(200))
    with remarks_of_robots():
        for _ in range(2):
            warnings.warn(text.removeprefix("remark: "), RobotRemark, stacklevel=1)
    (line,) = capsys.readouterr().err.splitlines()
    head, more = line.rsplit(" and ", 1)
    assert line == shortened(text)
    assert head.count("link_") + int(more.removesuffix(" more")) == 200
    assert shortened("remark: short, one") == "remark: short, one"
