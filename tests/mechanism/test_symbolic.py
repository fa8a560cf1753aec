"""The symbolic twin of a limb: equal to the numeric model, in canonical form, legibly printed."""

from __future__ import annotations

import re

import numpy as np
import pytest
import sympy

import screwkin as sk
from screwkin.algebra.se3 import UNTURNED, Pose, Vector, as_array
from screwkin.errors import InputError, UnknownNameError
from screwkin.kinematics.positions import screws_in, successive_displacement
from screwkin.mechanism.printing import print_symbolic, screw_rows, screw_table
from screwkin.mechanism.symbolic import symbolic_limb, symbolic_loops
from screwkin.model.table import load_robot, parse_robot

RNG = np.random.default_rng(7)


@pytest.fixture(scope="module")
def bioloid():
    return load_robot("bioloid")


@pytest.fixture(scope="module")
def symbolic():
    return load_robot("bioloid", symbolic=True)


@pytest.fixture(scope="module")
def leg(symbolic):
    return symbolic_limb(symbolic, "right_leg")


def numbers_for(robot, part, q, angles=()):
    """Values of all symbols: the table's parameters, the joints', the virtual rotations'."""
    given = {sympy.Symbol(name, real=True): value for name, value in robot.parameters.items()}
    given |= {
        part.symbols[name]: x for name, x in zip(robot.joint_names, q, strict=True) if name in part.symbols
    }
    return given | dict(angles)


def evaluated(matrix, given):
    names = sorted(matrix.free_symbols, key=str)
    return np.array(sympy.lambdify(names, matrix, "numpy")(*(given[n] for n in names)), dtype=float)


def spaced(line):
    """A line with single blanks."""
    return " ".join(line.split())


def test_the_symbolic_pose_and_jacobian_equal_the_numeric_ones(bioloid, leg):
    for _ in range(5):
        q = RNG.uniform(-2, 2, 18)
        state = sk.State(np.eye(4), q)
        given = numbers_for(bioloid, leg, q)
        np.testing.assert_allclose(
            evaluated(leg.fk, given), sk.frame_pose(bioloid, state, "right_foot"), atol=1e-13
        )
        J = sk.jacobian(bioloid, state, "right_foot", point=[0, 0, 0])[:, 6:12]
        np.testing.assert_allclose(evaluated(leg.jacobian, given), J, atol=1e-13)


def test_the_symbolic_network_block_is_the_limbs_rows_of_the_network_matrix(bioloid, leg):
    mechanism = sk.closed_mechanism(bioloid)
    row = mechanism.circuit_names.index("right_leg")
    columns = [mechanism.position[name] for name in leg.couplings]
    for _ in range(5):
        q = RNG.uniform(-1, 1, 18)
        state = sk.State(np.eye(4), q)
        N = sk.network_matrix(mechanism, state)[6 * row : 6 * row + 6]
        T = sk.frame_pose(bioloid, state, "right_foot")
        R = T[:3, :3]
        euler = np.arctan2(-R[1, 2], R[2, 2]), np.arcsin(R[0, 2]), np.arctan2(-R[0, 1], R[0, 0])
        angles = {leg.symbols[f"right_foot.r{a}"]: x for a, x in zip("xyz", euler, strict=True)}
        place = dict(zip(leg.origin, T[:3, 3], strict=True))
        given = numbers_for(bioloid, leg, q, angles) | place
        np.testing.assert_allclose(evaluated(leg.network_block, given), N[:, columns], atol=1e-12)
        assert not np.delete(N, columns, axis=1).any()


def test_equal_expressions_are_brought_to_one_form(leg):
    """Hip, knee and ankle pitch turn about parallel axes: the foot knows only their sum."""
    q = [leg.symbols[f"right_{name}"] for name in ("hip_yaw", "hip_roll", "hip_pitch", "knee", "ankle_pitch")]
    assert leg.parallel == (tuple(q[2:]),)
    sin, cos = sympy.sin, sympy.cos
    turned = q[2] + q[3] + q[4]
    assert leg.fk[2, 0] == -sin(turned) * cos(q[1])
    assert leg.fk[0, 0] == cos(q[0]) * cos(turned) - sin(q[0]) * sin(q[1]) * sin(turned)
    hip_y = sympy.Symbol("hip_y", real=True)
    assert list(leg.jacobian[:, 1]) == [cos(q[0]), sin(q[0]), 0, 0, 0, hip_y * cos(q[0])]
    for matrix in (leg.fk, leg.jacobian, leg.network_block):
        assert not matrix.atoms(sympy.Float), "structure must not become a decimal"


