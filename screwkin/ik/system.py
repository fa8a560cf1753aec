"""Limbs that are solved together, as one system of equations: their targets, joints, limits and residual."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.errors import InputError
from screwkin.kinematics import limits
from screwkin.kinematics.serial_chain import SerialChain, residual


@dataclass(frozen=True, eq=False)
class System:
    """Chains with a target each, expressed in the base frame; joints that several chains share stand once.

    Attributes:
        chains: one or more.
        targets: for each, tip poses (B, 4, 4) or positions (B, 3).
    """

    chains: Sequence[SerialChain]
    targets: Sequence[Array]

    @cached_property
    def joints(self) -> tuple[int, ...]:
        """Indices of the joints in the robot's q; of a single chain in its own order."""
        return tuple(dict.fromkeys(i for chain in self.chains for i in chain.joints))

    @cached_property
    def columns(self) -> list[list[int]]:
        """For every chain, where its joints stand among ``joints``."""
        place = {joint: k for k, joint in enumerate(self.joints)}
        return [[place[i] for i in chain.joints] for chain in self.chains]

    @cached_property
    def length(self) -> float:
        """Size of the largest limb [m]."""
        return max(chain.length for chain in self.chains)

    @cached_property
    def lower(self) -> Array:
        """Limits (n,) [rad or m]."""
        return self._of_joints("lower")

    @cached_property
    def upper(self) -> Array:
        """Limits (n,) [rad or m]."""
        return self._of_joints("upper")

    @cached_property
    def turning(self) -> Array:
        """(n,) bool, False for joints whose positions are not wrapped."""
        return self._of_joints("turning")

    def _of_joints(self, name: str) -> Array:
        values = np.concatenate([getattr(chain, name) for chain in self.chains])
        places = [k for columns in self.columns for k in columns]
        whole = np.empty(len(self.joints), dtype=values.dtype)
        whole[places] = values
        return whole

    @cached_property
    def slices(self) -> list[slice]:
        """For every chain, its rows in the residual."""
        ends = np.cumsum([0] + [3 if target.ndim == 2 else 6 for target in self.targets])
        return [slice(a, b) for a, b in zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True)]

    @cached_property
    def weights(self) -> Array:
        """One for angles, the inverse of the limbs' size for lengths."""
        rows = [np.r_[np.ones(s.stop - s.start - 3), np.full(3, 1 / self.length)] for s in self.slices]
        return np.concatenate(rows)

    def part(self, samples: Array) -> System:
        """The same limbs with some of the targets."""
        return System(self.chains, [target[samples] for target in self.targets])

    def residual(self, x: Array, samples: Array) -> tuple[Array, Array]:
        """Residual (A, m) [rad and m] of x (A, n) for some samples, and its Jacobian (A, m, n)."""
        if len(self.chains) == 1:
            return residual(self.chains[0], x, self.targets[0][samples])
        r = np.zeros((len(x), self.slices[-1].stop))
        J = np.zeros((*r.shape, len(self.joints)))
        for chain, target, rows, columns in zip(
            self.chains, self.targets, self.slices, self.columns, strict=True
        ):
            r[:, rows], own = residual(chain, x[:, columns], target[samples])
            J[:, rows, columns] = own
        return r, J

    def within(self, x: Array) -> Array:
        """(B,) bool: every joint is inside its limits."""
        return limits.within(x, self.lower, self.upper)

    def wrapped(self, x: Array) -> Array:
        """The same positions, angles in (-pi, pi] or one turn off where only that is in the limits."""
        return limits.wrapped(x, self.lower, self.upper, self.turning)


def checked_free(free: Sequence[str]) -> tuple[str, ...]:
    """Rotations of a tip that are free, each named once.

    Raises:
        InputError: others than ``rx ry rz``, or one twice.
    """
    names = (free,) if isinstance(free, str) else tuple(free)
    if len(set(names)) < len(names) or not set(names) <= {"rx", "ry", "rz"}:
        raise InputError(f"free rotations {', '.join(map(str, names))}; valid: rx, ry, rz, each once")
    return names


def refuse_free_in_jax(free: Sequence[str] | Mapping[str, Sequence[str]]) -> None:
    """Raise InputError where rotations are free and arrays are JAX's."""
    if free:
        raise InputError("free rotations of tips are for NumPy arrays; give NumPy arrays, or whole poses")
