"""One formula, any scalar: the same functions take floats, batches, gradients and symbols.

Floats are the reference. A batch must be its samples; derivatives through ``jit(vmap(grad))`` must be those
that sympy takes from the symbolic result of the very same function; symbols with numbers put in must be the
floats.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pytest
import sympy

import screwkin as sk
from screwkin.algebra.screws import INFINITE, Screw, displacement
from screwkin.algebra.se3 import IDENTITY, Vector, leaves, rotate
from screwkin.kinematics.mass import mass_center, mass_center_velocities
from screwkin.kinematics.positions import joint_twists, link_displacements, pose_in_base
from screwkin.mechanism.network import coupling_twists, network_blocks
from screwkin.model.table import load_robot, parse_robot
from tests.kinematics.machines import random_tree

SAMPLES = 6


@dataclass(frozen=True)
class Formula:
    """A function from scalars to a list of scalars, and how many it takes."""

    name: str
    arity: int
    function: Callable[[Sequence[Any]], list[Any]]


def scalars(records: Any) -> list[Any]:
    """All components of a record, or of a sequence of records."""
    return [x for r in (records if isinstance(records, list | tuple) else [records]) for x in leaves(r)]


@cache
def leg():
    """The right leg of the humanoid alone, standing on a fixed pelvis."""
    from screwkin.mechanism.symbolic import limb_alone

    return limb_alone(load_robot("bioloid"), "right_leg")


@cache
def leg_mechanism():
    return sk.closed_mechanism(leg())


def tilted_screws(x: Sequence[Any]) -> list[Any]:
    axis = Vector(0.6, 0, 0.8)
    kinds = [Screw(axis, Vector(0.1, -0.2, 0), h) for h in (0, 0.3, INFINITE)]
    return scalars([displacement(screw, x[0]) for screw in kinds])


def axis_itself(x: Sequence[Any]) -> list[Any]:
    """A displacement whose axis, place and pitch vary too."""
    axis = rotate(Vector(0, 1, 0), x[0]) @ Vector(0, 0, 1)
    return scalars(displacement(Screw(axis, Vector(x[1], 0, x[2]), x[3]), x[4]))


def tip_of_leg(q: Sequence[Any]) -> list[Any]:
    return scalars(pose_in_base(leg(), link_displacements(leg(), q), "right_foot"))


def links_of_tree(q: Sequence[Any]) -> list[Any]:
    return scalars(link_displacements(random_tree(2, joints=4), q))


def jacobian_of_leg(q: Sequence[Any]) -> list[Any]:
    return scalars(joint_twists(leg(), link_displacements(leg(), q)))


def com_of_leg(q: Sequence[Any]) -> list[Any]:
    D = link_displacements(leg(), q)
    return scalars([mass_center(leg(), D), *mass_center_velocities(leg(), D, joint_twists(leg(), D))])


def network_block_of_leg(q: Sequence[Any]) -> list[Any]:
    (row,) = network_blocks(leg_mechanism(), coupling_twists(leg_mechanism(), IDENTITY, q))
    return scalars(list(row))


FORMULAS = [
    Formula("displacement", 1, tilted_screws),
    Formula("displacement about a moving axis", 5, axis_itself),
    Formula("link displacements", 4, links_of_tree),
    Formula("frame pose", 6, tip_of_leg),
    Formula("Jacobian", 6, jacobian_of_leg),
    Formula("centre of mass", 6, com_of_leg),
    Formula("network block", 6, network_block_of_leg),
]


def inputs(formula: Formula) -> np.ndarray:
    return np.random.default_rng(len(formula.name)).uniform(-0.7, 0.7, (SAMPLES, formula.arity))


@cache
def by_floats(formula: Formula) -> np.ndarray:
    rows = [formula.function([float(x) for x in sample]) for sample in inputs(formula)]
    assert all(isinstance(x, float | int) for row in rows for x in row), "floats stay floats"
    return np.array(rows, dtype=float)


@cache
def in_symbols(formula: Formula) -> tuple[list[Any], list[Any]]:
    symbols = list(sympy.symbols(f"x:{formula.arity}", real=True))
    return symbols, formula.function(symbols)


def numbers_from(symbols: list[Any], expressions: list[Any], values: np.ndarray) -> np.ndarray:
    function = sympy.lambdify(symbols, expressions, "math", cse=True)
    return np.array([function(*row) for row in values.tolist()], dtype=float)


@pytest.mark.parametrize("formula", FORMULAS, ids=lambda f: f.name)
def test_a_batch_is_its_samples(formula):
    columns = list(inputs(formula).T.copy())
    found = [np.broadcast_to(x, (SAMPLES,)) for x in formula.function(columns)]
    np.testing.assert_allclose(np.stack(found, axis=1), by_floats(formula), atol=1e-14)


@pytest.mark.parametrize("formula", FORMULAS, ids=lambda f: f.name)
def test_symbols_with_numbers_put_in_are_the_floats(formula):
    symbols, expressions = in_symbols(formula)
    assert any(sympy.sympify(e).free_symbols for e in expressions)
    np.testing.assert_allclose(
        numbers_from(symbols, expressions, inputs(formula)), by_floats(formula), atol=1e-12
    )


@pytest.mark.parametrize("formula", FORMULAS, ids=lambda f: f.name)
def test_gradients_of_a_jitted_batch_are_the_derivatives_of_the_symbols(x64, formula):
    """One number of all results, by weights: its gradient meets every component."""
    import jax
    import jax.numpy as jnp

    weights = np.cos(np.arange(by_floats(formula).shape[1]))

    def weighted(x):
        return sum(w * c for w, c in zip(weights.tolist(), formula.function(list(x)), strict=True))

    both = jax.jit(jax.vmap(jax.value_and_grad(weighted)))
    value, gradient = both(jnp.asarray(inputs(formula)))
    assert gradient.dtype == np.float64
    np.testing.assert_allclose(value, by_floats(formula) @ weights, atol=1e-12)

    symbols, expressions = in_symbols(formula)
    total = sum(w * sympy.sympify(e) for w, e in zip(weights.tolist(), expressions, strict=True))
    slopes = numbers_from(symbols, [total.diff(s) for s in symbols], inputs(formula))
    np.testing.assert_allclose(gradient, slopes, atol=1e-11)


def test_parameters_are_scalars_too():
    """The leg of the symbolic table, all lengths symbols, is the numeric leg at the table's numbers."""
    robot = load_robot("bioloid")
    twin = parse_robot(robot.text, symbolic=True)
    q = np.random.default_rng(0).uniform(-1, 1, 18).tolist()
    names = [name for name, value in robot.parameters.items() if value is not None]
    tip = scalars(pose_in_base(twin, link_displacements(twin, q), "right_foot"))
    com = scalars(mass_center(twin, link_displacements(twin, q)))
    symbols = [sympy.Symbol(name, real=True) for name in names]
    found = numbers_from(symbols, tip + com, np.array([[robot.parameters[name] for name in names]]))[0]
    D = link_displacements(robot, q)
    wanted = scalars(pose_in_base(robot, D, "right_foot")) + scalars(mass_center(robot, D))
    np.testing.assert_allclose(found, wanted, atol=1e-14)


def test_a_gradient_by_a_length_of_the_robot_is_that_of_the_symbols(x64):
    """Design sensitivity: the height of the foot by the length of the thigh, for a batch of postures."""
    import jax
    import jax.numpy as jnp

    from screwkin.kinematics.positions import successive_displacement

    hinge = Vector(0, 1, 0)

    def height(thigh, hip, knee):
        screws = [Screw(hinge, Vector(0, 0, 0)), Screw(hinge, Vector(0, 0, -thigh))]
        return (successive_displacement(screws, [hip, knee]) @ Vector(0, 0, -thigh - 0.08)).z

    angles = np.random.default_rng(1).uniform(-1, 1, (SAMPLES, 2))
    slope = jax.jit(jax.vmap(jax.grad(height), in_axes=(None, 0, 0)))
    thigh, hip, knee = sympy.symbols("thigh hip knee", real=True)
    symbolic = sympy.lambdify((thigh, hip, knee), height(thigh, hip, knee).diff(thigh), "numpy")
    found = slope(jnp.asarray(0.077), *jnp.asarray(angles.T))
    np.testing.assert_allclose(found, symbolic(0.077, *angles.T), atol=1e-14)
