"""Builtins around compiled programs compute what programs compute, and leave alone whatever is not plain."""

from __future__ import annotations

import gc
import sys
import threading
from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.compiler import calls, native
from screwkin.compiler.run import machine_code, run
from screwkin.dynamics.quantities import inverse_dynamics
from screwkin.kinematics.body import center_of_mass
from tests.kinematics.machines import random_state, random_tree

pytestmark = pytest.mark.skipif(
    not native.compiler() or not calls.possible(), reason="no C compiler, or no builtins"
)
ROBOT = sk.load_robot("bioloid")
DOOR = center_of_mass.definition.door(ROBOT, ("T_world_base", "q"), ())
LIMIT = 1e-6


def empty(batch: tuple[int, ...]):
    return (np.empty((*batch, 3)),)


@pytest.fixture(scope="module")
def call():
    return machine_code(DOOR.guarded).checked(LIMIT, empty)


def plain(batch: tuple[int, ...], seed: int = 0):
    state = random_state(ROBOT, seed, batch)
    return np.ascontiguousarray(state.T_world_base), np.ascontiguousarray(state.q)


@pytest.mark.parametrize("batch", [(), (1,), (2,), (7,), (3, 5), (255,), (513,), (9000,), (2, 1, 4100)])
def test_a_builtin_computes_what_the_program_computes(call, batch) -> None:
    """Alone, in blocks, and shared among threads."""
    T, q = plain(batch)
    (found,) = call(T, q)
    expected = run(DOOR.program, {"T_world_base": T, "q": q}, path="numpy")["center_of_mass"]
    assert found.shape == (*batch, 3)
    np.testing.assert_allclose(found, expected, atol=1e-14)


@pytest.mark.parametrize("batch", [(1,), (2, 3), (600,), (9000,)])
@pytest.mark.parametrize("alone", [0, 1])
def test_one_sample_of_an_input_serves_a_batch_of_the_others(call, batch, alone: int) -> None:
    """Alone, in blocks, and shared among threads: the same bits as repeated arrays give."""
    arrays = list(plain(batch))
    arrays[alone] = plain(())[alone]
    repeated = [
        np.ascontiguousarray(np.broadcast_to(a, (*batch, *a.shape[-axes:])))
        for a, axes in zip(arrays, (2, 1), strict=True)
    ]
    np.testing.assert_array_equal(call(*arrays)[0], call(*repeated)[0])
    arrays[alone] = arrays[alone] * np.nan
    assert call(*arrays) is None


@pytest.mark.parametrize("cores", [1, 2, 3, 7, 100])
def test_any_number_of_cores_gives_the_same_bits(cores: int) -> None:
    compiled = machine_code(DOOR.guarded)
    T, q = plain((8200,))
    (alone,) = replace(compiled, cores=1).checked(LIMIT, empty)(T, q)
    shared = replace(compiled, cores=cores).checked(LIMIT, empty)
    np.testing.assert_array_equal(shared(T, q)[0], alone)
    q[8199, 0] = np.nan
    assert shared(T, q) is None


class Subclass(np.ndarray):
    pass


def foreign(T, q, rng):
    """Arrays of which something is not plain."""
    return [
        (T,),
        (T, q, q),
        (q, T),
        (T, None),
        (T, q.tolist()),
        (T.tolist(), q),
        (T, 1.0),
        (T, memoryview(q)),
        (T, q.astype(np.float32)),
        (T, q.astype(complex)),
        (T, q.astype(">f8")),
        (T, q.astype(np.int64)),
        (T, q.astype(object)),
        (T, q[..., :-1]),
        (T, np.concatenate([q, q], axis=-1)[..., ::2]),
        (T, q[..., ::-1]),
        (T, q.view(Subclass)),
        (np.asfortranarray(T), q) if T.ndim == 2 else (T[::-1], q),
        (np.swapaxes(T, -1, -2), q),
        (T[None], np.stack([q, q])),
        (T[None], q) if T.ndim > 2 else (T[None], q[None, None]),
        (T[:0] if T.ndim > 2 else T[None][:0], q),
        (T, q * np.nan),
        (T, q * np.inf),
        (2 * T, q),
        (T, np.frombuffer(b"\0" * (q.nbytes + 1), dtype=np.uint8)[1:].view(float).reshape(q.shape)),
        (T, np.array(3.0)),
        (T, np.zeros((1,) * 20)),
    ]


@pytest.mark.parametrize("batch", [(), (4,), (2, 3)])
def test_whatever_is_not_plain_is_left_to_the_general_way(call, batch) -> None:
    T, q = plain(batch)
    for arrays in foreign(T, q, np.random.default_rng(0)):
        assert call(*arrays) is None
    assert call() is None
    with pytest.raises(TypeError):
        call(T, q=q)


