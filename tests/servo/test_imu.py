"""The serial protocol of an IMU: frames against bytes by hand, and whatever else comes over the line."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from screwkin.algebra.arrays import Array
from screwkin.servo.imu import SIZE, STEP, Imu, imu_frame, imu_frames
from screwkin.servo.virtual.bus import SimulatedClock
from screwkin.servo.virtual.imu import PERIOD, VirtualImu

angles = st.tuples(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))


class Bytes:
    """A line over which these bytes come, a few at a time."""

    def __init__(self, data: bytes, most: int = 7) -> None:
        self.data, self.most = data, most

    def read(self, size: int) -> bytes:
        part, self.data = self.data[: min(size, self.most)], self.data[min(size, self.most) :]
        return part

    def write(self, data: bytes) -> int:
        return len(data)

    def reset_input_buffer(self) -> None: ...

    def close(self) -> None: ...


def test_a_frame_is_the_one_of_the_data_sheet() -> None:
    """Index 222, yaw 0.01, pitch -1.1, roll 25.66 degrees: bytes by hand, accelerations 0."""
    body = bytes([0xDE, 0x01, 0x00, 0x92, 0xFF, 0x06, 0x0A]) + bytes(9)
    frame = b"\xaa\xaa" + body + bytes([sum(body) % 256])
    assert imu_frame(222, *np.deg2rad([0.01, -1.10, 25.66])) == frame
    (seen,), rest = imu_frames(frame)
    assert seen == pytest.approx((222, *np.deg2rad([0.01, -1.10, 25.66])))
    assert rest == b""


@given(
    turns=st.lists(angles, min_size=1, max_size=4),
    noise=st.lists(st.binary(max_size=30), min_size=4, max_size=4),
)
def test_sound_frames_are_read_among_noise(
    turns: list[tuple[float, float, float]], noise: list[bytes]
) -> None:
    """Noise that holds no head of a frame of its own changes nothing, wherever the line is cut."""
    parts = [part.replace(b"\xaa", b"\x00") for part in noise]
    data = b"".join(
        part + imu_frame(k, *turn) for k, (turn, part) in enumerate(zip(turns, parts, strict=False))
    )
    seen, rest = [], b""
    for k in range(0, len(data), 5):
        frames, rest = imu_frames(rest + data[k : k + 5])
        seen += frames
    assert [frame[0] for frame in seen] == list(range(len(turns)))
    np.testing.assert_allclose([frame[1:] for frame in seen], turns, atol=0.51 * STEP)


@given(data=st.binary(max_size=400))
def test_whatever_comes_is_read_without_an_error_and_forgotten(data: bytes) -> None:
    frames, rest = imu_frames(data)
    assert len(frames) <= len(data) // SIZE
    assert len(rest) < len(data) + 1
    assert imu_frames(rest)[0] == []


@given(turn=angles, bit=st.integers(0, 8 * (SIZE - 3) - 1))
def test_a_frame_with_a_wrong_bit_is_none(turn: tuple[float, float, float], bit: int) -> None:
    data = bytearray(imu_frame(3, *turn))
    data[2 + bit // 8] ^= 1 << bit % 8
    assert imu_frames(bytes(data))[0] == []


@given(turn=angles)
def test_the_newest_attitude_is_that_of_its_angles(turn: tuple[float, float, float]) -> None:
    """Yaw, pitch and roll about the axes of the base in turn: against SciPy."""
    clock = SimulatedClock(4.0)
    imu = Imu(Bytes(imu_frame(0, 0.1, 0.2, 0.3) + imu_frame(1, *turn)), clock)
    reading = imu.poll()
    assert reading is not None
    assert (reading.index, reading.time) == (1, 4.0)
    np.testing.assert_allclose(reading.attitude, Rotation.from_euler("ZYX", turn).as_matrix(), atol=3e-4)


def test_a_virtual_imu_writes_every_cycle_and_a_silent_one_nothing() -> None:
    clock, R = SimulatedClock(), Rotation.from_euler("ZYX", [2.0, -0.1, 0.2]).as_matrix()
    says: list[Array | None] = [R]
    attitude: Callable[[], Array | None] = lambda: says[0]  # noqa: E731
    imu = Imu(VirtualImu(clock, attitude), clock)
    for k in range(5):
        reading = imu.poll()
        assert reading is not None
        assert reading.index == k
        np.testing.assert_allclose(reading.attitude, R, atol=3e-4)
        clock.sleep(PERIOD)
    says[0] = None
    silent = imu.poll()
    assert silent is not None
    assert silent.index == 4
    assert math.isclose(silent.time, 4 * PERIOD)
    blank = Imu(Bytes(b""), clock)
    assert blank.poll() is None
