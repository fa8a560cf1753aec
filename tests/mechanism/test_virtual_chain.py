"""Virtual chains from any link to any other: laws on random machines, and what they are for."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import screwkin as sk
from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import IDENTITY, Pose, Vector, as_array, exp, pose_from_array, twist_from_array
from screwkin.algebra.se3 import rotate as turned
from screwkin.errors import InputError, ShapeError, UnknownNameError
from screwkin.mechanism.closure import coordinates_from_state
from screwkin.mechanism.mechanism import unchosen
from screwkin.mechanism.network import coupling_twists
from screwkin.mechanism.pairs import NAMED
from screwkin.mechanism.virtual_motion import primary_motion
from screwkin.model.robot import Inertia, Joint, Limb, Link
from tests.kinematics.machines import array_of, machine, pose, random_state, random_tree, seeds

WHOLE = (NAMED["3P3R"], NAMED["cylindrical"], NAMED["spherical"], ("rx", "ry", "rz", "px", "py", "pz"))
STEP = 1e-5


def linked(seed: int, couplings: tuple[str, ...], start: str, floor: str = "floating") -> sk.Mechanism:
    """A random tree with a chain between two frames, placed anywhere on their links."""
    robot, rng = random_tree(seed % 6, base=floor), np.random.default_rng(seed)
    ends = {"end_frame": array_of(pose(rng)), "start_frame": array_of(pose(rng))}
    return sk.closed_mechanism(robot, chains=[sk.VirtualChain("added", couplings, "link_7", start, **ends)])


def coordinates(mechanism: sk.Mechanism, T: np.ndarray, q: np.ndarray) -> np.ndarray:
    return np.array(coordinates_from_state(mechanism, pose_from_array(T), list(q)), dtype=float)


def rates_of(mechanism: sk.Mechanism, state: sk.State, twist: np.ndarray, qd: np.ndarray) -> np.ndarray:
    """Rates of all couplings by central differences of positions; the twist is that at the base origin."""

    def moved(t: float) -> np.ndarray:
        T = state.T_world_base.copy()
        T[:3, :3] = array_of(exp(twist_from_array(twist * [t, t, t, 0, 0, 0])))[:3, :3] @ T[:3, :3]
        T[:3, 3] += twist[3:] * t
        return coordinates(mechanism, T, state.q + qd * t)

    change = moved(STEP) - moved(-STEP)
    return (change + np.pi) % (2 * np.pi) - np.pi if np.abs(change).max() > 3 else change


@given(
    seed=seeds,
    couplings=st.sampled_from(WHOLE),
    start=st.sampled_from(["floor", "base", "link_1", "link_3"]),
    base=st.sampled_from(["floating", "fixed"]),
)
@settings(max_examples=25, deadline=None)
def test_rates_of_positions_obey_the_circulation_law(seed, couplings, start, base):
    """N q' = 0 for the rates that differences of the positions have, wherever the chain's ends lie."""
    if (base, start) == ("fixed", "base"):
        start = "floor"
    mechanism = linked(seed, couplings, start, base)
    state, rng = random_state(mechanism.robot, seed), np.random.default_rng(seed + 1)
    moving = rng.uniform(-1, 1, 6) * (base == "floating")
    rates = rates_of(mechanism, state, moving, rng.uniform(-1, 1, len(state.q))) / (2 * STEP)
    N = sk.network_matrix(mechanism, state)
    scale = 1 + np.abs(rates).max()
    assert np.abs(N @ rates).max() < 1e-6 * scale
    given_rates = rates[mechanism.primary_columns]
    found, status = sk.secondary_rates(mechanism, state, given_rates, on_singular="status")
    if not status:
        np.testing.assert_allclose(found, rates[mechanism.secondary_columns], atol=1e-4 * scale)


@given(seed=seeds, couplings=st.sampled_from(WHOLE), start=st.sampled_from(["floor", "link_2"]))
@settings(max_examples=25, deadline=None)
def test_a_chain_of_six_pairs_changes_nothing_but_adds_its_own_columns(seed, couplings, start):
    mechanism = linked(seed, couplings, start)
    plain = sk.closed_mechanism(mechanism.robot)
    assert mechanism.mobility == plain.mobility
    assert mechanism.primary == plain.primary
    assert mechanism.couplings == (*plain.couplings, *mechanism.added[0].names)
    assert len(mechanism.circuits) == len(plain.circuits) + 1
    assert mechanism.circuit_names[-1] == "added"
    assert mechanism.kutzbach == plain.kutzbach


@given(seed=seeds, start=st.sampled_from(["floor", "link_1"]))
@settings(max_examples=20, deadline=None)
def test_coordinates_do_not_depend_on_where_the_world_is(seed, start):
    """Base and floor frame displaced together: the chain reads the same, and its screws move along."""
    robot, rng = random_tree(seed % 6), np.random.default_rng(seed)
    T_end, T_start, away = (array_of(pose(rng)) for _ in range(3))
    state = random_state(robot, seed)

    def chain(T):
        return sk.VirtualChain("added", "spherical", "link_7", start, T_end, T)

    here = sk.closed_mechanism(robot, chains=[chain(T_start)])
    there = sk.closed_mechanism(robot, chains=[chain(away @ T_start if start == "floor" else T_start)])
    own = slice(-6, None)
    a = coordinates(here, state.T_world_base, state.q)[own]
    b = coordinates(there, away @ state.T_world_base, state.q)[own]
    np.testing.assert_allclose(a, b, atol=1e-10)
    moved = sk.State(away @ state.T_world_base, state.q)
    N, M = sk.network_matrix(here, state)[-6:, own], sk.network_matrix(there, moved)[-6:, own]
    R = np.kron(np.eye(2), away[:3, :3])
    np.testing.assert_allclose(R @ N, M, atol=1e-11)


@given(seed=seeds, couplings=st.sampled_from(WHOLE), start=st.sampled_from(["floor", "link_1"]))
@settings(max_examples=20, deadline=None)
def test_a_chains_motion_is_the_twist_of_its_end_relative_to_its_start(seed, couplings, start):
    """The chain imposed instead of the base or the joints between: rates by twist and by differences."""
    robot, rng = serial(seed % 8), np.random.default_rng(seed)
    state, qd, twist = random_state(robot, seed), rng.uniform(-1, 1, 7), rng.uniform(-1, 1, 6)
    frames = array_of(pose(rng)), array_of(pose(rng))
    chain = sk.VirtualChain("added", couplings, "link_7", start, *frames)
    own = robot.joint_names if start == "floor" else [*(f"waist.{c}" for c in NAMED["3P3R"]), "joint_1"]
    mechanism = sk.closed_mechanism(robot, [*own, *chain.names], [chain])
    rates = rates_of(mechanism, state, twist, qd) / (2 * STEP)
    end = sk.frame_pose(robot, state, "link_7") @ frames[0]

    def velocity(frame: str) -> np.ndarray:
        v = sk.jacobian(robot, state, frame) @ [*twist, *qd]
        lever = end[:3, 3] - sk.frame_pose(robot, state, frame)[:3, 3]
        return np.array([*v[:3], *(v[3:] + np.cross(v[:3], lever))])

    relative = velocity("link_7") - (0 if start == "floor" else velocity(start))
    given_rates = dict(zip(mechanism.couplings, rates, strict=True))
    motion = primary_motion(
        mechanism,
        pose_from_array(state.T_world_base),
        list(state.q),
        {"added": twist_from_array(relative), "waist": twist_from_array(twist)},
    )
    scale = 1 + np.abs(rates).max()
    for name in chain.names:
        assert motion[name] == pytest.approx(given_rates[name], abs=1e-5 * scale)


def serial(seed: int) -> sk.Robot:
    """Seven joints in a row on a floating base."""
    return random_tree(100 + seed, branching=False)


# ---- What chains are for ----


def seven_joints() -> sk.Robot:
    """An arm whose axes are vertical and across in turn, 0.2 m apart; it is bent at home."""
    names = [f"l{i}" for i in range(8)]
    links = [Link(name, 0, Vector(0, 0, 0), Inertia(0, 0, 0), IDENTITY) for name in names]
    joints = [
        Joint(
            f"j{i}", names[i - 1], names[i], "revolute",
            Screw(Vector(0, 0, 1) if i % 2 else Vector(0, 1, 0), Vector(0, 0, 0.2 * i)), -3.0, 3.0, 5.0, 5.0,
        )
        for i in range(1, 8)
    ]  # fmt: skip
    hand = Pose(IDENTITY.R, Vector(0, 0, 1.6))
    limb = Limb("arm", "arm", "l7", "hand", hand, NAMED["3P3R"])
    return machine(links, joints, limbs=(limb,), home=(0.3, 0.6, 0.2, 1.1, -0.3, 0.7, 0.1))


@pytest.fixture(scope="module")
def holding():
    """The Bioloid with arms of six joints, and how it stands at home with its hands forward."""
    robot = sk.load_robot("bioloid24")
    return robot, sk.home(robot)


def names_of(*chains: str) -> list[str]:
    return [f"{chain}.{c}" for chain in chains for c in NAMED["3P3R"]]


def test_a_slanted_line_is_followed(holding):
    """The hand's chain starts in a slanted frame: one coordinate leads along the line, the others stay 0."""
    robot, home = holding
    hand = sk.frame_pose(robot, home, "right_hand")
    line = np.eye(4)
    line[:3, :3] = as_array(turned(Vector(0, 0, 1), 0.6) @ turned(Vector(0, 1, 0), -0.7))
    line[:3, 3] = hand[:3, 3]
    chain = sk.VirtualChain("line", "3P3R", "right_hand", start_frame=line)
    parts = ("waist", "right_foot", "left_foot", "line", "left_hand")
    mechanism = sk.closed_mechanism(robot, names_of(*parts), [chain])
    along = np.linspace(0, 0.03, 101)
    closed = sk.close_loops(mechanism, home, {"line.px": along})
    assert not closed.status.any()
    hands = sk.frame_pose(robot, closed.state, "right_hand")
    wanted = hand[:3, 3] + along[:, None] * line[:3, 0]
    np.testing.assert_allclose(hands[:, :3, 3], wanted, atol=1e-10)
    np.testing.assert_allclose(hands[:, :3, :3], np.broadcast_to(hand[:3, :3], (101, 3, 3)), atol=1e-10)

    # The same by rates: along the line at 1 m/s, everything else at rest.
    rest = {tip: np.zeros(6) for tip in ("right_foot", "left_foot", "left_hand")}
    motion = {**rest, "line": [0, 0, 0, *line[:3, 0]]}
    rates = sk.virtual_motion(mechanism, home, np.zeros(6), motion)
    np.testing.assert_allclose(rates, [float(name == "line.px") for name in mechanism.primary], atol=1e-12)
    qd = dict(zip(mechanism.secondary, sk.secondary_rates(mechanism, home, rates), strict=True))
    v = sk.jacobian(robot, home, "right_hand")[:, 6:] @ [qd[name] for name in robot.joint_names]
    np.testing.assert_allclose(v, [0, 0, 0, *line[:3, 0]], atol=1e-10)


