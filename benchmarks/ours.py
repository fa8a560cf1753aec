"""This library's contestants: for every workload a function from its inputs to named ways to compute it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, TypeVar

import numpy as np

import screwkin as sk
from benchmarks.contest import Contestant, Contestants, Result
from benchmarks.workloads import Dynamic, Motion, Reach, Stance
from screwkin.analysis.workspace import workspace
from screwkin.compiler.emit_python import run_numpy
from screwkin.compiler.native import shared_from
from screwkin.compiler.program import Program
from screwkin.compiler.records import identifier
from screwkin.compiler.run import machine_code, python_function
from screwkin.compiler.run import run as kernel
from screwkin.dynamics import quantities
from screwkin.dynamics.on_floor import ground_reaction
from screwkin.ik import programs as limbs
from screwkin.mechanism.tip_motion import motion_program
from screwkin.model.robot import Robot

Array = Any
T = TypeVar("T")

NAME = "screwkin"


PLAIN, PREPARED = f"{NAME}, public functions", f"{NAME}, public functions, prepared"


def prepared(robot: Robot, *quantities: str) -> Robot:
    """A copy of the robot, of which some functions are compiled."""
    copy = replace(robot)
    sk.prepare(copy, *quantities)
    return copy


def rates(robot: Robot, given: Motion) -> Contestants:
    """W1."""

    def direct(robot: Robot) -> Contestant:
        one = len(given.q) == 1
        own = (lambda x: x[0]) if one else (lambda x: x)
        state, waist = sk.State(own(given.T_world_base), own(given.q)), own(given.waist)
        tips = {tip: own(x) for tip, x in given.tips.items()}

        def run() -> Any:
            return sk.tip_poses(robot, state), sk.joint_rates(robot, state, waist, tips)

        def result(found: Any) -> Result:
            poses, qd = found
            return {"poses": poses.reshape(len(given.q), -1, 4, 4), "rates": qd.reshape(len(given.q), -1)}

        run()
        return Contestant(run, result)

    def public(robot: Robot) -> Contestant:
        mechanism, state = sk.closed_mechanism(robot), sk.State(given.T_world_base, given.q)
        if len(given.q) == 1:
            state = sk.State(given.T_world_base[0], given.q[0])
        waist, tips = (
            (given.waist, given.tips)
            if len(given.q) > 1
            else (given.waist[0], {tip: x[0] for tip, x in given.tips.items()})
        )
        joints = [mechanism.secondary.index(name) for name in robot.joint_names]

        def run() -> Any:
            poses = [sk.frame_pose(robot, state, limb.tip) for limb in robot.limbs]
            primary = sk.virtual_motion(mechanism, state, waist, tips)
            return poses, sk.secondary_rates(mechanism, state, primary)

        def result(found: Any) -> Result:
            poses, secondary = found
            stacked = np.stack(poses, axis=-3).reshape(len(given.q), -1, 4, 4)
            return {"poses": stacked, "rates": secondary[..., joints].reshape(len(given.q), -1)}

        run()
        return Contestant(run, result)

    compiled = prepared(robot, "tip_poses", "joint_rates", "frame_pose", "virtual_motion", "secondary_rates")
    plain = {PLAIN: direct(robot), PREPARED: direct(compiled)}
    plain |= {f"{PLAIN}, closed mechanism": public(robot), f"{PREPARED}, closed mechanism": public(compiled)}
    return {**plain, **_bound(robot, given), **_rate_kernels(robot, given)}


def _bound(robot: Robot, given: Motion) -> Contestants:
    """The same by one bound function, with its checks, and without any."""
    one = len(given.q) == 1
    own = (lambda x: np.ascontiguousarray(x[0])) if one else np.ascontiguousarray
    state = sk.State(own(given.T_world_base), own(given.q))
    arrays = {"base_twist": own(given.waist), "tip_twists": {tip: own(x) for tip, x in given.tips.items()}}
    both = sk.bind(robot, "tip_poses", "joint_rates")
    call, filled = both.in_place(state, **arrays)

    def result(found: Any) -> Result:
        count = len(given.q)
        return {
            "poses": found.tip_poses.reshape(count, -1, 4, 4),
            "rates": found.joint_rates.reshape(count, -1),
        }

    return {
        f"{NAME}, bind": Contestant(lambda: both(state, **arrays), result),
        f"{NAME}, bind, unchecked": Contestant(call, lambda _: result(filled)),
    }


def _twice(
    robot: Robot, run: Callable[[Robot], Any], result: Callable[[Any], Result], *names: str
) -> Contestants:
    """Public functions, of a robot as loaded and of one that was prepared."""
    contestants = {}
    for name, body in ((PLAIN, robot), (PREPARED, prepared(robot, *names))):
        ask = partial(run, body)
        ask()
        contestants[name] = Contestant(ask, result)
    return contestants


def _rate_kernels(robot: Robot, given: Motion) -> Contestants:
    """The same by the compiled program, on every path that this computer has."""
    program = motion_program(robot)
    told = {"T_world_base": given.T_world_base, "q": given.q, "base_twist": given.waist}
    told |= {identifier("twist", tip): values for tip, values in given.tips.items()}
    count = len(given.q)
    flat = [np.ascontiguousarray(told[g.name].reshape(count, g.size)) for g in program.inputs]
    filled = [np.empty((count, g.size)) for g in program.outputs]

    def result(_: Any) -> Result:
        named = dict(zip((g.name for g in program.outputs), filled, strict=True))
        return {"poses": named["T_world_tip"].reshape(count, -1, 4, 4), "rates": named["qd"]}

    contestants = {}
    compiled = machine_code(program)
    if compiled is not None:
        alone = replace(compiled, cores=1)
        contestants[f"{NAME}, C kernel, one core"] = Contestant(alone.bound(flat, filled), result)
        if count >= shared_from(program):
            contestants[f"{NAME}, C kernel, all cores"] = Contestant(compiled.bound(flat, filled), result)
    if count == 1:
        function, sample = python_function(program), [array[0].tolist() for array in flat]

        def told_once(lists: Any) -> Result:
            poses, qd, _ = (np.array(values) for values in lists)
            return {"poses": poses.reshape(1, -1, 4, 4), "rates": qd[None]}

        contestants[f"{NAME}, generated Python"] = Contestant(lambda: function(*sample), told_once)
        return contestants
    contestants[f"{NAME}, NumPy kernel"] = Contestant(lambda: run_numpy(program, flat, filled), result)
    from screwkin.compiler import emit_jax, xla_call

    fused, called = (
        _jax(program, flat, made, first)
        for made, first in ((emit_jax.function(program), False), (xla_call.xla_function(program), True))
    )
    return contestants | {
        f"{NAME}, JAX fused by XLA, all cores": fused,
        f"{NAME}, JAX calling machine code, all cores": called,
    }


def _jax(program: Program, flat: list[Array], function: Any, first: bool) -> Contestant:
    """The program in JAX, compiled beforehand, the batch first or last; as many threads as JAX was given."""
    import jax

    with jax.enable_x64(True):
        shaped = [a.reshape(len(a), *g.shape) for a, g in zip(flat, program.inputs, strict=True)]
        arrays = [jax.numpy.asarray(a if first else np.moveaxis(a, 0, -1).copy()) for a in shaped]
        compiled = jax.jit(function).lower(*arrays).compile()

    def result(found: Any) -> Result:
        poses, qd, _ = (np.asarray(x) if first else np.moveaxis(np.asarray(x), -1, 0) for x in found)
        return {"poses": poses, "rates": qd}

    return Contestant(lambda: jax.block_until_ready(compiled(*arrays)), result)


def reach(robot: Robot, given: Reach) -> Contestants:
    """W2."""

    def run(robot: Robot) -> Any:
        return sk.limb_ik(robot, given.limb.name, given.target, guess=given.guess, least_squares=False)

    def result(found: Any) -> Result:
        return {"q": found.best, "solved": found.valid.any(axis=-1)}

    program = limbs.limb_nearest(robot, given.limb.name)
    told = {"T_base_tip": given.target, "guess": given.guess}

    def nearest(found: Any) -> Result:
        return {"q": found["q"], "solved": (found["found"] == 1)[:, 0] & (found["error"] <= 1e-11)[:, 0]}

    contestants = _twice(robot, run, result, "limb_ik")
    if machine_code(program) is not None:
        note = "the closed form's branch nearest to the guess"
        contestants[f"{NAME}, C kernel"] = Contestant(lambda: kernel(program, told, path="C"), nearest, note)
    return contestants


def positions(robot: Robot, given: Stance) -> Contestants:
    """W3."""
    targets = {"base": given.T_world_base, **given.tips}
    guess = sk.State(given.T_world_base, given.guess)

    def result(found: Any) -> Result:
        return {"q": found.state.q, "solved": found.status == 0}

    def run(robot: Robot) -> Any:
        return sk.solve_pose(robot, targets, guess)

    return _twice(robot, run, result, "solve_pose")


def balance(robot: Robot, given: Dynamic) -> Contestants:
    """W4."""
    state = sk.State(given.T_world_base, given.q)

    def run(robot: Robot) -> Result:
        zmp, com, _, _ = ground_reaction(
            robot, given.T_world_base, given.q, given.qd, given.qdd, given.twist, given.acceleration
        )
        return {"com": com, "momentum": sk.momentum(robot, state, given.qd, given.twist), "zmp": zmp}

    program = quantities.balance.program(robot)
    told = {"T_world_base": given.T_world_base, "q": given.q, "qd": given.qd, "qdd": given.qdd}
    told |= {"base_twist": given.twist, "base_acceleration": given.acceleration}
    contestants = _twice(robot, run, lambda found: found, "balance", "momentum")
    if machine_code(program) is not None:
        asked = ("com", "momentum", "zmp")
        contestants[f"{NAME}, C kernel"] = Contestant(
            lambda: kernel(program, told, path="C"), lambda found: {name: found[name] for name in asked}
        )
    return contestants


def contacts(robot: Robot, given: Dynamic) -> Contestants:
    """W8."""
    state, feet = sk.State(given.T_world_base, given.q), [robot.limb(sole.limb).tip for sole in robot.soles]
    flags = dict(zip(feet, given.contact.T, strict=True))

    def run(robot: Robot) -> Any:
        moving = (given.qd, given.qdd, flags, None, given.twist, given.acceleration)
        return sk.contact_forces(robot, state, *moving)

    def result(found: Any) -> Result:
        return {"wrenches": found.wrenches, "efforts": found.efforts}

    bound = sk.bind(robot, "contact_distribution", optional=("base_twist", "base_acceleration"))
    weights = np.zeros((len(given.q), len(robot.limbs)))
    weights[:, [robot.tip_names.index(foot) for foot in feet]] = given.contact
    told = {"qd": given.qd, "qdd": given.qdd, "weights": weights}
    told |= {"base_twist": given.twist, "base_acceleration": given.acceleration}
    contestants = _twice(robot, run, result, "contact_distribution")
    return contestants | {f"{NAME}, bind": Contestant(lambda: bound(state, **told), result)}


def gait(robot: Robot, seconds: float, rate: float) -> Contestants:
    """W5: positions, rates, accelerations and ZMP of a walk of about so many seconds."""
    chosen = sk.load_gait("walk").replace(rate=rate)
    steps = max(1, round((seconds - 2 * chosen.ramp * chosen.Tc) / chosen.Tc))

    def result(walked: Any) -> Result:
        return {"time": walked.time, "margin": walked.margin}

    def run(robot: Robot) -> Any:
        return sk.walk(robot, chosen, steps)

    return _twice(robot, run, result, "walk")


def reachable(robot: Robot, limb: str, heights: tuple[float, ...], resolution: float) -> Contestants:
    """W6."""

    def result(maps: Any) -> Result:
        return {"area": np.array([found.area for found in maps])}

    def run(robot: Robot) -> Any:
        return workspace(robot, limb, heights, resolution)

    return _twice(robot, run, result, "workspace")
