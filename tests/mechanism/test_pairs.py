"""Chains of pairs in any order: coordinates, poses, screws and rates agree, and with differences."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from screwkin.algebra.screws import at
from screwkin.algebra.se3 import Pose, Twist, Vector, as_array, log, twist_from_array
from screwkin.errors import InputError
from screwkin.mechanism.pairs import (
    NAMED,
    check_pairs,
    pair_coordinates,
    pair_names,
    pair_pose,
    pair_rates,
    pair_screws,
)
from tests.strategies import assert_close, poses

EULER = [tuple(f"r{a}" for a in axes) for axes in ("zxz", "zyz", "xyx", "xzx", "yxy", "yzy")]
MIXED = list(itertools.permutations(("px", "py", "pz", "rx", "ry", "rz")))[::37]
ARMS = [
    *(("rz", "px", *wrist) for wrist in (("rz",), ("rx", "ry", "rz"), ("ry", "rz", "ry"))),
    ("pz", "rz", "py", "rx", "ry", "rz"),
    ("rx", "pz", "px", "rz", "rx", "rz"),
    ("ry", "rx", "py", "rx", "ry", "rz"),
    ("rx", "rz", "py", "rz", "rx", "rz"),
    ("rz", "rx", "pz", "rx", "ry", "rz"),
]
CHAINS = [*NAMED.values(), *EULER, ("px", "py", "pz", "rz", "rx", "rz"), *MIXED, *ARMS]
chains = st.sampled_from(CHAINS)
values = st.lists(st.floats(0.1, 1.3), min_size=6, max_size=6)
"""Inside every branch: middle angles and distances are positive."""


@given(chain=chains, values=values)
@settings(max_examples=150, deadline=None)
def test_coordinates_and_poses_invert_each_other(chain, values):
    wanted = values[: len(chain)]
    assert check_pairs(chain, "any") == chain
    assert_close(np.array(pair_coordinates(chain, pair_pose(chain, wanted))), np.array(wanted), 1e-11)


@given(chain=chains.filter(lambda chain: len(chain) == 6), pose=poses)
@settings(max_examples=100, deadline=None)
def test_a_chain_of_six_pairs_reaches_every_pose(chain, pose):
    """But for positions on its axis or at its point, where a distance vanishes."""
    if min(abs(x) for x in pose.p) > 1e-3 and np.abs(as_array(pose.R)).max() < 0.999:
        assert_close(pair_pose(chain, pair_coordinates(chain, pose)), pose, 1e-9)


@given(chain=chains, values=values, start=poses)
@settings(max_examples=80, deadline=None)
def test_screws_are_the_derivatives_of_the_pose(chain, values, start):
    x = np.array(values[: len(chain)])
    end = (start @ pair_pose(chain, x)).p
    for k, twist in enumerate(pair_screws(chain, x, start, end)):
        step = np.zeros(len(chain))
        step[k] = 1e-5
        moved = (start @ pair_pose(chain, x + step)) @ (start @ pair_pose(chain, x - step)).inverse
        np.testing.assert_allclose(as_array(log(moved)) / 2e-5, as_array(twist), atol=5e-9)


@given(chain=chains, values=values, rates=values, start=poses)
@settings(max_examples=80, deadline=None)
def test_rates_are_those_whose_screws_add_up_to_the_twist(chain, values, rates, start):
    x, wanted = values[: len(chain)], np.array(rates[: len(chain)])
    end = (start @ pair_pose(chain, x)).p
    screws = [at(end, s) for s in pair_screws(chain, x, start, end)]
    twist = twist_from_array(wanted @ as_array(screws))
    assert_close(np.array(pair_rates(chain, screws, twist)), wanted, 1e-9)


def test_spherical_coordinates_are_the_distance_and_the_directions():
    x = pair_coordinates(NAMED["spherical"], Pose(pair_pose(("rz",), [0.4]).R, Vector(3.0, 4.0, 12.0)))
    assert x[0] == pytest.approx(math.atan2(4, 3))
    assert x[1] == pytest.approx(-math.atan2(12, 5))
    assert x[2] == pytest.approx(13)
    x = pair_coordinates(NAMED["cylindrical"], Pose(pair_pose(("rz",), [0.4]).R, Vector(3.0, 4.0, 12.0)))
    np.testing.assert_allclose(x[:3], [math.atan2(4, 3), 5, 12])


def test_the_same_lines_serve_symbols_and_jax():
    """Derivatives of the coordinates by sympy and by JAX are those of the screws, without differences."""
    import jax

    from screwkin.algebra.se3 import pose_from_array

    a, r, b = sympy.symbols("a r b", positive=True)
    pose = pair_pose(("rz", "px", "rz"), [a, r, b])
    assert sympy.simplify(pose.p.x - r * sympy.cos(a)) == 0
    assert sympy.simplify(pose.R.x.x - sympy.cos(a + b)) == 0
    chain, x = NAMED["RPR"], np.array([0.3, 0.4, 0.5])

    with jax.enable_x64(True):

        def there_and_back(x):
            return jax.numpy.stack(pair_coordinates(chain, pair_pose(chain, list(x))))

        J = jax.jit(jax.jacfwd(there_and_back))(jax.numpy.asarray(x))
        assert pose_from_array(jax.numpy.eye(4)).p.x.dtype == J.dtype
    np.testing.assert_allclose(J, np.eye(3), atol=1e-12)


def test_couplings_that_stand_again_are_numbered():
    assert pair_names(("rz", "px", "rz", "rz")) == ("rz", "px", "rz2", "rz3")


@pytest.mark.parametrize(
    ("chain", "message"),
    [
        ("3p3r", "is no named chain; valid: 3P3R, PPR, 3R, RPR, cylindrical, spherical"),
        ((), "no couplings"),
        (("px", "qx"), "unknown coupling 'qx'"),
        (("px", "px"), "dependent"),
        (("px", "py", "pz", "rx", "ry", "rz", "rx"), "dependent"),
        (("rz", "px", "ry", "px", "rz", "ry"), "follow neither from an orientation"),
    ],
)
def test_what_has_no_closed_form_is_refused(chain, message):
    with pytest.raises(InputError, match=message):
        check_pairs(chain, "any")


def test_what_a_chain_cannot_move_has_no_effect_on_its_rates():
    screws = [at(Vector(0, 0, 0), s) for s in pair_screws(("px",), [0.0], pair_pose((), []), Vector(0, 0, 0))]
    assert pair_rates(("px",), screws, Twist(Vector(1, 2, 3), Vector(4, 5, 6))) == [4]
