"""Vectors, rotations and poses as small frozen records of scalars; exponential and logarithm of SE(3).

Components are scalars of any kind (see ``algebra.scalar``): with arrays in them a record is a whole batch.
Only ``as_array`` and the ``*_from_array`` functions know about array layout.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from typing import Any, TypeVar, dataclass_transform

import numpy as np

from screwkin.algebra import scalar
from screwkin.algebra.pytrees import register_with_jax, remember
from screwkin.algebra.scalar import Scalar, is_jax, is_symbolic, minus, over, plus, times

R = TypeVar("R")


@dataclass_transform(frozen_default=True, eq_default=False)
def record(cls: type[R]) -> type[R]:
    """A frozen dataclass that NumPy leaves alone in operators and that is a JAX pytree."""
    frozen = dataclass(frozen=True, eq=False)(cls)
    frozen.__array_ufunc__ = None  # type: ignore[attr-defined]
    remember(frozen)
    return frozen


def leaves(value: Any) -> list[Scalar]:
    """All scalars of a record, in order."""
    if hasattr(value, "__dataclass_fields__"):
        return [leaf for f in fields(value) for leaf in leaves(getattr(value, f.name))]
    return [value]


def map_scalars(function: Callable[[Scalar], Scalar], value: Any) -> Any:
    """The same record with ``function`` applied to every scalar."""
    if hasattr(value, "__dataclass_fields__"):
        return type(value)(*(map_scalars(function, getattr(value, f.name)) for f in fields(value)))
    return function(value)


@record
class Vector:
    """A free vector or a point: components x, y, z [m, or as the context says]."""

    x: Scalar
    y: Scalar
    z: Scalar

    def __iter__(self) -> Iterator[Scalar]:
        return iter((self.x, self.y, self.z))

    def __add__(self, other: Vector) -> Vector:
        return Vector(plus(self.x, other.x), plus(self.y, other.y), plus(self.z, other.z))

    def __sub__(self, other: Vector) -> Vector:
        return Vector(minus(self.x, other.x), minus(self.y, other.y), minus(self.z, other.z))

    def __neg__(self) -> Vector:
        return Vector(-self.x, -self.y, -self.z)

    def __mul__(self, factor: Scalar) -> Vector:
        return Vector(times(self.x, factor), times(self.y, factor), times(self.z, factor))

    __rmul__ = __mul__

    def __truediv__(self, divisor: Scalar) -> Vector:
        return Vector(over(self.x, divisor), over(self.y, divisor), over(self.z, divisor))


ZERO = Vector(0, 0, 0)
X, Y, Z = Vector(1, 0, 0), Vector(0, 1, 0), Vector(0, 0, 1)


def dot(a: Vector, b: Vector) -> Scalar:
    """Scalar product."""
    return plus(plus(times(a.x, b.x), times(a.y, b.y)), times(a.z, b.z))


def cross(a: Vector, b: Vector) -> Vector:
    """Vector product a x b."""
    return Vector(
        minus(times(a.y, b.z), times(a.z, b.y)),
        minus(times(a.z, b.x), times(a.x, b.z)),
        minus(times(a.x, b.y), times(a.y, b.x)),
    )


def norm(a: Vector) -> Scalar:
    """Euclidean length."""
    return scalar.sqrt(dot(a, a))


@record
class Rotation:
    """A rotation by its columns: where it takes the three axes."""

    x: Vector
    y: Vector
    z: Vector

    def __matmul__(self, other: Any) -> Any:
        if isinstance(other, Vector):
            return self.x * other.x + self.y * other.y + self.z * other.z
        return Rotation(self @ other.x, self @ other.y, self @ other.z)

    @property
    def T(self) -> Rotation:
        """The inverse rotation."""
        rows = zip(self.x, self.y, self.z, strict=True)
        return Rotation(*(Vector(*row) for row in rows))


UNTURNED = Rotation(X, Y, Z)


@record
class Pose:
    """A rigid displacement, or the pose of a frame: ``T_a_b @ p_b`` gives the point in a coordinates."""

    R: Rotation
    p: Vector

    def __matmul__(self, other: Any) -> Any:
        if isinstance(other, Vector):
            return self.R @ other + self.p
        return Pose(self.R @ other.R, self @ other.p)

    @property
    def inverse(self) -> Pose:
        """The inverse displacement."""
        back = self.R.T
        return Pose(back, -(back @ self.p))


IDENTITY = Pose(UNTURNED, ZERO)


@record
class Twist:
    """Angular velocity and velocity of the point at the origin: [omega; v], in rad/s and m/s."""

    omega: Vector
    v: Vector

    def __add__(self, other: Twist) -> Twist:
        return Twist(self.omega + other.omega, self.v + other.v)

    def __sub__(self, other: Twist) -> Twist:
        return Twist(self.omega - other.omega, self.v - other.v)

    def __neg__(self) -> Twist:
        return Twist(-self.omega, -self.v)

    def __mul__(self, factor: Scalar) -> Twist:
        return Twist(self.omega * factor, self.v * factor)

    __rmul__ = __mul__

    def __truediv__(self, divisor: Scalar) -> Twist:
        return Twist(self.omega / divisor, self.v / divisor)


NO_TWIST = Twist(ZERO, ZERO)


def bracket(a: Twist, b: Twist) -> Twist:
    """Lie bracket (adjoint action) of a on b: the rate of b when it is carried along by a."""
    return Twist(cross(a.omega, b.omega), cross(a.omega, b.v) + cross(a.v, b.omega))


def rotate(s: Vector, theta: Scalar) -> Rotation:
    """Rotation by theta [rad] about the unit vector s (Rodrigues)."""
    c, n = scalar.cos(theta), scalar.sin(theta)
    versine = minus(1, c)

    def stay(a: Scalar) -> Scalar:
        square = times(a, a)
        return plus(square, times(minus(1, square), c))

    def mixed(a: Scalar, b: Scalar, other: Scalar, sign: int) -> Scalar:
        return plus(times(times(a, b), versine), times(sign, times(other, n)))

    x, y, z = s
    return Rotation(
        Vector(stay(x), mixed(x, y, z, 1), mixed(x, z, y, -1)),
        Vector(mixed(x, y, z, -1), stay(y), mixed(y, z, x, 1)),
        Vector(mixed(x, z, y, 1), mixed(y, z, x, -1), stay(z)),
    )


def rotation_exp(w: Vector) -> Rotation:
    """Rotation by the rotation vector w [rad]; smooth everywhere, w = 0 included."""
    t2 = dot(w, w)
    a, b = scalar.sinc(t2), scalar.cosc(t2)

    def turn(e: Vector) -> Vector:
        once = cross(w, e)
        return e + once * a + cross(w, once) * b

    return Rotation(turn(X), turn(Y), turn(Z))


def rotation_log(rotation: Rotation) -> Vector:
    """Rotation vector w [rad], |w| in [0, pi]; exact near 0 and near pi.

    Works through the quaternion whose largest component is computed first (Shepperd 1978); for symbols the
    branch of small rotations is taken, valid for |w| < pi.
    """
    w, v = unit_quaternion(rotation)
    n2 = dot(v, v)
    if is_symbolic(n2):
        return v * (2 * scalar.atanc(n2 / (w * w)) / w)
    fine = n2 < 0.05
    slope = 2 * scalar.atanc(scalar.where(fine, n2, 0.0) / scalar.where(fine, w * w, 1.0))
    n = scalar.sqrt(scalar.where(fine, 1.0, n2))
    return v * scalar.where(fine, slope / scalar.where(fine, w, 1.0), 2 * scalar.atan2(n, w) / n)


def unit_quaternion(rotation: Rotation) -> tuple[Scalar, Vector]:
    """Unit quaternion (w, v) with w >= 0, each component computed without cancellation.

    For symbols it is not unit, which saves roots: the logarithm needs only the ratio of v to w.
    """
    (xx, yx, zx), (xy, yy, zy), (xz, yz, zz) = rotation.x, rotation.y, rotation.z
    skew = Vector(zy - yz, xz - zx, yx - xy)
    q0 = (1 + xx + yy + zz, *skew)
    if is_symbolic(q0[0]):
        return q0[0], skew
    candidates = (
        q0,
        (skew.x, 1 + xx - yy - zz, xy + yx, xz + zx),
        (skew.y, xy + yx, 1 - xx + yy - zz, yz + zy),
        (skew.z, xz + zx, yz + zy, 1 - xx - yy + zz),
    )
    best, size = candidates[0], candidates[0][0]  # candidate i is 4 q_i q, and its entry i is 4 q_i^2
    for i in (1, 2, 3):
        larger = candidates[i][i] > size
        size = scalar.where(larger, candidates[i][i], size)
        best = tuple(scalar.where(larger, b, a) for a, b in zip(best, candidates[i], strict=True))
    length = scalar.sqrt(sum(b * b for b in best))
    flip = scalar.where(best[0] < 0, -1.0, 1.0) / length
    return best[0] * flip, Vector(*(b * flip for b in best[1:]))


def exp(twist: Twist) -> Pose:
    """Rigid displacement reached after unit time with a constant twist [omega; v]."""
    w, v = twist.omega, twist.v
    t2 = dot(w, w)
    once = cross(w, v)
    p = v + once * scalar.cosc(t2) + cross(w, once) * scalar.sinc3(t2)
    return Pose(rotation_exp(w), p)


def log(pose: Pose) -> Twist:
    """Twist whose exponential is the pose; rotation angle in [0, pi]."""
    w = rotation_log(pose.R)
    t2 = dot(w, w)
    # V^-1 p with V = 1 + cosc [w] + sinc3 [w]^2; the coefficient of [w]^2 is (1 - sinc / (2 cosc)) / t2.
    once = cross(w, pose.p)
    return Twist(w, pose.p - once / 2 + cross(w, once) * scalar.vlog(t2))


def unstack(array: Any) -> list[Scalar]:
    """The scalars along the last axis of an array: floats for a single vector, batches otherwise."""
    if is_jax(array):
        import jax.numpy as jnp

        register_with_jax()
        return list(jnp.moveaxis(array, -1, 0))
    array = np.asarray(array)
    if array.ndim == 1 and array.dtype != object:
        return list(array.tolist())
    return list(np.ascontiguousarray(np.moveaxis(array, -1, 0)))


def vector_from_array(array: Any) -> Vector:
    """(..., 3) to a Vector."""
    return Vector(*unstack(array))


def rotation_from_array(array: Any) -> Rotation:
    """(..., 3, 3) to a Rotation."""
    return Rotation(*(Vector(*unstack(array[..., :, i])) for i in range(3)))


def pose_from_array(array: Any) -> Pose:
    """(..., 4, 4) to a Pose."""
    return Pose(rotation_from_array(array[..., :3, :3]), vector_from_array(array[..., :3, 3]))


def twist_from_array(array: Any) -> Twist:
    """(..., 6) to a Twist, [omega; v]."""
    c = unstack(array)
    return Twist(Vector(*c[:3]), Vector(*c[3:]))


def as_array(value: Any, batch: tuple[int, ...] = ()) -> Any:
    """A record, or a sequence of them, as one array with the batch in front.

    Vector (..., 3), Rotation (..., 3, 3), Pose (..., 4, 4), Twist (..., 6); a sequence of k items puts k
    before these. NumPy scalars give NumPy, JAX gives JAX, symbols give an object array. ``batch`` is the
    least batch shape, for records that hold structure only.
    """
    nested = _nested(value)
    flat = _flatten(nested)
    shape = _shape(nested)
    if any(is_jax(x) for x in flat):
        import jax.numpy as jnp

        batch = np.broadcast_shapes(batch, *(np.shape(x) for x in flat))
        stacked = jnp.stack([jnp.broadcast_to(x, batch) for x in flat], axis=-1)
        return stacked.reshape(*stacked.shape[:-1], *shape)
    if any(is_symbolic(x) for x in flat):
        return np.array(flat, dtype=object).reshape(shape)
    batch = np.broadcast_shapes(batch, *(np.shape(x) for x in flat))
    out = np.empty((*batch, len(flat)))
    for i, x in enumerate(flat):
        out[..., i] = x
    return out.reshape(*batch, *shape)


def _nested(value: Any) -> Any:
    if isinstance(value, Pose):
        rows = [[*row, p] for row, p in zip(_nested(value.R), value.p, strict=True)]
        return [*rows, [0, 0, 0, 1]]
    if isinstance(value, Rotation):
        return [list(row) for row in zip(value.x, value.y, value.z, strict=True)]
    if isinstance(value, Vector):
        return list(value)
    if isinstance(value, list | tuple):
        return [_nested(item) for item in value]
    if hasattr(value, "__dataclass_fields__"):
        return leaves(value)
    return value


def _flatten(nested: Any) -> list[Scalar]:
    return [leaf for item in nested for leaf in _flatten(item)] if isinstance(nested, list) else [nested]


def _shape(nested: Any) -> tuple[int, ...]:
    if not isinstance(nested, list):
        return ()
    return (len(nested), *(_shape(nested[0]) if nested else ()))
