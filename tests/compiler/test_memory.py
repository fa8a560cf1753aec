"""Memory of results serves again only when nobody holds a result, a view or a buffer of it."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from screwkin.compiler import memory
from screwkin.compiler.memory import results

SHAPES = [(4, 4), (3,), ()]
pytestmark = pytest.mark.skipif(not memory._COUNTED, reason="references are not counted")


def address(array: np.ndarray) -> int:
    return array.__array_interface__["data"][0]


def test_results_are_separate_contiguous_arrays() -> None:
    for batch in [(1,), (3, 5), (700,), (20, 100)]:
        arrays = results(batch, SHAPES)
        for k, (array, shape) in enumerate(zip(arrays, SHAPES, strict=True)):
            assert array.shape == batch + shape
            assert array.flags.c_contiguous
            assert array.flags.writeable
            array[...] = k
        assert all((array == k).all() for k, array in enumerate(arrays))


def test_memory_that_nobody_holds_serves_again() -> None:
    first = address(results((1000,), SHAPES)[0])
    assert address(results((1000,), SHAPES)[0]) == first


HOLDERS = [
    lambda arrays: arrays,
    lambda arrays: arrays[1],
    lambda arrays: arrays[0][5:6, :1],
    lambda arrays: arrays[2].T.reshape(10, -1)[::2],
    lambda arrays: memoryview(arrays[0]),
    lambda arrays: np.frombuffer(arrays[0], dtype=np.uint8),
    lambda arrays: arrays[0].base,
    lambda arrays: arrays[0].flat,
    lambda arrays: np.asarray(memoryview(arrays[1])),
    lambda arrays: np.broadcast_to(arrays[2], (2, 1000)),
    lambda arrays: {"deep": [(arrays[0].ctypes,)]},
]


@pytest.mark.parametrize("hold", HOLDERS)
def test_memory_that_anything_refers_to_is_not_used_again(hold) -> None:
    arrays = results((1000,), SHAPES)
    begin, end = address(arrays[0].base), address(arrays[0].base) + arrays[0].base.nbytes
    held = hold(arrays)
    del arrays
    for _ in range(10):
        for array in results((1000,), SHAPES):
            assert not begin <= address(array) < end
    del held


def test_random_results_stay_as_they_were_for_as_long_as_they_are_held() -> None:
    rng = np.random.default_rng(0)
    held: list[tuple[np.ndarray, np.ndarray]] = []
    for number in range(600):
        count = int(rng.choice([600, 1000, 1200]))
        for array in results((count,), SHAPES):
            array[...] = number + rng.random()
            if rng.random() < 0.3:
                part = array[rng.integers(0, count) :: 7]
                held.append((part, part.copy()))
        rng.shuffle(held)
        del held[rng.integers(0, 12) :]
        for part, copy in held:
            np.testing.assert_array_equal(part, copy)


def test_threads_never_share_memory() -> None:
    wrong: list[int] = []

    def work(k: int) -> None:
        for n in range(300):
            arrays = results((800,), SHAPES)
            for array in arrays:
                array[...] = 1000 * k + n
            if any((array != 1000 * k + n).any() for array in arrays):
                wrong.append(k)

    threads = [threading.Thread(target=work, args=(k,)) for k in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


def test_little_is_remembered() -> None:
    for count in range(1000, 1020):
        results((count,), SHAPES)
    assert len(memory._remembered) <= memory.BLOCKS
    results((memory.TO,), SHAPES)
    assert sum(cell[0].size for cell in memory._remembered.values()) <= memory.TO