def test_the_papers_reference_in_mid_calf_gives_the_same_leg(symbolic):
    """Paper A, eq. 13-14: screws told in the middle of the calf, A_c_ref before and A_ref_k behind them."""
    joints = [symbolic.joints[i] for i in symbolic.path_to("right_foot_link")]
    screws = [joint.screw for joint in joints]
    q = sympy.symbols("q1:7", real=True)
    thigh, calf, ankle, hip_y = sympy.symbols("thigh calf ankle_height hip_y", real=True)
    A_base_ref = Pose(UNTURNED, Vector(0, -hip_y, -(thigh + calf / 2)))
    A_ref_foot = Pose(UNTURNED, Vector(0, 0, -(calf / 2 + ankle)))
    told = screws_in(A_base_ref, screws)
    s0 = [sympy.simplify(screw.s0.z) for screw in told]
    assert s0 == [thigh + calf / 2] * 3 + [calf / 2] + [-calf / 2] * 2
    here = as_array(successive_displacement(told, q, A_base_ref, A_ref_foot))
    there = as_array(successive_displacement(screws, q, A_ref_k=symbolic.limb("right_leg").frame))
    assert sympy.simplify(sympy.expand(sympy.Matrix(here - there))) == sympy.zeros(4, 4)


def test_the_papers_reference_heights_come_out_as_printed(bioloid):
    joints = [bioloid.joints[i] for i in bioloid.path_to("right_foot_link")]
    mid_calf = Pose(UNTURNED, Vector(0, -0.042165, -0.11642935))
    heights = [screw.s0.z for screw in screws_in(mid_calf, [joint.screw for joint in joints])]
    np.testing.assert_allclose(heights, [0.11642935] * 3 + [0.03904645] + [-0.03904645] * 2, atol=1e-15)


def test_an_arm_and_a_numeric_table_work_too(bioloid):
    arm = symbolic_limb(bioloid, "left_hand")
    assert arm.name == "left_arm"
    q = RNG.uniform(-1, 1, 18)
    T = sk.frame_pose(bioloid, sk.State(np.eye(4), q), "left_hand")
    np.testing.assert_allclose(evaluated(arm.fk, numbers_for(bioloid, arm, q)), T, atol=1e-12)


def test_an_unknown_limb_is_refused_by_name(symbolic):
    with pytest.raises(UnknownNameError, match="unknown limb 'tail'; valid: right_leg, left_leg"):
        symbolic_limb(symbolic, "tail")


def test_the_slider_cranks_rows_are_the_textbooks():
    (loop,) = symbolic_loops(load_robot("linkages/slider-crank", symbolic=True))
    crank, rod = sympy.symbols("crank rod", real=True)
    q = loop.symbols
    block = dict(zip(loop.couplings, (list(loop.network_block[:, k]) for k in range(4)), strict=True))
    turned = q["crank"] + q["crank_pin"]
    sin, cos = sympy.sin, sympy.cos
    assert block["slider"] == [0, 0, 0, -1, 0, 0]
    y = crank * sin(q["crank"]) + rod * sin(turned)
    x = crank * cos(q["crank"]) + rod * cos(turned)
    assert [sympy.expand(e) for e in block["piston_pin"]] == [0, 0, 1, y, -x, 0]
    assert loop.fk is None
    assert loop.jacobian is None


@pytest.mark.parametrize("name", ["four-bar", "slider-crank", "rssr"])
def test_the_symbolic_loop_equals_the_numeric_network_matrix(name):
    robot = load_robot(f"linkages/{name}")
    (loop,) = symbolic_loops(load_robot(f"linkages/{name}", symbolic=True))
    mechanism = sk.closed_mechanism(robot)
    state = sk.home(robot)
    N = sk.network_matrix(mechanism, state)[:, [mechanism.position[c] for c in loop.couplings]]
    np.testing.assert_allclose(
        evaluated(loop.network_block, numbers_for(robot, loop, state.q)), N, atol=1e-12
    )


def test_formulas_with_inverse_functions_keep_their_names():
    """A parameter that comes from arcsines of others is told by its name, not by what it is made of."""
    text = """
    [robot]
    name = "bar"
    base_link = "base"
    base = "fixed"
    [parameters]
    a = 0.1
    b = 0.2
    beta = "2*asin(a/b)"
    half = "a/2"
    [[link]]
    name = "base"
    mass = 0
    [[link]]
    name = "bar"
    mass = 0
    [[joint]]
    name = "pin"
    parent = "base"
    child = "bar"
    type = "revolute"
    s = [0, "-sin(beta)", "cos(beta)"]
    s0 = [0, 0, 0]
    [[limb]]
    name = "arm"
    kind = "arm"
    link = "bar"
    tip = "hand"
    frame = { xyz = ["half + b", 0, 0] }
    """
    arm = symbolic_limb(parse_robot(text, symbolic=True), "arm")
    a, b, beta = sympy.symbols("a b beta", real=True)
    q = arm.symbols["pin"]
    assert list(arm.jacobian[:3, 0]) == [0, -sympy.sin(beta), sympy.cos(beta)]
    x, y, z = arm.fk[:3, 3]
    assert sympy.expand(x - (a / 2 + b) * sympy.cos(q)) == 0
    assert sympy.expand(y - (a / 2 + b) * sympy.sin(q) * sympy.cos(beta)) == 0
    assert sympy.expand(z - (a / 2 + b) * sympy.sin(q) * sympy.sin(beta)) == 0