def test_a_line_of_fewer_pairs_joins_and_holds(holding):
    """One translation and three rotations: two freedoms less, and the hand stays on the line by itself."""
    robot, home = holding
    line = np.eye(4)
    line[:3, 3] = sk.frame_pose(robot, home, "right_hand")[:3, 3]
    line[:3, :3] = as_array(turned(Vector(0, 1, 0), -0.4))
    chain = sk.VirtualChain("line", ("px", "rx", "ry", "rz"), "right_hand", start_frame=line)
    mechanism = sk.closed_mechanism(robot, chains=[chain])
    assert mechanism.mobility == sk.closed_mechanism(robot).mobility - 2 == 28
    primary = [name for name in mechanism.primary if not name.startswith("right_hand.")]
    mechanism = sk.closed_mechanism(robot, [*primary, *chain.names], [chain])
    turning = coordinates(mechanism, home.T_world_base, home.q)[mechanism.position["line.rx"]]
    closed = sk.close_loops(mechanism, home, {"line.px": 0.02, "line.rx": turning + 0.1})
    assert not closed.status
    hand = sk.frame_pose(robot, closed.state, "right_hand")
    np.testing.assert_allclose(np.linalg.inv(line) @ hand[:, 3], [0.02, 0, 0, 1], atol=1e-10)


