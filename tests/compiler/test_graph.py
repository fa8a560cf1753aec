"""Graph scalars: what is folded, shared and refused, against the same formulas on numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from screwkin.algebra import scalar
from screwkin.algebra.se3 import Twist, Vector, exp, leaves, log
from screwkin.compiler.emit_python import run_numpy
from screwkin.compiler.graph import Graph
from screwkin.compiler.program import Recorder
from tests.strategies import twists


def values(make, *numbers):
    """What a program made by ``make(nodes)`` gives for these inputs."""
    recorder = Recorder("f", "")
    recorder.output("y", make(*recorder.input("x", len(numbers))))
    program = recorder.program()
    out = np.empty((1, len(program.results)))
    run_numpy(program, [np.array([numbers], dtype=float)], [out])
    return out[0], program


def test_equal_expressions_are_one_node_in_either_order():
    a, b = (Graph().input("a"), None)
    b = a.graph.input("b")
    assert (a * b).index == (b * a).index
    assert (a + b).index == (b + a).index
    assert ((a - b) * 2.0).index == ((a - b) * 2.0).index


def test_structure_folds_to_python_numbers():
    a = Graph().input("a")
    assert a * 0 == 0
    assert a - a == 0
    assert a / a == 1
    assert (a * 1) is a
    assert (a + 0.0) is a
    assert (0.5 * (a * 4.0)).index == (a * 2.0).index


def test_signs_are_carried_outwards_and_shared():
    a, b = (lambda g: (g.input("a"), g.input("b")))(Graph())
    assert ((-a) * b).index == (-(a * b)).index
    assert ((-a) * (-b)).index == (a * b).index
    assert (b - a).index == (-(a - b)).index
    assert (a - (-b)).index == (a + b).index
    minus = -a
    assert (-minus).index == a.index
    assert scalar.sin(-a).index == (-scalar.sin(a)).index
    assert scalar.cos(-a).index == scalar.cos(a).index


def test_a_number_is_never_taken_for_the_node_of_that_index():
    recorder = Recorder("f", "")
    a, b = recorder.input("x", 2)
    recorder.output("y", [a * 1.5, b * 0.5, a * b, b + 1.0, a + b])
    program = recorder.program()
    out = np.empty((1, 5))
    run_numpy(program, [np.array([[3.0, 7.0]])], [out])
    np.testing.assert_array_equal(out[0], [4.5, 3.5, 21.0, 8.0, 10.0])


def test_divisions_by_one_scalar_share_its_reciprocal():
    _, program = values(lambda a, b, c: [a / c, b / c, 2.0 / c], 1, 2, 3)
    assert program.counts["rcp"] == 1


@given(st.tuples(*[st.floats(-2, 2)] * 4))
def test_sines_of_sums_of_angles_of_points_are_algebra(numbers):
    def make(a, b, c, d):
        x = scalar.atan2(a, b) - scalar.atan2(c, d)
        y = scalar.where(a > b, x, -scalar.atan2(a, 1.0))
        return [scalar.sin(x), scalar.cos(x), scalar.sin(y), scalar.cos(y)]

    numbers = tuple(x + 0.0 for x in numbers)  # the sign of a zero gives the origin no direction
    found, program = values(make, *numbers)
    assert not program.counts.keys() & {"sin", "cos"}
    a, b, c, d = numbers
    x = math.atan2(a, b) - math.atan2(c, d)
    y = x if a > b else -math.atan2(a, 1.0)
    # Squares of what is below 1e-154 underflow: such a point counts as the origin.
    if all(math.hypot(*p) > 1e-150 or math.hypot(*p) == 0 for p in ((a, b), (c, d))):
        expected = [math.sin(x), math.cos(x), math.sin(y), math.cos(y)]
        np.testing.assert_allclose(found, expected, atol=1e-15)


@given(twists)
def test_exponential_and_logarithm_run_on_the_graph_near_zero_and_far_from_it(twist):
    def make(*x):
        pose = exp(Twist(Vector(*x[:3]), Vector(*x[3:])))
        return [*leaves(pose), *leaves(log(pose))]

    numbers = [float(x) for x in leaves(twist)]
    found, _ = values(make, *numbers)
    pose = exp(Twist(Vector(*numbers[:3]), Vector(*numbers[3:])))
    np.testing.assert_allclose(found[:12], leaves(pose), atol=1e-14)
    if math.hypot(*numbers[:3]) < math.pi - 1e-3:
        np.testing.assert_allclose(found[12:], numbers, atol=1e-9)


def test_what_no_output_needs_is_left_out():
    _, program = values(lambda a, b: [(a * b) * 0 + a], 1, 2)
    assert program.operations == 0
    assert program.results == (0,)


def test_a_condition_on_a_graph_scalar_and_odd_powers_are_refused():
    a = Graph().input("a")
    with pytest.raises(TypeError, match="where"):
        bool(a > 0)
    with pytest.raises(TypeError, match="whole powers"):
        a**0


def test_an_output_of_the_wrong_size_is_refused():
    recorder = Recorder("f", "")
    with pytest.raises(ValueError, match="2 scalars do not fill"):
        recorder.output("y", recorder.input("x", 2), 3)
