"""An inertial measurement unit on a serial line: the attitude of a robot's base, a hundred times a second.

The frames are those of the BNO080 and BNO085 in their mode UART-RVC (115,200 bits per second, 100 Hz): two
bytes 0xAA, an index that counts on, yaw, pitch and roll as 16-bit numbers of 0.01 degree, the least
significant byte first, three accelerations, three bytes of other use, and the sum of all between.
The base turns by yaw about its z axis, then by pitch about its own y axis, then by roll about its own x axis.
Source: CEVA, BNO080/085 data sheet, 1.3.5.2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import X, Y, Z, as_array, rotate
from screwkin.servo.line import ByteLine, Clock

BAUD = 115_200
"""Bits per second."""
HEAD = b"\xaa\xaa"
SIZE = 19
"""Bytes of a frame."""
STEP = math.radians(0.01)
"""Of an angle."""


@dataclass(frozen=True, eq=False)
class ImuReading:
    """One frame: its index, the attitude (3, 3) of the base, any heading, and when it was read [s]."""

    index: int
    attitude: Array
    time: float


def imu_frame(index: int, yaw: float, pitch: float, roll: float) -> bytes:
    """The frame of an attitude, angles in rad."""
    angles = b"".join(round(angle / STEP).to_bytes(2, "little", signed=True) for angle in (yaw, pitch, roll))
    body = bytes([index % 256]) + angles + bytes(9)
    return HEAD + body + bytes([sum(body) % 256])


def imu_frames(data: bytes) -> tuple[list[tuple[int, float, float, float]], bytes]:
    """Sound frames as index, yaw, pitch, roll [rad], and the bytes after them, perhaps of one to come."""
    frames, start = [], 0
    while (at := data.find(HEAD, start)) >= 0 and at + SIZE <= len(data):
        body = data[at + len(HEAD) : at + SIZE - 1]
        if sum(body) % 256 != data[at + SIZE - 1]:
            start = at + 1
            continue
        yaw, pitch, roll = (STEP * int.from_bytes(body[k : k + 2], "little", signed=True) for k in (1, 3, 5))
        frames.append((body[0], yaw, pitch, roll))
        start = at + SIZE
    rest = data[at:] if at >= 0 else data[start:][-1:] if data[start:].endswith(HEAD[:1]) else b""
    return frames, rest


class Imu:
    """The newest attitude from a line; it never waits.

    Args:
        line: that the unit writes on.
        clock: what readings are dated by.
    """

    def __init__(self, line: ByteLine, clock: Clock) -> None:
        self._line, self._clock, self._rest = line, clock, b""
        self.newest: ImuReading | None = None

    def poll(self) -> ImuReading | None:
        """What has arrived last, None before anything has.

        Raises:
            OSError: the cable was pulled.
        """
        while data := self._line.read(4096):
            frames, self._rest = imu_frames(self._rest + data)
            if frames:
                index, yaw, pitch, roll = frames[-1]
                turn = rotate(Z, yaw) @ rotate(Y, pitch) @ rotate(X, roll)
                self.newest = ImuReading(index, as_array(turn), self._clock.now())
        return self.newest

    def close(self) -> None:
        """Give the line back."""
        self._line.close()