def test_hand_to_hand_without_a_row_in_the_table(holding):
    """The left hand keeps its place in the right one, which moves; nothing is written into the table."""
    robot, home = holding
    grip = sk.VirtualChain("grip", "3P3R", "left_hand", "right_hand")
    parts = ("waist", "right_foot", "left_foot", "right_hand", "grip")
    mechanism = sk.closed_mechanism(robot, names_of(*parts), [grip])
    assert mechanism.mobility == 30
    assert mechanism.circuit_names == ("right_leg", "left_leg", "right_arm", "left_arm", "grip")
    assert not any(name.startswith(("waist", "right_foot")) for name in mechanism.circuits[-1])
    there = np.linspace(0, 0.02, 50)
    x = coordinates(mechanism, home.T_world_base, home.q)
    imposed = {f"right_hand.p{a}": x[mechanism.position[f"right_hand.p{a}"]] + there for a in "xz"}
    closed = sk.close_loops(mechanism, home, imposed)
    assert not closed.status.any()

    def relative(state):
        hands = [sk.frame_pose(robot, state, f"{side}_hand") for side in ("right", "left")]
        return np.linalg.solve(*hands)

    np.testing.assert_allclose(
        relative(closed.state), np.broadcast_to(relative(home), (50, 4, 4)), atol=1e-10
    )