def test_random_arrays_are_computed_or_refused(call) -> None:
    """Shapes, orders and kinds at random: the answer is right, or there is none."""
    rng = np.random.default_rng(1)
    answered = 0
    for _ in range(2000):
        batches = [tuple(rng.integers(0, 4, rng.integers(0, 3))) for _ in range(2)]
        if rng.random() < 0.6:
            batches[1] = batches[0]
        arrays = []
        for batch, inner in zip(batches, [(4, 4), (len(ROBOT.joints),)], strict=True):
            value = np.broadcast_to(np.eye(4) if len(inner) == 2 else 0.1, (*batch, *inner))
            value = value.astype(rng.choice(["f8", "f4", "i8", ">f8"], p=[0.85, 0.05, 0.05, 0.05]))
            if rng.random() < 0.1:
                value = np.asfortranarray(value)
            if rng.random() < 0.1:
                value = value[..., ::-1]
            if rng.random() < 0.2:
                value.flags.writeable = False
            arrays.append(value)
        found = call(*arrays)
        batch, fit = batches[0] or batches[1], batches[0] == batches[1] or () in batches
        whole = all(a.dtype == float and a.dtype.isnative and a.flags.c_contiguous for a in arrays)
        if found is not None:
            answered += 1
            assert whole
            assert fit
            assert 0 not in batch
            assert found[0].shape == (*batch, 3)
        else:
            assert not whole or not fit or 0 in batch
    assert answered > 200


def test_read_only_arrays_are_read_and_never_written(call) -> None:
    T, q = plain((3,))
    T.flags.writeable = q.flags.writeable = False
    before = q.copy()
    assert call(T, q) is not None
    np.testing.assert_array_equal(q, before)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda batch: (),
        lambda batch: (np.empty((*batch, 3)), np.empty(batch)),
        lambda batch: (np.empty((*batch, 2)),),
        lambda batch: (np.empty((*batch, 3), dtype=np.float32),),
        lambda batch: (np.empty((*batch, 6))[..., ::2],),
        lambda batch: (np.broadcast_to(0.0, (*batch, 3)),),
        lambda batch: (None,),
    ],
)
def test_results_are_only_written_where_they_fit(wrong) -> None:
    assert machine_code(DOOR.guarded).checked(LIMIT, wrong)(*plain((5,))) is None


def test_errors_of_allocation_pass_through() -> None:
    def full(batch):
        raise MemoryError("no room")

    with pytest.raises(MemoryError, match="no room"):
        machine_code(DOOR.guarded).checked(LIMIT, full)(*plain((5,)))


def test_a_number_may_be_a_float() -> None:
    definition, robot = inverse_dynamics.definition, random_tree(0)
    door = definition.door(robot, definition.inputs(robot, ("gravity",)), (None,))
    shapes = [group.shape for group in door.program.inputs]
    arrays = [np.eye(4) if s == (4, 4) else 9.81 if s == () else np.full(s, 0.1) for s in shapes]
    call = machine_code(door.guarded).checked(LIMIT, lambda batch: None)
    expected = run(door.program, dict(zip((g.name for g in door.program.inputs), arrays, strict=True)))
    (found,) = call(*arrays)
    np.testing.assert_allclose(found, expected[door.program.outputs[0].name], atol=1e-12)


def test_calls_leave_no_references_and_no_garbage(call) -> None:
    """10,000 calls of each kind neither leak nor need the collector."""
    T, q = plain(())
    several = plain((3,))
    bad = (T, q * np.nan)
    call(T, q)
    gc.collect()
    gc.disable()
    before = [sys.getrefcount(x) for x in (T, q, None, np.empty, np.ndarray, float)]
    try:
        for _ in range(10_000):
            call(T, q), call(*several), call(*bad), call(T)
        after = [sys.getrefcount(x) for x in (T, q, None, np.empty, np.ndarray, float)]
        assert gc.collect() < 100
    finally:
        gc.enable()
    assert all(abs(a - b) < 50 for a, b in zip(after, before, strict=True))


def test_many_threads_call_at_once(call) -> None:
    inputs = [plain((300 + k,), k) for k in range(8)]
    expected = [call(*arrays)[0] for arrays in inputs]
    wrong: list[int] = []

    def work(k: int) -> None:
        for _ in range(50):
            if not np.array_equal(call(*inputs[k])[0], expected[k]):
                wrong.append(k)

    threads = [threading.Thread(target=work, args=(k,)) for k in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


def test_without_builtins_ctypes_computes_the_same(monkeypatch, call) -> None:
    T, q = plain((20,))
    monkeypatch.setattr(calls, "possible", lambda: False)
    native._builtins.cache_clear()
    try:
        compiled = native.compiled(DOOR.guarded)
        assert compiled.checked(LIMIT, empty)(T, q) is None
        outputs = [np.empty((20, 3)), np.empty((20, 1))]
        compiled([T.reshape(20, 16), q], outputs)
        np.testing.assert_array_equal(outputs[0], call(T, q)[0])
    finally:
        native._builtins.cache_clear()


def test_the_operations_of_a_batch_decide_when_cores_share_a_batch() -> None:
    samples = native.shared_from(DOOR.guarded)
    assert samples * DOOR.guarded.operations >= native.SHARED_FROM
    assert (samples - 1) * DOOR.guarded.operations < native.SHARED_FROM
