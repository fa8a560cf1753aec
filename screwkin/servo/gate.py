"""The gate: the one way by which goals reach servos, and what lies beyond the limits does not pass.

Positions are refused beyond the joint's limits or the servo's range, steps that are too fast are refused, and
speed and torque limits are rounded to the safe side. What is about to be written is checked once more, as
the numbers that the registers will hold, in the one function that writes.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from screwkin.algebra.arrays import Array
from screwkin.errors import SafetyError
from screwkin.kinematics.limits import limited_joints
from screwkin.model.robot import Robot
from screwkin.servo.profiles import Profile, Register
from screwkin.servo.servo_map import ServoMap

Ticks = NDArray[np.int64]

_ROUNDING = 1e-6  # ticks: a posture may lie on a limit, up to rounding
_SPEED_ROUNDING = 1e-6  # share of the limit


class Writer(Protocol):
    """What the gate needs of a bus."""

    def sync_write(self, address: int, length: int, data: Mapping[int, bytes]) -> None:
        """Write bytes at one address of several servos."""


@dataclass(frozen=True, eq=False)
class Bounds:
    """What may be written to each of n servos, in the order of the robot's joints with motors.

    profiles, names, ids (n,); scale (n,) [rad per tick, signed], zero (n,) [ticks]: q = scale (tick - zero);
    lower, upper (n,): ends of the positions [ticks, exact]; rate (n,) [rad/s]; speed and torque (n,): the
    greatest values of their registers.
    """

    names: tuple[str, ...]
    ids: tuple[int, ...]
    profiles: tuple[Profile, ...]
    scale: Array
    zero: Array
    lower: Array
    upper: Array
    rate: Array
    speed: Ticks
    torque: Ticks

    @classmethod
    def of(cls, robot: Robot, servos: ServoMap | None = None, torque: float = 1.0) -> Bounds:
        """The narrower of what the robot's table and the servos' profiles allow.

        Args:
            robot: its joints' limits.
            servos: of the robot; by default as its table has them.
            torque: greatest share of each joint's torque that is allowed, 0 to 1.

        Raises:
            SafetyError: torque is no share, or a joint has no room left to move.
        """
        if not 0.0 <= torque <= 1.0:
            raise SafetyError(f"torque limit {torque!r} is not a share of the servo's; expected 0 to 1")
        mounted = (servos or ServoMap.of(robot)).joints
        profiles = tuple(servo.profile for servo in mounted)
        scale = np.array([servo.direction * servo.profile.tick for servo in mounted])
        zero = np.array([servo.profile.centre + servo.zero / servo.profile.tick for servo in mounted])
        limited = {joint.name: joint for joint in limited_joints(robot)}
        joints = [limited[servo.joint] for servo in mounted]
        limits = np.array([[joint.lower, joint.upper] for joint in joints])
        ends = np.sort(limits / scale[:, None] + zero[:, None], axis=1)
        last = np.array([profile.ticks - 1 for profile in profiles])
        lower, upper = np.maximum(ends[:, 0], 0), np.minimum(ends[:, 1], last)
        if not (np.ceil(lower) <= np.floor(upper)).all():
            k = int((np.ceil(lower) > np.floor(upper)).argmax())
            raise SafetyError(f"{joints[k].name}: its limits lie outside the range of servo {mounted[k].id}")
        pairs = list(zip(joints, profiles, strict=True))
        rate = np.array([min(joint.velocity, profile.no_load_speed) for joint, profile in pairs])
        speed = rate / [profile.speed_unit for profile in profiles]
        if not (speed >= 1).all():
            k = int((speed < 1).argmax())
            raise SafetyError(
                f"{joints[k].name}: {rate[k]:.4g} rad/s is less than its servo's smallest speed"
            )
        most = [profile.register("moving_speed").high for profile in profiles]
        share = [torque * min(1.0, joint.effort / profile.stall_torque) for joint, profile in pairs]
        full = [profile.register("torque_limit").high for profile in profiles]
        return cls(
            names=tuple(joint.name for joint in joints),
            ids=tuple(servo.id for servo in mounted),
            profiles=profiles,
            scale=scale,
            zero=zero,
            lower=lower,
            upper=upper,
            rate=rate,
            speed=np.minimum(np.floor(speed + _ROUNDING), most).astype(np.int64),
            torque=np.floor(np.array(share) * full + _ROUNDING).astype(np.int64),
        )

    @cached_property
    def low(self) -> Ticks:
        """Least position (n,) that may be written [ticks]."""
        return np.asarray(np.ceil(self.lower - _ROUNDING), dtype=np.int64)

    @cached_property
    def high(self) -> Ticks:
        """Greatest position (n,) that may be written [ticks]."""
        return np.asarray(np.floor(self.upper + _ROUNDING), dtype=np.int64)

    def ticks(self, q: Array) -> Ticks:
        """Positions [ticks] of joint positions (..., n) [rad]: the nearest, or beside it within the limits.

        Raises:
            SafetyError: NaN, infinity, or beyond a limit; names every such joint.
        """
        q = np.asarray(q, dtype=float)
        if q.shape[-1:] != (len(self.ids),):
            raise SafetyError(f"goals of shape {q.shape} are not of {len(self.ids)} joints")
        with np.errstate(invalid="ignore", over="ignore"):
            exact = q / self.scale + self.zero
            bad = ~((exact >= self.lower - _ROUNDING) & (exact <= self.upper + _ROUNDING))
        if bad.any():
            raise SafetyError("goals beyond limits: " + "; ".join(self._named(q, bad)))
        return np.clip(np.rint(exact), self.low, self.high).astype(np.int64)

    def radians(self, ticks: Any) -> Array:
        """Joint positions (..., n) [rad] of positions [ticks]."""
        return np.asarray((np.asarray(ticks, dtype=float) - self.zero) * self.scale)

    def radians_of(self, k: int, tick: int) -> float:
        """Position [rad] of one joint at a position [ticks]."""
        return float((tick - self.zero[k]) * self.scale[k])

    def within(self, q: Array) -> Array:
        """The nearest joint positions (..., n) [rad] that may be written."""
        return self.radians(np.clip(np.asarray(q) / self.scale + self.zero, self.low, self.high))

    def _named(self, q: Array, bad: NDArray[np.bool_]) -> list[str]:
        rows, wrong = q.reshape(-1, len(self.ids)), bad.reshape(-1, len(self.ids))
        ends = np.sort([self.radians(self.lower), self.radians(self.upper)], axis=0)
        return [
            f"{self.names[k]} (servo {self.ids[k]}) at {rows[wrong[:, k], k][0]:.4f} rad outside "
            f"[{ends[0, k]:.4f}, {ends[1, k]:.4f}]"
            for k in np.flatnonzero(wrong.any(axis=0))
        ]


class Gate:
    """Writes goals, speed and torque limits to servos, or refuses to.

    Args:
        bus: where to.
        bounds: what may be written.
    """

    def __init__(self, bus: Writer, bounds: Bounds) -> None:
        self.bus, self.bounds = bus, bounds
        self._last: Array | None = None

    def goals(self, q: Array, dt: float = math.inf) -> Ticks:
        """Send every servo to its position, at most at its greatest speed; returns positions (n,) [ticks].

        Args:
            q: joint positions (n,) [rad].
            dt: time since the last goals [s]; steps that need more speed than allowed in it are refused.

        Raises:
            SafetyError: beyond a limit of position or speed, NaN or infinity; nothing was written.
        """
        ticks = self.bounds.ticks(q)
        self._check_step(np.asarray(q, dtype=float), dt)
        self._write({"goal_position": ticks, "moving_speed": self.bounds.speed}, range(len(ticks)))
        self._last = np.array(q, dtype=float)
        return ticks

    def stay(self, ticks: Mapping[int, int]) -> dict[int, int]:
        """Goals at measured positions [ticks] by joint index, within limits; returns what was written."""
        chosen = sorted(ticks)
        values = np.array(self.bounds.low)
        for k in chosen:
            values[k] = min(max(int(ticks[k]), int(self.bounds.low[k])), int(self.bounds.high[k]))
        self._write({"goal_position": values, "moving_speed": self.bounds.speed}, chosen)
        if len(chosen) == len(values):
            self._last = self.bounds.radians(values)
        return {k: int(values[k]) for k in chosen}

    def torque_limit(self, share: float = 1.0) -> None:
        """Limit every servo's torque to a share of what the bounds allow.

        Raises:
            SafetyError: no share from 0 to 1.
        """
        if not 0.0 <= share <= 1.0:
            raise SafetyError(f"torque limit {share!r} is not a share; expected 0 to 1")
        values = np.floor(share * self.bounds.torque + _ROUNDING).astype(np.int64)
        self._write({"torque_limit": values}, range(len(values)))

    def torque(self, on: bool, chosen: Sequence[int] | None = None) -> None:
        """Switch the torque of servos, all by default."""
        count = len(self.bounds.ids)
        self._write({"torque_enable": np.full(count, int(on))}, range(count) if chosen is None else chosen)

    def _check_step(self, q: Array, dt: float) -> None:
        if not dt > 0.0:
            raise SafetyError(f"goals follow each other in {dt!r} s; that needs a time above 0")
        if self._last is None or math.isinf(dt):
            return
        rate = np.abs(q - self._last) / dt
        fast = np.flatnonzero(rate > self.bounds.rate * (1 + _SPEED_ROUNDING))
        if len(fast):
            named = [
                f"{self.bounds.names[k]} (servo {self.bounds.ids[k]}) at {rate[k]:.2f} rad/s, "
                f"at most {self.bounds.rate[k]:.2f}"
                for k in fast
            ]
            raise SafetyError("goals too far from the last ones: " + "; ".join(named))

    def _write(self, values: Mapping[str, Ticks], chosen: Sequence[int]) -> None:
        """The only writer of goals: registers that lie side by side go in one packet per servo model."""
        b = self.bounds
        span = {
            "goal_position": (b.low, b.high),
            "moving_speed": (np.ones_like(b.speed), b.speed),
            "torque_limit": (np.zeros_like(b.torque), b.torque),
            "torque_enable": (np.zeros_like(b.torque), np.ones_like(b.torque)),
        }
        for name, column in values.items():
            low, high = span[name]
            wrong = [k for k in chosen if not low[k] <= column[k] <= high[k]]
            if wrong:
                k = wrong[0]
                raise SafetyError(
                    f"{b.names[k]} (servo {b.ids[k]}): {name} {column[k]} is outside {low[k]} to {high[k]}"
                )
        models: dict[str, list[int]] = defaultdict(list)
        for k in chosen:
            models[b.profiles[k].model].append(k)
        for members in models.values():
            profile = b.profiles[members[0]]
            registers = sorted((profile.register(name) for name in values), key=lambda r: r.address)
            self._send(registers, values, members)

    def _send(self, registers: Sequence[Register], values: Mapping[str, Ticks], members: list[int]) -> None:
        start, end = registers[0].address, registers[-1].end
        if sum(register.width for register in registers) != end - start:
            for register in registers:
                self._send([register], values, members)
            return
        self.bus.sync_write(
            start,
            end - start,
            {
                self.bounds.ids[k]: b"".join(
                    int(values[r.name][k]).to_bytes(r.width, "little") for r in registers
                )
                for k in members
            },
        )