def test_two_hands_carry_one_object_along_a_path(holding):
    """A closure joins the hands; a chain from the floor leads the object between them."""
    robot, home = holding
    text = robot.text + (
        '\n[[closure]]\nname = "object"\n'
        'link_a = "right_hand_link"\nframe_a = { xyz = [0, 0, "shoulder_z - upper_arm - forearm"] }\n'
        'link_b = "left_hand_link"\nframe_b = { xyz = [0, 0, "shoulder_z - upper_arm - forearm"] }\n'
    )
    both = sk.robot_from_text(text)
    assert sk.closed_mechanism(both).mobility == 24
    middle = np.eye(4)
    middle[:3, 3] = np.mean(
        [sk.frame_pose(both, home, f"{s}_hand")[:3, 3] for s in ("left", "right")], axis=0
    )
    held = np.linalg.solve(sk.frame_pose(both, home, "right_hand"), middle)
    chain = sk.VirtualChain("object", "3P3R", "right_hand", end_frame=held)
    mechanism = sk.closed_mechanism(both, names_of("waist", "right_foot", "left_foot", "object"), [chain])
    t = np.linspace(0, 1, 200)
    path = {
        "object.px": middle[0, 3] + 0.015 * np.sin(np.pi * t),
        "object.py": middle[1, 3] + 0.004 * np.sin(2 * np.pi * t),
        "object.pz": middle[2, 3] + 0.02 * t,
        "object.rx": 0.06 * np.sin(2 * np.pi * t),
    }
    closed = sk.close_loops(mechanism, home, path)
    assert not closed.status.any()
    right, left = (sk.frame_pose(both, closed.state, f"{s}_hand") for s in ("right", "left"))
    carried = right @ held
    wanted = np.stack([path[f"object.p{a}"] for a in "xyz"], axis=-1)
    np.testing.assert_allclose(carried[:, :3, 3], wanted, atol=1e-10)
    np.testing.assert_allclose(np.arctan2(carried[:, 2, 1], carried[:, 2, 2]), path["object.rx"], atol=1e-10)
    from_left = left @ np.linalg.solve(sk.frame_pose(both, home, "left_hand"), middle)
    np.testing.assert_allclose(from_left, carried, atol=1e-10)
    for foot in ("right_foot", "left_foot"):
        stands = np.broadcast_to(sk.frame_pose(both, home, foot), (200, 4, 4))
        np.testing.assert_allclose(sk.frame_pose(both, closed.state, foot), stands, atol=1e-10)

    # Squeezed by 5 N on the whole path, while the feet carry everything: both halves of Davies' method.
    forces = sk.static_forces(mechanism, closed.state, imposed={"object.fy": 5.0}, weights=True)
    assert forces.residual.max() < 1e-9
    np.testing.assert_allclose(np.abs(forces["object.fy"]), 5.0)
    feet = sum(forces.force(foot) for foot in ("right_foot", "left_foot"))
    np.testing.assert_allclose(feet, np.broadcast_to([0, 0, both.mass * 9.81], (200, 3)), atol=1e-8)


