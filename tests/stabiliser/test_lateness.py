"""How late joints follow: against joints that follow late by known times."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from screwkin.algebra.arrays import Array
from screwkin.stabiliser.lateness import LONGEST, SLACK, Lateness, waiting

DT = 0.01
JOINTS = 5


def wanted_by(time: Array, seed: int) -> Array:
    """Smooth positions (K, n) of joints that move as in a walk, each in its own way."""
    rng = np.random.default_rng(seed)
    size, phase = rng.uniform(0.1, 0.4, (2, JOINTS)), rng.uniform(0, 2 * np.pi, (2, JOINTS))
    return np.asarray(
        sum(
            s * np.sin((k + 1) * 9.0 * time[:, None] + p)
            for k, (s, p) in enumerate(zip(size, phase, strict=True))
        )
    )


def followed(wanted: Array, late: Array) -> Array:
    """Positions (K, n) of joints that follow so late (n,) [s], evenly between cycles."""
    time = DT * np.arange(len(wanted))
    return np.stack([np.interp(time - t, time, x) for t, x in zip(late, wanted.T, strict=True)], axis=1)


def learnt(wanted: Array, q: Array) -> Lateness:
    known = Lateness.unknown(wanted.shape[1])
    for k in range(2, len(wanted)):
        known = known.measured(wanted[k - 2 : k + 1], q[k], DT)
    return known


lates = st.lists(st.floats(0.0, 0.03), min_size=JOINTS, max_size=JOINTS).map(np.array)
seeds = st.integers(0, 10**6)


@given(lates, seeds, st.floats(-0.2, 0.2))
def test_joints_are_as_late_as_they_follow_wherever_loads_hold_them(
    late: Array, seed: int, load: float
) -> None:
    wanted = wanted_by(DT * np.arange(600), seed)
    q = followed(wanted, late) + load
    np.testing.assert_allclose(learnt(wanted, q).times, late, atol=2.5e-3)


@given(lates, seeds)
def test_a_joint_that_hardly_moves_is_as_late_as_all(late: Array, seed: int) -> None:
    wanted = wanted_by(DT * np.arange(600), seed)
    wanted[:, 0] *= 1e-4
    times = learnt(wanted, followed(wanted, late)).times
    assert times[1:].min() - 1e-3 <= times[0] <= times[1:].max() + 1e-3


@given(lates, seeds)
def test_joints_that_wait_follow_together(late: Array, seed: int) -> None:
    """Each waits for the latest one: all are late as that one is, or sooner by the slack."""
    wanted = wanted_by(DT * np.arange(120), seed)
    sent = np.array([waiting(wanted[: k + 1], late, DT) for k in range(len(wanted))])
    together = followed(wanted, np.maximum(late, late.max() - SLACK))
    np.testing.assert_allclose(followed(sent, late)[20:], together[20:], atol=0.01)


@given(seeds, st.floats(0.0, 0.2))
def test_joints_that_are_nearly_late_together_wait_for_none(seed: int, late: float) -> None:
    wanted, apart = wanted_by(DT * np.arange(30), seed), np.linspace(0.0, 0.99 * SLACK, JOINTS)
    np.testing.assert_array_equal(waiting(wanted, late + apart, DT), wanted[-1])


def test_no_joint_waits_longer_than_the_longest_time() -> None:
    wanted = np.arange(20.0)[:, None] * np.ones(JOINTS)
    times = np.array([0.0, 0.5, 0.5, 0.49, 0.5])
    newest = waiting(wanted, times, DT)
    assert newest == pytest.approx(19.0 - np.array([LONGEST / DT, 0.0, 0.0, (0.01 - SLACK) / DT, 0.0]))


def test_a_reading_that_is_none_changes_nothing() -> None:
    wanted = wanted_by(DT * np.arange(50), 0)
    known = learnt(wanted, followed(wanted, np.full(JOINTS, 0.01)))
    assert known.measured(wanted[-3:], np.array([np.nan, 0, 0, 0, 0]), DT) is known
