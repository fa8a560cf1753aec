"""Two feet on the floor and a push, links that bend, against MuJoCo: its own forces, its own root."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import root
from scipy.spatial.transform import Rotation

import screwkin as sk
from screwkin.compliance.stiffness import static_deflection

mujoco = pytest.importorskip("mujoco")

STANCE, SWING = 0.09, 0.25
"""Half the distance of the feet and the length of thigh and shank [m]."""


def leg(side: str, y: float) -> str:
    """Hip roll and pitch, knee, ankle pitch and roll; the thigh bends by three slides and three hinges."""
    springs = "".join(
        f'<joint name="{side}_thigh_{kind}{axis}" type="{name}" axis="{vector}" '
        f'pos="0 0 -0.25" stiffness="{k}"/>'
        for kind, name, k in (("p", "slide", 9000), ("r", "hinge", 70))
        for axis, vector in (("x", "1 0 0"), ("y", "0 1 0"), ("z", "0 0 1"))
    )
    return f"""
    <body name="{side}_hip" pos="0 {y} 0">
      <joint name="{side}_hip_roll" axis="1 0 0" stiffness="60"/>
      <inertial pos="0 0 0" mass="0.1" diaginertia="1e-3 1e-3 1e-3"/>
      <body name="{side}_thigh_root">
        <joint name="{side}_hip_pitch" axis="0 1 0" stiffness="50"/>
        <inertial pos="0 0 {-0.125 + 0.25 / 3}" mass="0.3" diaginertia="1e-3 1e-3 1e-3"/>
        <body name="{side}_thigh">{springs}
          <inertial pos="0 0 {-0.125 - 0.25 / 3}" mass="0.3" diaginertia="1e-3 1e-3 1e-3"/>
          <body name="{side}_shank" pos="0 0 -0.25">
            <joint name="{side}_knee" axis="0 1 0" stiffness="70"/>
            <inertial pos="0 0 -0.1" mass="0.5" diaginertia="1e-3 1e-3 1e-3"/>
            <body name="{side}_ankle" pos="0 0 -0.25">
              <joint name="{side}_ankle_pitch" axis="0 1 0" stiffness="80"/>
              <inertial pos="0 0 0" mass="0.1" diaginertia="1e-3 1e-3 1e-3"/>
              <body name="{side}_foot">
                <joint name="{side}_ankle_roll" axis="1 0 0" stiffness="90"/>
                <inertial pos="0.02 0 -0.03" mass="0.2" diaginertia="1e-3 1e-3 1e-3"/>
                <site name="{side}_sole" pos="0 0 -0.05"/>
              </body></body></body></body></body></body>"""


MODEL = f"""<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/><worldbody>
<body name="pelvis" pos="0 0 0"><freejoint/><inertial pos="0.01 0 0.1" mass="3" diaginertia="1e-2 1e-2 1e-2"/>
{leg("right", -STANCE)}{leg("left", STANCE)}</body></worldbody></mujoco>"""

SPRING = "spring = {{ root = [0, {y}, 0], end = [0, {y}, -0.25], stiffness = {K} }}"
K = [[(70.0 if i < 3 else 9000.0) if i == j else 0.0 for j in range(6)] for i in range(6)]
JOINTS = ("hip_roll", "hip_pitch", "knee", "ankle_pitch", "ankle_roll")
SPRINGS = dict(zip(JOINTS, (60.0, 50.0, 70.0, 80.0, 90.0), strict=True))
BENT = dict(zip(JOINTS, (0.05, -0.4, 0.8, -0.35, -0.08), strict=True))


def row(kind: str, /, **values) -> str:
    return "\n".join([f"[[{kind}]]", *(f"{key} = {value}" for key, value in values.items())])


def table() -> str:
    rows = ['[robot]\nname = "walker"\nbase_link = "pelvis"\nbase = "floating"']
    cube = "{ box = [0.1, 0.1, 0.1] }"
    rows.append(row("link", name='"pelvis"', mass=3, com=[0.01, 0, 0.1], inertia=cube))
    for side, y in (("right", -STANCE), ("left", STANCE)):
        parts = (
            ("hip", "hip_roll", 0.1, (0, y, 0), [1, 0, 0], 0.0, ""),
            ("thigh", "hip_pitch", 0.6, (0, y, -0.125), [0, 1, 0], 0.0, SPRING.format(y=y, K=K)),
            ("shank", "knee", 0.5, (0, y, -0.35), [0, 1, 0], -0.25, ""),
            ("ankle", "ankle_pitch", 0.1, (0, y, -0.5), [0, 1, 0], -0.5, ""),
            ("foot", "ankle_roll", 0.2, (0.02, y, -0.53), [1, 0, 0], -0.5, ""),
        )
        parent = "pelvis"
        for link, joint, mass, com, s, z, spring in parts:
            rows.append(
                row("link", name=f'"{side}_{link}"', mass=mass, com=list(com), inertia=cube) + "\n" + spring
            )
            ends = {"parent": f'"{parent}"', "child": f'"{side}_{link}"', "type": '"revolute"'}
            rows.append(row("joint", name=f'"{side}_{joint}"', **ends, s=s, s0=[0, y, z]))
            parent = f"{side}_{link}"
        tip = {"link": f'"{side}_foot"', "tip": f'"{side}_sole"', "frame": f"{{ xyz = [0, {y}, -0.55] }}"}
        rows.append(row("limb", name=f'"{side}_leg"', kind='"leg"', **tip))
    return "\n\n".join(rows)


def theirs(T: np.ndarray, q: dict[str, float], force: np.ndarray):
    """Deflections by joint, pelvis pose and the feet's wrenches: MuJoCo's balance, solved by SciPy."""
    model = mujoco.MjModel.from_xml_string(MODEL)
    data, rest = mujoco.MjData(model), mujoco.MjData(model)
    quat = Rotation.from_matrix(T[:3, :3]).as_quat()
    start = np.concatenate([T[:3, 3], quat[[3, 0, 1, 2]], np.zeros(model.nq - 7)])
    for name, value in q.items():
        start[model.jnt_qposadr[model.joint(name).id]] = value
    model.qpos_spring[:] = start
    rest.qpos[:] = start
    mujoco.mj_forward(model, rest)
    sites = [model.site(f"{side}_sole").id for side in ("right", "left")]
    pelvis = model.body("pelvis").id

    def unbalanced(z):
        data.qpos[:] = start
        mujoco.mj_integratePos(model, data.qpos, z[: model.nv], 1.0)
        data.qvel[:] = data.qacc[:] = 0
        mujoco.mj_forward(model, data)
        data.qacc[:] = 0
        mujoco.mj_inverse(model, data)
        rest_of = data.qfrc_inverse.copy()
        jacp, jacr = np.zeros((2, 3, model.nv))
        mujoco.mj_jac(model, data, jacp, jacr, data.xpos[pelvis], pelvis)
        rest_of -= jacp.T @ force
        gaps = []
        for k, site in enumerate(sites):
            mujoco.mj_jacSite(model, data, jacp, jacr, site)
            wrench = z[model.nv + 6 * k : model.nv + 6 * k + 6]
            rest_of -= jacr.T @ wrench[:3] + jacp.T @ wrench[3:]
            R, R0 = data.site_xmat[site].reshape(3, 3), rest.site_xmat[site].reshape(3, 3)
            gaps += [Rotation.from_matrix(R @ R0.T).as_rotvec(), data.site_xpos[site] - rest.site_xpos[site]]
        return np.concatenate([rest_of, *gaps])

    solved = root(unbalanced, np.zeros(model.nv + 12), method="hybr", tol=1e-13)
    assert np.abs(unbalanced(solved.x)).max() < 1e-9
    theta = {
        model.joint(i).name: data.qpos[model.jnt_qposadr[i]] - start[model.jnt_qposadr[i]]
        for i in range(1, model.njnt)
    }
    return theta, data.xpos[pelvis].copy(), solved.x[model.nv :].reshape(2, 6)


@pytest.mark.parametrize("force", [(0.0, 0.0, 0.0), (25.0, -15.0, -30.0)])
def test_two_feet_and_bending_thighs_settle_where_mujoco_balances(force):
    robot = sk.robot_from_text(table())
    q = {f"{side}_{name}": value for side in ("right", "left") for name, value in BENT.items()}
    q["left_knee"] += 0.2
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("xyz", [0.05, -0.03, 0.4]).as_matrix()
    T[:3, 3] = [0.3, -0.2, 0.5]
    k = {f"{side}_{name}": value for side in ("right", "left") for name, value in SPRINGS.items()}
    state = sk.State(T, np.array([q[name] for name in robot.joint_names]))
    ours = static_deflection(robot, state, ["right_sole", "left_sole"], k, loads={"pelvis": list(force)})
    ours.raise_on_failure()
    theta, pelvis, wrenches = theirs(T, q, np.array(force))
    np.testing.assert_allclose(ours.theta, [theta[name] for name in robot.joint_names], rtol=0, atol=1e-8)
    bends = [
        [theta[f"{side}_thigh_{c}"] for c in ("rx", "ry", "rz", "px", "py", "pz")]
        for side in ("right", "left")
    ]
    np.testing.assert_allclose(ours.links, bends, rtol=0, atol=1e-8)
    np.testing.assert_allclose(ours.state.T_world_base[:3, 3], pelvis, rtol=0, atol=1e-8)
    np.testing.assert_allclose(ours.wrenches, wrenches, rtol=0, atol=1e-6)
    assert np.abs(ours.theta).max() > 0.005
    assert np.abs(ours.links[..., :3]).max() > 0.001