def test_an_elbow_keeps_its_distance_from_an_obstacle():
    """An arm of seven joints leads its hand along a line; left alone, its elbow would come too near."""
    robot = seven_joints()
    home, samples, d = sk.home(robot), 1000, 0.25
    start = sk.frame_pose(robot, home, "hand")
    elbow = np.eye(4)
    elbow[2, 3] = 0.8
    x = coordinates(sk.closed_mechanism(robot, ["j3", *names_of("hand")]), home.T_world_base, home.q)[7:10]
    path = {
        f"hand.p{a}": x[k] + s * np.linspace(0, 0.25, samples)
        for k, (a, s) in enumerate(zip("xyz", (-0.5, 0.9, 0.3), strict=True))
    }
    free = sk.close_loops(sk.closed_mechanism(robot, ["j3", *names_of("hand")]), home, path)
    assert not free.status.any()

    def elbows(state):
        return (sk.frame_pose(robot, state, "l4") @ elbow_in_l4)[:, :3, 3]

    elbow_in_l4 = np.linalg.solve(sk.frame_pose(robot, sk.State(np.eye(4), np.zeros(7)), "l4"), elbow)
    obstacle = np.eye(4)
    obstacle[:3, 3] = elbows(free.state)[600] + [0.05, 0.12, 0.08]
    natural = np.linalg.norm(elbows(free.state) - obstacle[:3, 3], axis=1)
    assert natural.min() < d - 0.05
    chain = sk.VirtualChain("obstacle", "spherical", "l4", end_frame=elbow_in_l4, start_frame=obstacle)
    mechanism = sk.closed_mechanism(robot, [*names_of("hand"), "obstacle.px"], [chain])
    assert mechanism.mobility == 7
    closed = sk.close_loops(mechanism, free.state, {**path, "obstacle.px": np.maximum(natural, d)})
    assert not closed.status.any()
    distance = np.linalg.norm(elbows(closed.state) - obstacle[:3, 3], axis=1)
    assert distance.min() >= d - 1e-10
    np.testing.assert_allclose(distance, np.maximum(natural, d), atol=1e-10)
    hand = sk.frame_pose(robot, closed.state, "hand")
    np.testing.assert_allclose(hand[:, :3, 3], np.stack(list(path.values()), axis=-1), atol=1e-10)
    np.testing.assert_allclose(hand[:, :3, :3], np.broadcast_to(start[:3, :3], (samples, 3, 3)), atol=1e-10)


# ---- Any scalar, and what is refused ----


def test_jax_follows_the_same_lines():
    import jax

    with jax.enable_x64(True):
        robot = random_tree(3, 2, branching=False, base="fixed")
        mechanism = sk.closed_mechanism(robot, chains=[sk.VirtualChain("added", "spherical", "link_2")])
        state = random_state(robot, 3, (4,))
        traced = sk.State(*map(jax.numpy.asarray, (state.T_world_base, state.q)))
        N = jax.jit(lambda s: sk.network_matrix(mechanism, s))(traced)
    np.testing.assert_allclose(N, sk.network_matrix(mechanism, state), atol=1e-12)


def test_a_chains_frames_may_be_symbols():
    """The line's slope stays a symbol in the network matrix."""
    import sympy

    slope = sympy.Symbol("slope", real=True)
    frame = np.eye(4, dtype=object)
    frame[0, 0], frame[0, 2] = sympy.cos(slope), sympy.sin(slope)
    frame[2, 0], frame[2, 2] = -sympy.sin(slope), sympy.cos(slope)
    robot = seven_joints()
    chain = sk.VirtualChain("line", "3P3R", "hand", start_frame=frame)
    twists = coupling_twists(unchosen(robot, (chain,)), IDENTITY, list(robot.posture("home").q))
    along = twists[-6].v
    assert (along.x, along.y, along.z) == (sympy.cos(slope), 0, -sympy.sin(slope))


def test_equal_chains_share_their_programs():
    a, b = (linked(1, NAMED["3P3R"], "floor") for _ in range(2))
    assert a.choice == b.choice
    door = sk.network_matrix.definition.door
    given_names = ("T_world_base", "q")
    assert a.robot is b.robot
    assert door(a, given_names, ()) is door(b, given_names, ())


HAND = {"name": "c", "couplings": "3P3R", "end": "hand"}


@pytest.mark.parametrize(
    ("keys", "error", "message"),
    [
        ({"end": "hnad"}, UnknownNameError, "unknown frame of chain c 'hnad'; .* Did you mean 'hand'"),
        ({"end": "base"}, InputError, "chain c: floor and base are the same body; name frames of two"),
        ({"end": "l7", "start": "hand"}, InputError, "hand and l7 are the same body"),
        ({"name": "hand"}, InputError, "chain hand: another chain has this name"),
        ({"name": "a.b"}, InputError, "write a name without dots"),
        ({"start_frame": np.eye(3)}, ShapeError, "start_frame has shape .* give a pose"),
        ({"end_frame": np.diag([1, 1, -1, 1])}, ShapeError, "end_frame is no rigid pose"),
        ({"end_frame": np.full((4, 4), np.nan)}, ShapeError, "end_frame is no rigid pose"),
        ({"couplings": ("px", "rx", "ry", "rz")}, InputError, "chain c of px, rx, ry, rz misses its end by"),
    ],
)
def test_what_is_no_chain_of_the_robot_is_refused(keys, error, message):
    with pytest.raises(error, match=message):
        sk.closed_mechanism(seven_joints(), ["j3", *names_of("hand")], [sk.VirtualChain(**{**HAND, **keys})])


def test_chains_are_records():
    with pytest.raises(InputError, match="chains"):
        sk.closed_mechanism(seven_joints(), chains=["obstacle"])
