"""Inverse kinematics in JAX: solved outside, differentiated by the implicit function theorem.

The solvers are iterations and branches over NumPy arrays, called back from a traced function. Their
derivative needs neither: joints follow a moving target by the (pseudo)inverse of the limbs' Jacobian.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from screwkin.algebra.pattern import components
from screwkin.algebra.pytrees import register_with_jax
from screwkin.algebra.screws import at
from screwkin.algebra.se3 import as_array, unstack
from screwkin.ik import methods as limbs
from screwkin.ik import whole_body as poses
from screwkin.ik.numeric import IkSettings
from screwkin.ik.pose_solution import PoseSolution
from screwkin.ik.solutions import LimbSolutions
from screwkin.kinematics.arrays import checked, exact_target, one_batch
from screwkin.kinematics.serial_chain import SerialChain, forward
from screwkin.model.robot import Robot
from screwkin.model.state import State

CUT = 1e-10
"""Singular values below this share of the largest are dropped: a singular limb follows as far as it can."""
LIMB = ("q", "valid", "in_limits", "residual", "iterations")
Values = tuple[Any, ...]


def limb_in_jax(
    chain: SerialChain,
    target: Any,
    method: limbs.Method,
    guess: Any,
    settings: IkSettings,
    least_squares: bool,
) -> LimbSolutions:
    """As ``limb_ik``, for JAX arrays, perhaps traced."""
    register_with_jax()
    inner = (poses.axes_of(target), 1)
    target = checked("T_base_tip", target, *((4, 4) if inner[0] == 2 else (3,)))
    guess = checked("guess", guess, len(chain.names))
    batch = one_batch({"T_base_tip": (target, inner[0]), "guess": (guess, 1)})
    shapes = (target.shape[target.ndim - inner[0] :], guess.shape[-1:])

    def solve(target: Any, guess: Any) -> LimbSolutions:
        return limbs.solve_limb_arrays(chain, target, method, guess, settings, least_squares)

    def values(*inputs: Any) -> Values:
        solutions = solve(*map(np.asarray, inputs))
        return tuple(getattr(solutions, name) for name in LIMB)

    def rates(inputs: Values, moved: Values, outputs: Values) -> list[Any]:
        q, real = jnp.nan_to_num(outputs[0]), jnp.isfinite(outputs[0])
        J = _jacobian(chain, q)[..., -3 * inner[0] :, :]
        return [jnp.where(real, _followed(J, _tip_rates(inputs[0], moved[0])[..., None, :]), 0.0)]

    empty = solve(*(np.zeros((0, *shape)) for shape in shapes))
    examples = [getattr(empty, name) for name in LIMB]
    outputs = _called(values, examples, rates, inner)(*_broadcast((target, guess), shapes, batch))
    return LimbSolutions(
        chain.limb, chain.names, empty.method, **dict(zip(LIMB, outputs, strict=True)), chain=chain
    )


def pose_in_jax(
    robot: Robot,
    targets: Mapping[str, Any],
    guess: Any,
    batch: tuple[int, ...],
    method: poses.Method,
    settings: IkSettings,
) -> PoseSolution:
    """As ``solve_pose``, for JAX arrays, perhaps traced, that broadcast to a batch."""
    register_with_jax()
    names = list(targets)
    inner = (*(poses.axes_of(targets[name]) for name in names), 1)
    given = (*targets.values(), guess)
    shapes = tuple(x.shape[x.ndim - axes :] for x, axes in zip(given, inner, strict=True))

    def solve(*inputs: Any) -> PoseSolution:
        *tips, q = map(np.asarray, inputs)
        wanted = {name: exact_target(f"targets[{name!r}]", x) for name, x in zip(names, tips, strict=True)}
        return poses.solve_whole_body(robot, wanted, q, q.shape[:-1], method, settings)

    def values(*inputs: Any) -> Values:
        solution = solve(*inputs)
        return (solution.state.q, *(getattr(solution, name) for name in poses.COUNTED))

    def rates(inputs: Values, moved: Values, outputs: Values) -> list[Any]:
        tips = dict(zip(names, zip(inputs, moved, strict=True), strict=False))
        return [_pose_rates(robot, tips, outputs[0], moved[-1])]

    examples = list(values(*(np.zeros((0, *shape)) for shape in shapes)))
    flat = _broadcast(given, shapes, batch)
    q, *counts = _called(values, examples, rates, inner)(*flat)
    limb_names = tuple(robot.limb(name).name for name in names if name != "base")
    return PoseSolution(State(flat[names.index("base")], q), limb_names, *counts)


def _broadcast(
    arrays: Sequence[Any], shapes: Sequence[tuple[int, ...]], batch: tuple[int, ...]
) -> list[Array]:
    return [jnp.broadcast_to(x, (*batch, *shape)) for x, shape in zip(arrays, shapes, strict=True)]


def _called(
    values: Callable[..., Values],
    examples: Sequence[Any],
    rates: Callable[[Values, Values, Values], list[Any]],
    inner: Sequence[int],
) -> Callable[..., Values]:
    """A NumPy function of arrays of one batch, callable from JAX.

    Args:
        values: the function.
        examples: its outputs for an empty batch (0, ...).
        rates: from inputs, their tangents and the outputs to the tangents of the first outputs; those of the
            others are zero.
        inner: axes of every input behind its batch.
    """

    def outside(*inputs: Array) -> Values:
        batch = inputs[0].shape[: inputs[0].ndim - inner[0]]
        results = [jax.ShapeDtypeStruct((*batch, *x.shape[1:]), x.dtype) for x in examples]
        if any(isinstance(x, jax.core.Tracer) for x in inputs):
            return tuple(jax.pure_callback(values, results, *inputs, vmap_method="broadcast_all"))
        return tuple(map(jnp.asarray, values(*inputs)))

    call = jax.custom_jvp(outside)

    @call.defjvp
    def _(inputs: Values, moved: Values) -> tuple[Values, Values]:
        outputs = call(*inputs)
        first = rates(inputs, moved, outputs)
        rest = [_still(x) for x in outputs[len(first) :]]
        return outputs, (*first, *rest)

    return call


def _still(x: Any) -> Any:
    """The zero tangent of an output."""
    real = jnp.issubdtype(x.dtype, jnp.floating)
    return jnp.zeros_like(x) if real else np.zeros(x.shape, dtype=jax.dtypes.float0)


def _jacobian(chain: SerialChain, q: Any) -> Any:
    """Jacobian (..., 6, n) of the tip at q (..., n), rows [omega; v of the tip's origin], base axes."""
    tip, columns = forward(chain.screws, unstack(q), chain.tip)
    rows = [as_array(at(tip.p, column), q.shape[:-1]) for column in columns]
    return jnp.stack([jnp.asarray(row) for row in rows], axis=-1)


def _tip_rates(target: Any, moved: Any) -> Any:
    """Twist (..., 6) or velocity (..., 3) of a target that moves."""
    if poses.axes_of(target) == 1:
        return moved
    spin = moved[..., :3, :3] @ jnp.swapaxes(target[..., :3, :3], -1, -2)
    odd = (spin - jnp.swapaxes(spin, -1, -2)) / 2
    omega = (odd[..., 2, 1], odd[..., 0, 2], odd[..., 1, 0])
    return jnp.stack([*omega, *jnp.moveaxis(moved[..., :3, 3], -1, 0)], axis=-1)


def _followed(J: Any, rates: Any) -> Any:
    """Least joint rates (..., n) that move the tip as wanted."""
    return (jnp.linalg.pinv(J, rtol=CUT) @ rates[..., None])[..., 0]


def _pose_rates(robot: Robot, tips: Mapping[str, tuple[Any, Any]], q: Any, guess_rate: Any) -> Any:
    """Joint rates (..., n) as base and tips move, for given rates of the guess."""
    base = tips["base"]
    chains = {name: SerialChain.of(robot, name) for name in tips if name != "base"}
    rates = dict(enumerate(jnp.moveaxis(guess_rate, -1, 0)))
    shared = np.zeros((len(chains), len(robot.joints)), dtype=np.int64)
    for row, chain in enumerate(chains.values()):
        shared[row, list(chain.joints)] = 1
    for block, joints in components(shared):
        rows, wanted = [], []
        for name in (list(chains)[k] for k in block):
            chain, (target, moved) = chains[name], tips[name]
            here, rate = jax.jvp(_in_base, (base[0], target), (base[1], moved))
            wanted.append(_tip_rates(here, rate))
            own = _jacobian(chain, q[..., list(chain.joints)])[..., -wanted[-1].shape[-1] :, :]
            columns = dict(zip(chain.joints, jnp.moveaxis(own, -1, 0), strict=True))
            still = jnp.zeros(own.shape[:-1])
            rows.append(jnp.stack([columns.get(i, still) for i in joints], axis=-1))
        solved = _followed(jnp.concatenate(rows, axis=-2), jnp.concatenate(wanted, axis=-1))
        rates |= dict(zip(joints, jnp.moveaxis(solved, -1, 0), strict=True))
    return jnp.stack([rates[i] for i in range(len(robot.joints))], axis=-1)


def _in_base(T: Any, target: Any) -> Any:
    """A world target in the frame of the base."""
    back = jnp.swapaxes(T[..., :3, :3], -1, -2)
    if poses.axes_of(target) == 1:
        return (back @ (target - T[..., :3, 3])[..., None])[..., 0]
    turned, p = back @ target[..., :3, :3], back @ (target[..., :3, 3] - T[..., :3, 3])[..., None]
    return jnp.concatenate([jnp.concatenate([turned, p], axis=-1), target[..., 3:, :]], axis=-2)
