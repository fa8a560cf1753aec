"""The bundled linkages against the closed forms of the textbooks, through whole turns of their cranks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import sympy

import screwkin as sk
from screwkin.algebra.se3 import UNTURNED, Pose, Vector
from screwkin.errors import InputError, NoSolutionError, SingularError
from screwkin.kinematics.positions import link_displacements
from screwkin.kinematics.status import Status
from screwkin.mechanism.closure import close_loops, nearest_closed
from screwkin.model.robot import Limb
from screwkin.model.table import load_robot, parse_robot
from tests.kinematics.machines import SPATIAL

COUNTS = {
    # couplings, links, circuits, mobility by rank, mobility by counting
    "four-bar": (4, 4, 1, 1, -2),
    "slider-crank": (4, 4, 1, 1, -2),
    "bennett": (4, 4, 1, 1, -2),
    "rssr": (8, 8, 1, 2, 2),
    "stewart": (36, 32, 5, 6, 6),
}
TURN = np.linspace(0, 2 * np.pi, 25)


@pytest.fixture(scope="module")
def mechanisms():
    return {name: sk.closed_mechanism(load_robot(f"linkages/{name}")) for name in COUNTS}


def turned(mechanism, crank, angles, **imposed):
    """q (T, joints) and rates (T, joints) per unit rate of the crank, following it from home."""
    names = mechanism.robot.joint_names
    state = sk.home(mechanism.robot)
    start = state.q[names.index(crank)]
    qs = []
    for angle in np.linspace(start, start + 2 * np.pi, 49):
        solution = close_loops(mechanism, state, {crank: angle, **imposed})
        assert solution.status == Status.CONVERGED
        assert solution.residual < 1e-12
        state = solution.state
        qs.append(state.q)
    path = np.array(qs)
    nearest = np.abs((path[:, names.index(crank)][None] - angles[:, None] + np.pi) % (2 * np.pi) - np.pi)
    guess = path[nearest.argmin(axis=1)]
    solution = close_loops(mechanism, sk.State(np.eye(4), guess), {crank: angles, **imposed})
    assert (solution.status == Status.CONVERGED).all()
    primary = np.zeros((len(angles), len(mechanism.primary)))
    primary[:, mechanism.primary.index(crank)] = 1.0
    found = sk.secondary_rates(mechanism, solution.state, primary)
    rates = np.zeros((len(angles), len(names)))
    for values, chosen in ((primary, mechanism.primary), (found, mechanism.secondary)):
        rates[:, [names.index(name) for name in chosen]] = values
    return dict(zip(names, solution.state.q.T, strict=True)), dict(zip(names, rates.T, strict=True))


def wrapped(angle):
    return (angle + np.pi) % (2 * np.pi) - np.pi


@pytest.mark.parametrize("name", COUNTS)
def test_counts_of_couplings_links_circuits_and_freedoms(mechanisms, name):
    mechanism = mechanisms[name]
    found = len(mechanism.couplings), len(mechanism.links), len(mechanism.circuits)
    assert (*found, mechanism.mobility, mechanism.kutzbach) == COUNTS[name]


@pytest.mark.parametrize("name", COUNTS)
def test_every_linkage_is_closed_at_home_to_the_last_digits(mechanisms, name):
    solution = close_loops(mechanisms[name], sk.home(mechanisms[name].robot), {})
    assert solution.iterations == 0
    assert solution.residual < 1e-14


@pytest.mark.parametrize("name", COUNTS)
def test_differences_of_closed_positions_lie_in_the_kernel_and_are_the_secondary_rates(mechanisms, name):
    mechanism = mechanisms[name]
    home = sk.home(mechanism.robot)
    start = close_loops(mechanism, home, {}).coordinates[mechanism.primary_columns]
    speed = np.linspace(1.0, 0.3, len(start))
    h = np.array([-2, -1, 1, 2]) * 1e-3
    imposed = {n: x + v * h for n, x, v in zip(mechanism.primary, start, speed, strict=True)}
    x = close_loops(mechanism, home, imposed).coordinates
    rates = (x[0] - 8 * x[1] + 8 * x[2] - x[3]) / 12e-3
    N = sk.network_matrix(mechanism, home)
    assert np.abs(N @ rates).max() < 1e-8
    found = sk.secondary_rates(mechanism, home, speed)
    np.testing.assert_allclose(found, rates[mechanism.secondary_columns], atol=1e-8)


def test_the_four_bars_rocker_obeys_freudensteins_equation(mechanisms):
    p = mechanisms["four-bar"].robot.parameters
    a, b, c, d = p["crank"], p["coupler"], p["rocker"], p["ground"]
    q, rates = turned(mechanisms["four-bar"], "crank", TURN)
    k1, k2, k3 = d / a, d / c, (a * a - b * b + c * c + d * d) / (2 * a * c)
    A = np.cos(TURN) - k1 - k2 * np.cos(TURN) + k3
    B = -2 * np.sin(TURN)
    C = k1 - (k2 + 1) * np.cos(TURN) + k3
    rocker = 2 * np.arctan2(-B - np.sqrt(B * B - 4 * A * C), 2 * A)
    np.testing.assert_allclose(wrapped(q["rocker"] - rocker), 0, atol=1e-11)
    coupler = np.arctan2(c * np.sin(rocker) - a * np.sin(TURN), d + c * np.cos(rocker) - a * np.cos(TURN))
    np.testing.assert_allclose(wrapped(q["crank"] + q["crank_pin"] - coupler), 0, atol=1e-11)
    # Norton, eq. 6.18: angular velocities of coupler and rocker.
    w3 = a / b * np.sin(rocker - TURN) / np.sin(coupler - rocker)
    w4 = a / c * np.sin(TURN - coupler) / np.sin(rocker - coupler)
    np.testing.assert_allclose(rates["crank"] + rates["crank_pin"], w3, atol=1e-11)
    np.testing.assert_allclose(rates["rocker"], w4, atol=1e-11)


def test_the_four_bars_rocker_rate_is_the_implicit_derivative_by_sympy(mechanisms):
    p = mechanisms["four-bar"].robot.parameters
    x, y = sympy.symbols("x y")
    a, b, c, d = (p[name] for name in ("crank", "coupler", "rocker", "ground"))
    loop = (d + c * sympy.cos(y) - a * sympy.cos(x)) ** 2 + (c * sympy.sin(y) - a * sympy.sin(x)) ** 2 - b**2
    rate = sympy.lambdify((x, y), sympy.idiff(loop, y, x))
    q, rates = turned(mechanisms["four-bar"], "crank", TURN)
    np.testing.assert_allclose(rates["rocker"], rate(TURN, q["rocker"]), atol=1e-11)


def test_a_four_bar_with_a_stretched_crank_is_singular_at_its_rocker():
    """Driven by the rocker, the dead centres cannot be passed: crank and coupler in one line."""
    robot = load_robot("linkages/four-bar")
    mechanism = sk.closed_mechanism(robot, primary=["rocker"])
    a, b, c, d = (robot.parameters[name] for name in ("crank", "coupler", "rocker", "ground"))
    crank = np.arccos((d * d + (a + b) ** 2 - c * c) / (2 * d * (a + b)))
    tip = (a + b) * np.array([np.cos(crank), np.sin(crank)]) - [d, 0]
    rocker = np.arctan2(tip[1], tip[0])
    dead = sk.State(np.eye(4), np.array([crank, 0.0, rocker - crank, rocker]))
    _, status = sk.secondary_rates(mechanism, dead, [1.0], on_singular="status")
    assert status == Status.SINGULAR
    with pytest.raises(SingularError, match="crank"):
        sk.secondary_rates(mechanism, dead, [1.0])
    by_crank = sk.closed_mechanism(robot)
    rocker_rate = sk.secondary_rates(by_crank, dead, [1.0])[by_crank.secondary.index("rocker")]
    assert rocker_rate == pytest.approx(0, abs=1e-12), "the rocker rests at its dead centre"


def test_the_slider_follows_its_closed_form_and_its_derivatives_by_sympy(mechanisms):
    p = mechanisms["slider-crank"].robot.parameters
    t = sympy.Symbol("t")
    lift = p["offset"] - p["crank"] * sympy.sin(t)
    x = p["crank"] * sympy.cos(t) + sympy.sqrt(p["rod"] ** 2 - lift**2)
    q, rates = turned(mechanisms["slider-crank"], "crank", TURN)
    np.testing.assert_allclose(q["slider"], sympy.lambdify(t, x)(TURN), atol=1e-13)
    np.testing.assert_allclose(rates["slider"], sympy.lambdify(t, sympy.diff(x, t))(TURN), atol=1e-12)
    rod = np.arcsin((p["offset"] - p["crank"] * np.sin(TURN)) / p["rod"])
    np.testing.assert_allclose(wrapped(q["crank"] + q["crank_pin"] - rod), 0, atol=1e-12)


def test_the_sliders_acceleration_is_the_second_derivative_by_sympy(mechanisms):
    from screwkin.mechanism.rates import secondary_accelerations, solve_rates

    mechanism = mechanisms["slider-crank"]
    p = mechanism.robot.parameters
    t = sympy.Symbol("t")
    lift = p["offset"] - p["crank"] * sympy.sin(t)
    x = p["crank"] * sympy.cos(t) + sympy.sqrt(p["rod"] ** 2 - lift**2)
    state = sk.home(mechanism.robot)
    speed = 3.0
    rates = np.empty(4)
    rates[mechanism.primary_columns] = speed
    rates[mechanism.secondary_columns] = solve_rates(
        mechanism, state.T_world_base, state.q, np.array([speed])
    ).values
    found = secondary_accelerations(mechanism, state.T_world_base, state.q, rates, np.array([0.0])).values
    wanted = speed**2 * float(sympy.diff(x, t, 2).subs(t, state.q[0]))
    assert found[mechanism.secondary.index("slider")] == pytest.approx(wanted, rel=1e-12)


def test_bennetts_linkage_turns_by_its_half_angle_relation(mechanisms):
    p = mechanisms["bennett"].robot.parameters
    angles = np.linspace(0.3, 2 * np.pi - 0.3, 15)
    q, rates = turned(mechanisms["bennett"], "axis_1", angles)
    ratio = np.sin((p["beta"] + p["alpha"]) / 2) / np.sin((p["beta"] - p["alpha"]) / 2)
    one, two = q["axis_1"] / 2, q["axis_2"] / 2
    # tan(q1/2) tan(q2/2) = ratio, without the poles.
    np.testing.assert_allclose(np.sin(one) * np.sin(two), ratio * np.cos(one) * np.cos(two), atol=1e-11)
    np.testing.assert_allclose(wrapped(q["axis_1"] + q["axis_3"]), 0, atol=1e-11)
    np.testing.assert_allclose(wrapped(q["axis_2"] + q["axis_4"]), 0, atol=1e-11)
    np.testing.assert_allclose(rates["axis_3"], -1, atol=1e-10)
    # Its derivative: q1'/sin(q1) + q2'/sin(q2) = 0.
    np.testing.assert_allclose(rates["axis_2"] * np.sin(2 * one), -np.sin(2 * two), atol=1e-10)


def test_without_bennetts_condition_the_same_bars_are_rigid():
    """The closing frame is put where the open chain ends, so that both loops are closed at home."""
    text = load_robot("linkages/bennett").text
    for beta, mobility in ((np.arcsin(1.5 * np.sin(np.radians(30))), 1), (np.radians(55), 0)):
        bars = parse_robot(text.replace('"asin(b/a*sin(alpha))"', repr(float(beta))))
        D = link_displacements(bars, list(bars.posture("home").q))[-1]
        (loop,) = bars.closures
        loop = replace(loop, frame_b=D @ loop.frame_a)
        assert sk.closed_mechanism(replace(bars, closures=(loop,))).mobility == mobility


def test_a_loop_that_is_open_at_home_is_refused_with_its_gap():
    """Ranks decided there would mean nothing: a four-bar in one line seems to have two freedoms."""
    text = load_robot("linkages/four-bar").text
    with pytest.raises(
        InputError, match=r"four-bar: closure loop is open by .* mm and .* deg at the posture"
    ):
        sk.closed_mechanism(parse_robot(text.split("[[posture]]")[0]))


def test_a_posture_written_by_eye_is_closed_by_the_nearest_one():
    robot = load_robot("linkages/four-bar")
    exact = np.array(robot.posture("home").q)
    rough = replace(robot, postures=(replace(robot.posture("home"), q=tuple(np.round(exact, 2))),))
    with pytest.raises(InputError, match="closure loop is open"):
        sk.closed_mechanism(rough)
    q = nearest_closed(rough, np.round(exact, 2))
    assert np.abs(q - exact).max() < 0.02
    closed = replace(robot, postures=(replace(robot.posture("home"), q=tuple(q.tolist())),))
    assert sk.closed_mechanism(closed).mobility == 1


def test_bars_that_cannot_meet_have_no_closed_posture():
    text = load_robot("linkages/four-bar").text.replace("ground = 0.20", "ground = 0.50")
    text = text.split("# The posture")[0] + "[[link]]" + text.split("[[link]]", 1)[1].split("[[posture]]")[0]
    with pytest.raises(NoSolutionError, match="four-bar: no closed posture near this one"):
        nearest_closed(parse_robot(text), np.full(4, 0.1))


@pytest.mark.parametrize("name", ["stewart", "rssr", "bennett"])
def test_spatial_postures_are_closed_from_nearby_too(name):
    robot = load_robot(f"linkages/{name}")
    rough = np.array(robot.posture("home").q) + 0.01 * np.cos(np.arange(len(robot.joints)))
    q = nearest_closed(robot, rough)
    posture = replace(robot.posture("home"), q=tuple(q.tolist()))
    assert sk.closed_mechanism(replace(robot, postures=(posture,))).mobility == COUNTS[name][3]


def test_loops_bear_the_names_of_their_closures(mechanisms):
    assert mechanisms["four-bar"].circuit_names == ("loop",)
    assert mechanisms["stewart"].circuit_names == tuple(f"loop_1_{i}" for i in range(2, 7))


def rssr_angle(p, crank):
    """Rocker angle: its ball at the rod's length from the crank's, upper solution."""
    E = 2 * p["rocker"] * (p["ground"] - p["crank"] * np.cos(crank))
    gap = (p["ground"] - p["crank"] * np.cos(crank)) ** 2 + (p["offset"] - p["crank"] * np.sin(crank)) ** 2
    return np.arccos((p["rod"] ** 2 - gap - p["rocker"] ** 2) / E)


@pytest.mark.parametrize("spin", [0.0, 0.7])
def test_the_spatial_rocker_follows_its_closed_form_however_the_rod_spins(mechanisms, spin):
    p = mechanisms["rssr"].robot.parameters
    q, rates = turned(mechanisms["rssr"], "crank", TURN, near_spin=spin)
    np.testing.assert_allclose(q["rocker"], rssr_angle(p, TURN), atol=1e-11)
    np.testing.assert_allclose(q["near_spin"], spin)
    slope = (rssr_angle(p, TURN + 1e-5) - rssr_angle(p, TURN - 1e-5)) / 2e-5
    np.testing.assert_allclose(rates["rocker"], slope, atol=1e-9)


def test_the_rods_idle_spin_moves_nothing_else(mechanisms):
    mechanism = mechanisms["rssr"]
    rates = sk.secondary_rates(mechanism, sk.home(mechanism.robot), [0.0, 1.0])
    assert dict(zip(mechanism.secondary, rates, strict=True)) == pytest.approx(
        {**dict.fromkeys(mechanism.secondary, 0.0), "far_spin": -1.0}, abs=1e-12
    )


def legs_of(robot, T):
    """Slider positions at a platform pose: distances of the points, less the length at home."""
    p = robot.parameters
    lengths = []
    for i in range(1, 7):
        base = np.array([p[f"b_{i}x"], p[f"b_{i}y"], 0.0])
        platform = np.array([p[f"p_{i}x"], p[f"p_{i}y"], 0.0])
        lengths.append(np.linalg.norm(T[:3, :3] @ platform + T[:3, 3] - base) - p["leg"])
    return np.array(lengths)


def platform_poses(count=6):
    from scipy.spatial.transform import Rotation

    rng = np.random.default_rng(2)
    T = np.tile(np.eye(4), (count, 1, 1))
    T[:, :3, :3] = Rotation.from_rotvec(rng.uniform(-0.25, 0.25, (count, 3))).as_matrix()
    T[:, :3, 3] = rng.uniform(-0.05, 0.05, (count, 3)) + np.array([0, 0, 0.35])
    return T


def test_the_platform_goes_where_its_six_legs_put_it(mechanisms):
    mechanism = mechanisms["stewart"]
    wanted = platform_poses()
    legs = np.array([legs_of(mechanism.robot, T) for T in wanted])
    imposed = {f"leg_{i + 1}": legs[:, i] for i in range(6)}
    solution = close_loops(mechanism, sk.home(mechanism.robot), imposed)
    assert (solution.status == Status.CONVERGED).all()
    assert solution.residual.max() < 1e-12
    found = sk.frame_pose(mechanism.robot, solution.state, "platform")
    np.testing.assert_allclose(found, wanted, atol=1e-11)


def test_a_virtual_chain_on_the_platform_gives_its_legs(mechanisms):
    """The inverse problem is another choice of primary couplings: the chain of the platform imposes."""
    robot = mechanisms["stewart"].robot
    center = Pose(UNTURNED, Vector(0, 0, robot.parameters["height"]))
    driven = replace(robot, limbs=(Limb("platform", "arm", "platform", "stage", center, SPATIAL),))
    mechanism = sk.closed_mechanism(driven)
    assert mechanism.primary == tuple(f"stage.{c}" for c in SPATIAL)
    assert (mechanism.mobility, len(mechanism.circuits)) == (6, 6)
    wanted = platform_poses()
    R = wanted[:, :3, :3]
    angles = [np.arctan2(-R[:, 1, 2], R[:, 2, 2]), np.arcsin(R[:, 0, 2]), np.arctan2(-R[:, 0, 1], R[:, 0, 0])]
    imposed = dict(zip(mechanism.primary, [*wanted[:, :3, 3].T, *angles], strict=True))
    solution = close_loops(mechanism, sk.home(driven), imposed)
    assert (solution.status == Status.CONVERGED).all()
    legs = np.array([legs_of(robot, T) for T in wanted])
    np.testing.assert_allclose(solution.state.q[:, :6], legs, atol=1e-12)


def test_leg_rates_of_the_platform_are_projections_of_its_points_velocities(mechanisms):
    """l' = u . (v + omega x r): the platform's inverse Jacobian, from its closed form."""
    mechanism = mechanisms["stewart"]
    robot, p = mechanism.robot, mechanism.robot.parameters
    omega, v = np.array([0.2, -0.3, 0.5]), np.array([0.1, 0.2, -0.1])
    rates = []
    for i in range(1, 7):
        r = np.array([p[f"p_{i}x"], p[f"p_{i}y"], 0.0])
        along = r + np.array([-p[f"b_{i}x"], -p[f"b_{i}y"], p["height"]])
        rates.append(along @ (v + np.cross(omega, r)) / p["leg"])
    found = sk.secondary_rates(mechanism, sk.home(robot), rates)
    q_rates = np.zeros(36)
    q_rates[[robot.joint_names.index(n) for n in mechanism.primary]] = rates
    q_rates[[robot.joint_names.index(n) for n in mechanism.secondary]] = found
    J = sk.jacobian(robot, sk.home(robot), "platform")[:, 6:]
    np.testing.assert_allclose(J @ q_rates, [*omega, *v], atol=1e-12)
