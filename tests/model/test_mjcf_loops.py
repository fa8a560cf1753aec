"""Loops of MJCF models as closures, against MuJoCo's own equality constraints."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import screwkin as sk
from screwkin.mechanism.linkages import motor_joints
from screwkin.model.mjcf_in import parse_mjcf

BAR = '<geom type="capsule" fromto="0 0 0 {x} 0 0" size="0.01" mass="0.1"/>'
FOUR_BAR = """<mujoco model="four_bar"><compiler angle="radian"/><worldbody>{open}
<body name="crank"><joint name="crank" axis="0 0 1"/>{crank}
  <body name="coupler" pos="0.1 0 0"><joint name="pin" axis="0 0 1"/>{coupler}
    <site name="end" pos="0.3 0 0"/></body></body>
<body name="rocker" pos="0.25 0 0"><joint name="rocker" axis="0 0 1"/>{rocker}
  <site name="tip" pos="0.15 0 0"/>{eye}</body>{close}</worldbody>
<equality>{equality}</equality><actuator><motor joint="crank"/></actuator>
<keyframe>{keys}</keyframe></mujoco>"""
EYE = '<body name="eye" pos="0.15 0 0"><joint name="eye" axis="0 0 1"/><geom size="0.01" mass="0.01"/></body>'


def posed(q0: float) -> tuple[float, float, float, float]:
    """Crank, pin, rocker and eye of the four-bar of 0.1, 0.3, 0.15 on 0.25, by hand."""
    A = 0.1 * np.array([np.cos(q0), np.sin(q0)])
    away = A - [0.25, 0]
    d = np.hypot(*away)
    inner = np.arccos((0.15**2 + d**2 - 0.3**2) / (2 * 0.15 * d))
    rocker = np.arctan2(away[1], away[0]) - inner
    B = np.array([0.25, 0]) + 0.15 * np.array([np.cos(rocker), np.sin(rocker)])
    coupler = np.arctan2(*(B - A)[::-1])
    return q0, coupler - q0, rocker, coupler - rocker


def text(equality: str, eye: bool, base: str = "") -> str:
    qpos = posed(1.0)[: 4 if eye else 3]
    off = (*qpos[:2], qpos[2] + 0.1, *qpos[3:])
    free = "0.1 0.2 0.3 0.8 0 0.6 0 " if base else ""
    keys = "".join(
        f'<key name="{name}" qpos="{free}{" ".join(map(repr, map(float, q)))}"/>'
        for name, q in (("home", qpos), ("open", off))
    )
    return FOUR_BAR.format(
        open=f'<body name="base" {base}><freejoint/><geom size="0.05" mass="1"/>' if base else "",
        close="</body>" if base else "",
        crank=BAR.format(x=0.1),
        coupler=BAR.format(x=0.3),
        rocker=BAR.format(x=0.15),
        eye=EYE if eye else "",
        equality=equality,
        keys=keys,
    )


CASES = {
    "connect": ('<connect name="loop" site1="end" site2="tip"/>', False, ""),
    "connect in a turned base": (
        '<connect name="loop" site1="end" site2="tip"/>',
        False,
        'euler="0.3 0.2 0.5"',
    ),
    "weld": ('<weld name="loop" site1="end" site2="eye"/>'.replace('"eye"', '"mid"'), True, ""),
}


@pytest.mark.parametrize("case", CASES)
def test_closures_hold_what_mujocos_equalities_hold(case: str) -> None:
    xml = text(*CASES[case]).replace(EYE, EYE.replace("<geom", '<site name="mid"/><geom'))
    read = parse_mjcf(xml)
    robot, model = read.robot, mujoco.MjModel.from_xml_string(xml)
    assert [closure.name for closure in robot.closures] == ["loop"]
    assert [posture.name for posture in robot.postures] == ["home"]
    assert any("keyframes that leave loops open, left out: open" in remark for remark in read.remarks)
    assert motor_joints(robot) == ("crank",)
    base = [f"waist.{c}" for c in ("px", "py", "pz", "rx", "ry", "rz")] if robot.base == "floating" else []
    alone = sk.closed_mechanism(robot, [*base, "crank"])
    assert alone.mobility == len(base) + 1
    home, data = sk.home(robot), mujoco.MjData(model)
    start = sk.close_loops(alone, home, {}).coordinates[alone.position["crank"]]
    for crank in np.linspace(0.3, 2.0, 6):
        state = sk.close_loops(alone, home, {"crank": crank}).state
        assert start == pytest.approx(1.0)
        for name in ("crank", "pin", "rocker", "eye"):
            if name in robot.joint_names:
                data.qpos[model.joint(name).qposadr[0]] = state.q[robot.joint_names.index(name)]
        mujoco.mj_forward(model, data)
        assert np.abs(data.efc_pos[: data.ne]).max() < 1e-9
        np.testing.assert_allclose(
            [state.q[robot.joint_names.index(n)] for n in ("crank", "pin", "rocker")],
            posed(crank)[:3],
            atol=1e-9,
        )


@pytest.mark.parametrize("kind", ["connect", "weld"])
def test_equalities_of_bodies_hold_what_is_together_at_qpos0(kind: str) -> None:
    """Anchors and relative poses are MuJoCo's: a weld of two bodies in a row locks what is between them."""
    anchor = ' anchor="0.3 0 0"' if kind == "connect" else ""
    xml = text(f'<{kind} name="loop" body1="coupler" body2="rocker"{anchor}/>', False)
    robot, model = parse_mjcf(xml).robot, mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    assert [posture.name for posture in robot.postures] == (["home"] if kind == "connect" else [])
    mechanism = sk.closed_mechanism(robot)
    assert (kind, mechanism.mobility) in (("connect", 1), ("weld", 1))  # welded in line: a dead point
    if kind == "connect":
        closed = sk.close_loops(mechanism, sk.home(robot), {"crank": 0.8})
        for name in ("crank", "pin", "rocker"):
            data.qpos[model.joint(name).qposadr[0]] = closed.state.q[robot.joint_names.index(name)]
        mujoco.mj_forward(model, data)
        assert np.abs(data.efc_pos[: data.ne]).max() < 1e-9


def test_what_is_not_active_holds_nothing() -> None:
    own = '<weld name="loop" body1="coupler" body2="rocker" active="false"/>'
    coupling = '<joint name="pair" joint1="rocker" joint2="crank" polycoef="0 1 0 0 0" active="false"/>'
    read = parse_mjcf(text(own + coupling, False))
    assert (read.robot.closures, read.robot.coupled) == ((), ())
    assert "not active, left out: loop, pair" in read.remarks
