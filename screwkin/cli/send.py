"""``screwkin send``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from screwkin.analysis.engines import simulated_on
from screwkin.analysis.readiness import Ready, ready
from screwkin.cli.folder import output_folder
from screwkin.cli.governed import feedback_wanted, governed_by_imu, governed_virtually, imu_port
from screwkin.cli.injected import Faults, FormerFaults, Seed, injected_faults
from screwkin.cli.options import AsJson, OutputFolder, TrajectoryPath
from screwkin.cli.output import print_json, remark, say
from screwkin.cli.playing import log_of, played, played_on_port
from screwkin.errors import InputError, UnknownNameError
from screwkin.gait.compensation import way_of
from screwkin.gait.feed_forward import walking_torques
from screwkin.gait.intended import intended
from screwkin.servo.budget import ADAPTER, budget
from screwkin.servo.bus import Bus
from screwkin.servo.frames import Frames
from screwkin.servo.gate import Bounds
from screwkin.servo.guarded import OwnGuard, Place
from screwkin.servo.leave import EndState
from screwkin.servo.player import PlayOutcome, PlaySettings, describe
from screwkin.servo.servo_map import ServoMap
from screwkin.servo.virtual.bus import SimulatedClock, VirtualBus
from screwkin.servo.virtual.faults import InjectedFault
from screwkin.servo.virtual.load import PlannedLoad
from screwkin.servo.virtual.robot import virtual_servos
from screwkin.servo.watch import Thresholds

_STATES: tuple[EndState, ...] = ("hold", "limp")
_INTERRUPTED = 130
_REFUSED = 4
_LONGEST_NOTICE = 2.0  # s
_RETURN_DELAY = 500e-6  # s, of a servo as it comes from the maker


def send(
    trajectory: TrajectoryPath,
    port: Annotated[str, typer.Option(help="Serial port of the servos, as /dev/ttyUSB0.")] = "",
    virtual: Annotated[bool, typer.Option("--virtual", help="Play to virtual servos.")] = False,
    go: Annotated[bool, typer.Option("--go", help="Move; without it nothing is opened.")] = False,
    robot: Annotated[str, typer.Option(help="The robot's table, if it is not a bundled one.")] = "",
    rate: Annotated[float, typer.Option(help="Frames per second.")] = 50.0,
    torque: Annotated[float, typer.Option(help="Share of the servos' torque, 0 to 1.")] = 1.0,
    far: Annotated[float, typer.Option(help="Farthest a joint may be from its first goal, rad.")] = 1.0,
    notice: Annotated[
        float, typer.Option(help="Seconds within which a blocked joint must be noticed.")
    ] = Thresholds.notice,
    on_fault: Annotated[str, typer.Option(help="After a fault: hold or limp.")] = "hold",
    at_end: Annotated[str, typer.Option(help="After the last frame: hold or limp.")] = "hold",
    feedback: Annotated[
        str,
        typer.Option(
            metavar="imu:PORT",
            help="Walk with the stabiliser, by the IMU on that port, as far from the plan as "
            "validate --feedback --runs allows; with --virtual: imu:virtual.",
        ),
    ] = "",
    rs485: Annotated[bool, typer.Option("--rs485", help="Let the kernel switch direction.")] = False,
    inject_fault: Faults = None,
    former: FormerFaults = None,
    seed: Seed = 0,
    output: OutputFolder = None,
    as_json: AsJson = False,
) -> int:
    """Play a validated trajectory to the servos: a dry run that opens nothing, unless --go.

    Writes play.npz, a log of commands and measurements. With --virtual all is done in simulated time. Exit
    code 4 where the trajectory is refused, a fault stopped it, or a servo did not confirm how it was left;
    130 where it was interrupted.
    """
    if port and virtual:
        raise InputError("--port and --virtual are two buses; choose one")
    if go and not (port or virtual):
        raise InputError("--go needs a bus: --port /dev/ttyUSB0, or --virtual")
    faults = injected_faults(inject_fault, former)
    if faults and not virtual:
        raise InputError("--inject-fault is for virtual servos; add --virtual")
    settings = PlaySettings(
        rate=rate,
        torque=torque,
        far=_distance(far),
        on_fault=_state(on_fault),
        at_end=_state(at_end),
        thresholds=Thresholds(notice=_notice(notice)),
    )
    imu = imu_port(feedback, bool(port)) if feedback else ""
    may = ready(trajectory, robot or None, settings)
    servos, bounds, frames = may.servos, may.bounds, may.frames
    carried = budget(bounds.profiles, servos.baud)
    if rate > carried.limit:
        raise InputError(f"--rate {rate:g} Hz is more than the bus carries: {carried.limit:.0f} Hz")
    facts: dict[str, Any] = {
        "robot": may.robot.name,
        "moved": go,
        "rate": rate,
        "bus_limit_hz": carried.limit,
        "full_read_hz": carried.full_rate,
        "reads_per_frame": carried.reads(rate),
        "deviation_mm": 1e3 * may.deviation,
    }
    wanted = feedback_wanted(trajectory, may, rate, imu) if imu else None
    if wanted is not None:
        facts |= {"feedback": imu, "feedback_bound_rad": max(wanted.bound.deviation.values())}
    if not go:
        _print_dry(trajectory, frames, bounds, facts, as_json)
        return 0
    with output_folder(output, "send", may.robot.name) as folder:
        log = folder / "play.npz"
        if port:
            place = Place(port, servos.baud, rs485, servos.protocol)
            with governed_by_imu(wanted) as governor:
                outcome = played_on_port(may, settings, log, place, governor)
        else:
            bus, guard, follow = virtual_bus(may, faults, seed)
            governor = governed_virtually(wanted, bus) if wanted else None
            outcome = played(bus, may, settings, log, {"port": "virtual"}, guard, follow, governor)
        facts["log"] = str(log_of(log))
    return _print_outcome(outcome, facts, bounds, as_json)


def virtual_bus(
    may: Ready, faults: Sequence[InjectedFault] = (), seed: int = 0
) -> tuple[Bus, OwnGuard, Callable[[float], None]]:
    """Virtual servos in simulated time, their guard, and what must be called with the share that was played.

    They stand in the robot's posture ``home``, or at zero. Where the verdict rests on motors, each is as
    stiff as its motor, and loaded by what the plan asks of it.
    """
    robot, clock = may.robot, SimulatedClock()
    servos, motors = ServoMap.of(robot), simulated_on(may.verdict.servo).motors_of(robot)
    stiffness = {name: float(m.stiffness) for name, m in zip(robot.joint_names, motors, strict=False)}
    mounted = virtual_servos(robot, stiffness=stiffness or None, return_delay=_RETURN_DELAY)
    follow: Callable[[float], None] = _unloaded
    if way_of(may.commands) != "none":
        plan = intended(robot, may.trajectory)
        load = PlannedLoad(plan.time, walking_torques(robot, plan), robot.joint_names, clock.now)
        load.put_on(mounted, servos)
        follow = load.follow
    line = VirtualBus(mounted, clock, servos.baud, faults, seed, adapter=ADAPTER)
    bus = Bus(line, servos.protocol, servos.baud, clock)
    return bus, OwnGuard(bus, line.reopened), follow


def _unloaded(share: float) -> None:
    """Servos that no load turns need not know how far the plan is."""


def _print_dry(path: Path, frames: Frames, bounds: Bounds, facts: dict[str, Any], as_json: bool) -> None:
    if as_json:
        print_json(
            {"frames": len(frames.q), "late_frames": 0, "max_tracking_error": None, "faults": [], **facts}
        )
        return
    say(
        f"{path}: {len(frames.q)} frames of {len(bounds.ids)} servos at {frames.rate:g} Hz, within limits "
        f"and up to {facts['deviation_mm']:.1f} mm from the validated path\n"
        f"The bus carries at most {facts['bus_limit_hz']:.0f} frames per second, "
        f"{facts['full_read_hz']:.0f} with every servo read in each; "
        f"at {frames.rate:g} Hz it reads {facts['reads_per_frame']} servos per frame.\n"
        "A dry run: nothing was opened. To move: --go with --port or --virtual."
    )


def _print_outcome(outcome: PlayOutcome, facts: dict[str, Any], bounds: Bounds, as_json: bool) -> int:
    message = describe(outcome, bounds.ids)
    if as_json:
        print_json({**outcome.to_dict(), **facts, "message": message})
    else:
        say(
            f"{outcome.frames} frames sent, {outcome.late_frames} late; largest tracking error "
            f"{outcome.max_tracking_error:.3f} rad; log in {facts['log']}"
        )
    if outcome.well:
        if not as_json:
            remark(message)
        return 0
    remark(f"error: {message}")
    kinds = [fault.kind for fault in outcome.faults]
    return _INTERRUPTED if kinds == ["interrupted"] and outcome.known else _REFUSED


def _state(text: str) -> EndState:
    for state in _STATES:
        if text == state:
            return state
    raise UnknownNameError("state of the servos", text, _STATES)


def _notice(seconds: float) -> float:
    if not 0.0 < seconds <= _LONGEST_NOTICE:
        raise InputError(f"--notice {seconds!r} is no time; expected seconds up to {_LONGEST_NOTICE:g}")
    return seconds


def _distance(far: float) -> float:
    if not far > 0.0:
        raise InputError(f"--far {far!r} is no distance; expected rad above 0, such as 1")
    return far
