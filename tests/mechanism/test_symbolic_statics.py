"""Closed forms of linkages' statics against numbers and against the textbook."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

import screwkin as sk
from screwkin.errors import InputError, SingularError, UnknownNameError
from screwkin.mechanism.actions import action_system, assembled_actions, unit_actions
from screwkin.mechanism.symbolic_statics import symbolic_statics
from screwkin.model.table import load_robot


def substituted(expression, solution, robot, q, load):
    values = {solution.symbols[name]: float(x) for name, x in zip(robot.joint_names, q, strict=True)}
    values |= {sympy.Symbol(name, real=True): float(x) for name, x in robot.parameters.items()}
    return float(expression.subs(values | {solution.load: load}))


def test_the_four_bar_has_the_textbook_s_torque():
    """crank / load = - a sin(q2) / (a sin(q2) - g sin(q1 + q2)): the lever arms of the coupler's line."""
    solution = symbolic_statics(load_robot("linkages/four-bar", symbolic=True), "rocker", ["crank"])
    a, g = sympy.symbols("crank ground", real=True)
    q1, q2 = solution.symbols["crank"], solution.symbols["crank_pin"]
    wanted = -a * solution.load * sympy.sin(q2) / (a * sympy.sin(q2) - g * sympy.sin(q1 + q2))
    assert sympy.simplify(solution.efforts["crank"] - wanted) == 0


@pytest.mark.parametrize(("name", "loaded"), [("four-bar", "rocker"), ("slider-crank", "slider")])
def test_closed_forms_are_the_numbers_of_statics_all_round(name, loaded):
    solution = symbolic_statics(load_robot(f"linkages/{name}", symbolic=True), loaded, ["crank"])
    robot = load_robot(f"linkages/{name}")
    mechanism, state = sk.closed_mechanism(robot), sk.home(robot)
    for angle in np.linspace(state.q[0], state.q[0] + 1.2, 4):
        state = sk.close_loops(mechanism, state, {"crank": angle}).state
        forces = sk.static_forces(mechanism, state, {loaded: 7.0})
        found = substituted(solution.efforts["crank"], solution, robot, state.q, 7.0)
        assert found == pytest.approx(float(forces["crank"]), rel=1e-9)
        wrench = [substituted(x, solution, robot, state.q, 7.0) for x in solution.wrenches["loop"]]
        decided = np.array([2, 3, 4])  # m_z, f_x, f_y: the plane's own
        pin = forces.wrench("crank_pin")[decided]
        np.testing.assert_allclose(np.abs(np.array(wrench)[decided]), np.abs(pin), atol=1e-9)


def test_the_action_matrix_in_symbols_is_the_one_in_numbers():
    symbolic, robot = load_robot("linkages/four-bar", symbolic=True), load_robot("linkages/four-bar")
    from screwkin.algebra.se3 import IDENTITY
    from screwkin.mechanism.mechanism import unchosen

    mechanism = sk.closed_mechanism(robot)
    home, system = sk.home(robot), action_system(mechanism, ["crank", "rocker"])
    q = sympy.symbols("q:4", real=True)
    columns = unit_actions.formula(unchosen(symbolic), IDENTITY, q, system.active, ())
    A = assembled_actions(system, np.array(columns, dtype=object).T)
    values = dict(zip(q, map(float, home.q), strict=True))
    values |= {sympy.Symbol(name, real=True): float(x) for name, x in robot.parameters.items()}
    number = np.vectorize(lambda x: float(sympy.sympify(x).subs(values)))(A)
    wanted = sk.action_matrix(mechanism, home, ["crank", "rocker"])
    np.testing.assert_allclose(number, wanted, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "loaded", "active", "error", "message"),
    [
        ("four-bar", "nose", ["crank"], UnknownNameError, "unknown joint 'nose'"),
        ("four-bar", "rocker", [], SingularError, "4 couplings have given efforts, but only 3 of them are"),
    ],
)
def test_what_has_no_closed_form_is_refused(name, loaded, active, error, message):
    with pytest.raises(error, match=message):
        symbolic_statics(load_robot(f"linkages/{name}", symbolic=True), loaded, active)


def test_a_humanoid_is_refused():
    with pytest.raises(InputError, match="has limbs; symbolic statics are those of linkages without"):
        symbolic_statics(load_robot("bioloid", symbolic=True), "right_knee", ["left_knee"])
