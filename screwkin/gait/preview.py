"""ZMP preview control of a cart-table: a CoM motion whose ZMP follows a reference known ahead.

The cart is driven by its jerk u, constant over each sampling period. Its state x is position, velocity and
acceleration of the CoM, its output the ZMP p = c - (z/g) c''. The controller minimises the sum of
Qe (p - reference)^2 + Qx |dx|^2 + R du^2 with the summed error as an additional state, and looks ``horizon``
seconds ahead.
Source: Kajita et al. (2003); Katayama et al. (1985).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.errors import InputError
from screwkin.kinematics.mass import GRAVITY


@dataclass(frozen=True, eq=False)
class PreviewGains:
    """Gains of the law u(k) = -Ks sum(p - reference) - Kx x(k) - sum over j of G(j) reference(k + j).

    Attributes:
        Ks: of the summed ZMP error.
        Kx: (3,) of position, velocity and acceleration.
        G: (n,) of the reference 1 .. n samples ahead.
        A: (3, 3) transition of the cart over one period.
        B: (3,) effect of the jerk.
        C: (3,) ZMP of a state.
    """

    Ks: float
    Kx: Array
    G: Array
    A: Array
    B: Array
    C: Array


def preview_gains(
    period: float, com_height: float, horizon: float, Qe: float = 1.0, Qx: float = 0.0, R: float = 1e-6
) -> PreviewGains:
    """Gains by the discrete Riccati equation.

    Args:
        period: of sampling [s].
        com_height: height of the CoM above the floor, constant [m].
        horizon: how far the controller looks ahead [s], at least one period.
        Qe: weight of the ZMP error.
        Qx: weight of the changes of the state.
        R: weight of the changes of the jerk.

    Raises:
        InputError: a value out of its range.
    """
    from scipy.linalg import solve_discrete_are

    for name, value, least in (("period", period, 0.0), ("com_height", com_height, 0.0), ("R", R, 0.0)):
        if not (np.isfinite(value) and value > least):
            raise InputError(f"{name} is {value!r}; expected a number above 0")
    count = round(horizon / period) if np.isfinite(horizon) else 0
    if count < 1:
        raise InputError(f"horizon is {horizon!r} s; expected at least one sampling period of {period:g} s")
    h = period
    A = np.array([[1.0, h, h * h / 2], [0.0, 1.0, h], [0.0, 0.0, 1.0]])
    B = np.array([h**3 / 6, h * h / 2, h])
    C = np.array([1.0, 0.0, -com_height / GRAVITY])
    # Error sum and increments of the state: (e, dx).
    grown = np.block([[np.ones((1, 1)), (C @ A)[None]], [np.zeros((3, 1)), A]])
    driven = np.concatenate([[C @ B], B])[:, None]
    weight = np.diag([Qe, Qx, Qx, Qx])
    P = solve_discrete_are(grown, driven, weight, np.array([[R]]))
    scale = 1.0 / (R + (driven.T @ P @ driven).item())
    K = scale * (driven.T @ P @ grown)[0]
    closed = grown - driven @ K[None]
    G = np.empty(count)
    G[0] = -K[0]
    ahead = -closed.T @ P @ np.array([1.0, 0.0, 0.0, 0.0])
    for j in range(1, count):
        G[j] = scale * (driven.T @ ahead).item()
        ahead = closed.T @ ahead
    return PreviewGains(float(K[0]), K[1:], G, A, B, C)


@dataclass(frozen=True, eq=False)
class CartMotion:
    """Motion of the cart over T samples in k directions: com, velocity, acceleration, zmp (T, k)."""

    com: Array
    velocity: Array
    acceleration: Array
    zmp: Array


def follow_reference(gains: PreviewGains, reference: Array) -> CartMotion:
    """CoM motion that lets the ZMP follow a reference (T, k), starting at rest over its first value [m].

    Beyond its end the reference stays at its last value.

    Args:
        gains: from ``preview_gains``.
        reference: wanted ZMP (T, 2) [m].
    """
    first = reference[0]
    wanted = np.concatenate([reference, np.repeat(reference[-1:], len(gains.G), axis=0)]) - first
    states = np.zeros((len(reference), 3, reference.shape[1]))
    x, error = states[0], np.zeros(reference.shape[1])
    for k in range(len(reference) - 1):
        error = error + gains.C @ x - wanted[k]
        jerk = -gains.Ks * error - gains.Kx @ x - gains.G @ wanted[k + 1 : k + 1 + len(gains.G)]
        x = gains.A @ x + gains.B[:, None] * jerk
        states[k + 1] = x
    zmp = np.einsum("i,tik->tk", gains.C, states) + first
    return CartMotion(states[:, 0] + first, states[:, 1], states[:, 2], zmp)
