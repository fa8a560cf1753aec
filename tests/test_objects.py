"""Results as values: pickles, copies, short prints, tables for notebooks, JAX pytrees, wrong kinds."""

from __future__ import annotations

import copy
import hashlib
import pickle
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import screwkin as sk
from screwkin.compliance.stiffness import static_deflection
from screwkin.errors import InputError
from screwkin.model.robot import robot_text
from screwkin.model.table import parse_robot

ROBOT = sk.load_robot("bioloid")
GAIT = sk.load_gait("walk")
WALKED = sk.walk(ROBOT, GAIT, steps=2)
HOME = sk.home(ROBOT)
FEET = {foot: sk.frame_pose(ROBOT, HOME, foot) for foot in ("right_foot", "left_foot")}
T_BASE_FOOT = np.linalg.inv(HOME.T_world_base) @ FEET["right_foot"]
RECORDS: dict[str, Any] = {
    "state": HOME,
    "gait": GAIT,
    "trajectory": WALKED,
    "mechanism": sk.closed_mechanism(ROBOT),
    "balance": sk.zmp(ROBOT, WALKED),
    "pose": sk.solve_pose(ROBOT, FEET),
    "limb": sk.limb_ik(ROBOT, "right_leg", T_BASE_FOOT),
    "deflection": static_deflection(ROBOT, HOME, "right_foot", 50.0),
}
WAYS: dict[str, Callable[[Any], Any]] = {
    "pickle": lambda x: pickle.loads(pickle.dumps(x)),  # noqa: S301
    "deepcopy": copy.deepcopy,
    "copy": copy.copy,
}


def assert_same(a: Any, b: Any) -> None:
    assert type(a) is type(b)
    if hasattr(a, "__dataclass_fields__"):
        for f in fields(a):
            if f.init:
                assert_same(getattr(a, f.name), getattr(b, f.name))
    elif isinstance(a, np.ndarray):
        np.testing.assert_array_equal(a, b)
    elif hasattr(a, "items"):
        assert list(a) == list(b)
        for key in a:
            assert_same(a[key], b[key])
    elif isinstance(a, tuple):
        assert len(a) == len(b)
        for x, y in zip(a, b, strict=True):
            assert_same(x, y)
    else:
        assert a == b


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", RECORDS)
def test_records_survive_pickles_and_copies(name: str, way: str) -> None:
    record = RECORDS[name]
    assert_same(WAYS[way](record), record)


@pytest.mark.parametrize("way", WAYS)
def test_a_copied_trajectory_stays_read_only_and_keeps_its_hash(way: str, tmp_path: Path) -> None:
    for walked in (WALKED, sk.load_trajectory(WALKED.save(tmp_path / "walk.npz"))):
        other = WAYS[way](walked)
        assert other.sha256 == walked.sha256
        assert not any(
            getattr(other, name).flags.writeable for name in ("time", "q", "T_world_base", "contact")
        )
        assert not other.T_world_tip["right_foot"].flags.writeable
        with pytest.raises(TypeError):
            other.meta["command"] = "x"