def test_a_table_without_limbs_and_loops_has_nothing_to_write_down():
    text = """
    [robot]
    name = "bar"
    base_link = "base"
    base = "fixed"
    [[link]]
    name = "base"
    mass = 0
    [[link]]
    name = "bar"
    mass = 0
    [[joint]]
    name = "pin"
    parent = "base"
    child = "bar"
    type = "helical"
    s = [0, 0.6, 0.8]
    s0 = [0.5, 0, 0]
    pitch = 0.25
    """
    bar = parse_robot(text)
    with pytest.raises(InputError, match="bar has neither limbs nor closures"):
        symbolic_loops(bar)
    (row,) = screw_rows(bar)
    assert (row.joint, row.type, row.pitch) == ("pin", "helical", 0.25)
    assert list(row.moment) == pytest.approx([0, -0.4, 0.3])
    assert spaced(screw_table(bar).splitlines()[1]) == (
        "pin helical (0, 0.6, 0.8) (0.5, 0, 0) 0.25 (0, -0.4, 0.3)"
    )


def test_the_text_table_aligns_its_columns_and_keeps_parameters(symbolic, bioloid):
    lines = screw_table(symbolic).splitlines()
    assert len(lines) == 19
    starts = {line.index("revolute") for line in lines[1:]}
    assert starts == {lines[0].index("type")}
    knee = next(line for line in lines if line.startswith("right_knee"))
    assert spaced(knee) == "right_knee revolute (0, 1, 0) (0, -hip_y, -thigh) 0 (thigh, 0, 0)"
    knee = next(line for line in screw_table(bioloid).splitlines() if line.startswith("right_knee"))
    assert "(0, -0.042165, -0.0773829)" in knee


def test_a_prismatic_joint_has_infinite_pitch_and_no_moment():
    slider = screw_table(load_robot("linkages/slider-crank")).splitlines()[-1]
    assert slider.split()[:2] == ["slider", "prismatic"]
    assert slider.split()[-2:] == ["inf", "-"]


def test_the_markdown_table_has_as_many_cells_in_every_row(symbolic):
    lines = screw_table(symbolic, "markdown").splitlines()
    assert {line.count("|") for line in lines} == {7}
    assert set(lines[1]) <= set("|-")
    assert r"$(0, - \mathrm{hip\_y}, - \mathrm{thigh})$" in lines[5]


def test_the_latex_table_is_balanced_and_escaped(symbolic):
    text = screw_table(symbolic, "latex")
    assert text.startswith(r"\begin{tabular}{llllll}")
    assert text.endswith(r"\end{tabular}")
    assert text.count("{") == text.count("}")
    assert r"right\_knee" in text
    assert not re.search(r"(?<!\\)_(?![0{])", text), "an underscore outside mathematics"


def test_the_printed_leg_reads_as_in_a_textbook(symbolic):
    text = print_symbolic(symbolic)
    assert "x axis  (c1*c345 - s1*s2*s345, c1*s2*s345 + c345*s1, -c2*s345)" in text
    assert "q4 = right_knee" in text
    assert "right_foot.ry      omega = (0, -crx, -srx)  v = (crx*z - srx*y, srx*x, -crx*x)" in text
    assert "waist.rx           omega = (1, 0, 0)  v = (0, 0, 0)" in text
    assert not re.search(r"\b1\.0|sin\(|cos\(|q_right", text)


@pytest.mark.parametrize("style", ["markdown", "latex"])
def test_the_printed_arm_is_sound_markup(symbolic, style):
    text = print_symbolic(symbolic, "right_arm", style)
    assert text.count("$") % 2 == 0
    assert text.count("{") == text.count("}")
    assert r"\mathrm{c}_{1}" in text
    assert "~" not in text


def test_a_linkage_is_printed_by_its_loops():
    text = print_symbolic(load_robot("linkages/four-bar", symbolic=True))
    assert "crank_pin   omega = (0, 0, 1)  v = (crank*s1, -crank*c1, 0)" in text
    assert "Pose" not in text


@pytest.mark.parametrize("function", [screw_table, print_symbolic])
def test_an_unknown_style_is_refused_and_the_valid_ones_are_listed(symbolic, function):
    with pytest.raises(InputError, match="unknown style 'html'; valid: text, markdown, latex"):
        function(symbolic, style="html")