@given(st.integers(2, 5), st.integers(0, 3), st.integers(0, 2**31))
@settings(max_examples=20, deadline=None)
def test_any_trajectory_survives_a_pickle(samples: int, joints: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    flat = {name: rng.normal(size=(samples, joints)) for name in ("q", "qd", "qdd")}
    flat |= {name: rng.normal(size=(samples, 6)) for name in ("base_twist", "base_acceleration")}
    trajectory = sk.Trajectory(
        time=np.cumsum(rng.uniform(0.1, 1, samples)), joint_names=tuple(f"j{i}" for i in range(joints)),
        T_world_base=np.tile(np.eye(4), (samples, 1, 1)), T_world_tip={}, feet=(),
        contact=np.zeros((samples, 0), dtype=bool), com=rng.normal(size=(samples, 3)),
        zmp=rng.normal(size=(samples, 2)), margin=rng.normal(size=samples), meta={"a": [1, {"b": 0}]},
        **flat,
    )  # fmt: skip
    other = WAYS["pickle"](trajectory)
    assert_same(other, trajectory)
    assert other.sha256 == trajectory.sha256


LINES = {
    "state": "State: base at (0, 0, 0.17) m, q = (0, 0, -0.4636",
    "gait": "Gait 'walk' (",
    "trajectory": "Trajectory: ",
    "mechanism": "Mechanism of 'bioloid': 48 couplings, ",
}


@pytest.mark.parametrize("name", LINES)
def test_records_print_in_a_few_lines(name: str) -> None:
    text = repr(RECORDS[name])
    assert text.startswith(LINES[name])
    assert len(text) < 400
    assert text.count("\n") <= 3


@pytest.mark.parametrize("name", ["trajectory", "mechanism"])
def test_notebooks_show_a_small_table(name: str) -> None:
    html = RECORDS[name]._repr_html_()
    assert html.startswith("<table>")
    assert html.count("<tr>") < 30


def test_names_are_escaped_in_tables() -> None:
    odd = replace(
        WALKED, feet=(), contact=np.zeros((WALKED.samples, 0), bool), T_world_tip={"<b>": WALKED.T_world_base}
    )
    assert "T_world_&lt;b&gt;" in odd._repr_html_()


def test_what_is_recorded_is_the_robot_that_walked() -> None:
    """A table edited record by record leaves its old text behind; the trajectory holds the new one."""
    torso = replace(ROBOT.link("torso"), mass=2 * ROBOT.link("torso").mass)
    heavy = replace(ROBOT, links=(torso, *ROBOT.links[1:]))
    told = sk.walk(heavy, GAIT, steps=2).meta["robot"]
    assert told["table"] == robot_text(heavy)
    assert told["sha256"] == hashlib.sha256(told["table"].encode()).hexdigest()
    assert parse_robot(told["table"]).mass == pytest.approx(heavy.mass, rel=1e-15)
    longer = ROBOT.replace(masses={"torso": torso.mass})
    again = sk.walk(longer, GAIT, steps=2)
    assert again.meta["robot"]["table"] == longer.text
    np.testing.assert_allclose(again.zmp, sk.walk(heavy, GAIT, steps=2).zmp, rtol=0, atol=1e-12)


@pytest.fixture
def x64() -> Any:
    before = jax.config.read("jax_enable_x64")
    jax.config.update("jax_enable_x64", True)
    yield
    jax.config.update("jax_enable_x64", before)


@pytest.mark.usefixtures("x64")
def test_a_state_crosses_jit_vmap_and_grad() -> None:
    height = jax.jit(lambda s: sk.center_of_mass(ROBOT, s)[..., 2])
    state = sk.State(jnp.asarray(HOME.T_world_base), jnp.asarray(HOME.q))
    assert float(height(state)) == pytest.approx(float(sk.center_of_mass(ROBOT, HOME)[2]), abs=1e-12)
    slope = jax.grad(lambda s: height(s))(state)
    assert isinstance(slope, sk.State)
    assert slope.q.shape == (18,)
    many = sk.State(jnp.tile(state.T_world_base, (5, 1, 1)), jnp.tile(state.q, (5, 1)))
    np.testing.assert_allclose(jax.vmap(height)(many), np.full(5, height(state)), atol=1e-12)


@pytest.mark.parametrize("name", ["state", "balance", "pose", "limb", "deflection"])
def test_results_are_pytrees_of_their_arrays(name: str) -> None:
    sk.State(np.eye(4), np.zeros(0))  # a record made while JAX is there
    record = RECORDS[name]
    leaves, structure = jax.tree_util.tree_flatten(record)
    assert all(isinstance(leaf, np.ndarray) for leaf in leaves)
    assert_same(jax.tree_util.tree_unflatten(structure, leaves), record)


WRONG: list[tuple[Callable[[], Any], str]] = [
    (lambda: sk.home("bioloid"), "robot is the str 'bioloid', expected Robot; give load_robot"),
    (lambda: sk.walk("bioloid", GAIT), "give load_robot"),
    (lambda: sk.walk(ROBOT, "walk"), "gait is the str 'walk', expected Gait; give load_gait"),
    (lambda: sk.closed_mechanism("x"), "robot is the str 'x', expected Robot"),
    (lambda: sk.load_robot(None), "name_or_path is None, expected str or Path"),
    (lambda: sk.load_trajectory(None), "path is None, expected str or Path"),
    (lambda: replace(WALKED, T_world_tip=[]), "T_world_tip is a list, expected Mapping"),
]


@pytest.mark.parametrize(("call", "words"), WRONG)
def test_a_wrong_kind_is_refused_with_what_to_give(call: Callable[[], Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        call()
