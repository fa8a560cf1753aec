"""All pictures of a report, in their order on the page."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from screwkin.analysis.account import Account
from screwkin.analysis.validate import Validation
from screwkin.report import balance, frames, motion, servos, simulation
from screwkin.report.style import Figure, save_figure, styled
from screwkin.servo.log import PlayLog


@dataclass(frozen=True)
class Saved:
    """A picture that was written: its file, what it shows, and the heading under which it stands."""

    path: Path
    section: str
    caption: str


@dataclass(frozen=True)
class Plot:
    """A picture to draw: file name without suffix, heading, caption, and what draws it, or None."""

    name: str
    section: str
    caption: str
    draw: Callable[[], Figure | None]


def save_pictures(
    account: Account,
    folder: Path,
    check: Validation | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> list[Saved]:
    """Draw and write all pictures of an account, and of its simulation if there was one.

    Raises:
        OutputError: a file cannot be written; those before it are complete.
    """
    plots = _of_the_walk(account, check) + (_of_the_simulation(account, check) if check else [])
    return _saved(plots, folder, progress)


def save_balance_pictures(account: Account, folder: Path) -> list[Saved]:
    """Draw and write what concerns the ZMP: its way seen from above, along both axes, and its margin.

    Raises:
        OutputError: a file cannot be written.
    """
    seen = [plot for plot in _motion(account) if plot.name == "top_view"]
    return _saved([*seen, *_balance(account)], folder)


def save_servo_pictures(account: Account, folder: Path, log: PlayLog) -> list[Saved]:
    """Draw and write what servos did, from the log of a play.

    Raises:
        OutputError: a file cannot be written.
    """
    caption = (
        "What was commanded to the servos (lines) and what they answered (dots), joint by joint of the legs; "
        "below, how far every joint was from its goal."
    )
    return _saved([Plot("tracking", "The servos", caption, lambda: servos.tracking(account, log))], folder)


def _saved(
    plots: list[Plot], folder: Path, progress: Callable[[float], None] = lambda share: None
) -> list[Saved]:
    saved = []
    for k, plot in enumerate(plots):
        with styled():
            figure = plot.draw()
            if figure is not None:
                path = save_figure(figure, folder / f"{plot.name}.png")
                saved.append(Saved(path, plot.section, plot.caption))
        progress((k + 1) / len(plots))
    return saved


def _of_the_walk(account: Account, check: Validation | None) -> list[Plot]:
    """The gait paper's figures 6 to 13 redrawn, and what it does not show."""
    cycle = "over one cycle of two steps" if len(account.boundaries) > 4 else "over the motion"
    if check is not None:
        shots = Plot(
            "frames",
            "The walk",
            f"Frames of the simulation {cycle} (the paper's figure 10).",
            lambda: frames.frames_of_run(account, check.run),
        )
    else:
        shots = Plot(
            "frames",
            "The walk",
            f"The plan {cycle}, seen from the right, feet and hands in the colours of the plots "
            "(the paper's figure 10).",
            lambda: frames.frames_drawn(account),
        )
    return [shots, *_motion(account), *_balance(account)]


def _motion(account: Account) -> list[Plot]:
    the_walk, joints = "The walk", "Joints"
    return [
        Plot(
            "top_view",
            the_walk,
            "Seen from above: where the soles stand, the support polygons, and the ways of GCoM (the centre "
            "of mass, projected on the floor) and ZMP (the zero-moment point, where the floor's force acts).",
            lambda: balance.seen_from_above(account),
        ),
        Plot(
            "feet_x",
            the_walk,
            "Feet along x (the paper's figure 6): each swings while the other stands.",
            lambda: motion.feet_along_x(account),
        ),
        Plot("feet_z", the_walk, "Height of the feet (figure 7).", lambda: motion.feet_along_z(account)),
        Plot(
            "waist_x",
            the_walk,
            "The waist along x (figure 8), and its speed: jumps of its slope cause ZMP spikes.",
            lambda: motion.waist_along_x(account),
        ),
        Plot(
            "waist_y",
            the_walk,
            "The waist along y (figure 9): it sways over the bearing foot.",
            lambda: motion.waist_along_y(account),
        ),
        Plot("joints", joints, "Joint angles of the legs (figure 13).", lambda: motion.joint_angles(account)),
        Plot("joints_arms", joints, "Joint angles of the arms.", lambda: motion.joint_angles(account, "arm")),
        Plot(
            "singular_values",
            joints,
            "How far every limb is from a singularity: the least singular value of its block of the network "
            "matrix, made dimensionless by the robot's size.",
            lambda: balance.singular_values_over_time(account),
        ),
    ]


def _balance(account: Account) -> list[Plot]:
    section = "Balance"
    return [
        Plot(
            "zmp_y",
            section,
            "GCoM against ZMP along y (figure 11), over the extent of the support polygon.",
            lambda: balance.zmp_against_gcom(account, 1),
        ),
        Plot(
            "zmp_x",
            section,
            "GCoM against ZMP along x (figure 12).",
            lambda: balance.zmp_against_gcom(account, 0),
        ),
        Plot(
            "margin",
            section,
            "Margin: how deep the ZMP lies inside the support polygon. Below, how far it is from the GCoM; a "
            "spike is a local maximum above twice the median.",
            lambda: balance.margin_over_time(account),
        ),
    ]


def _of_the_simulation(account: Account, check: Validation) -> list[Plot]:
    section = "Simulation"
    return [
        Plot(
            "contact_zmp",
            section,
            "The floor's answer: ZMP from contact forces (mean over 50 ms) against the plan.",
            lambda: simulation.contact_zmp(account, check),
        ),
        Plot(
            "upright",
            section,
            "Tilt of the base, and how far it is from where the plan has it.",
            lambda: simulation.uprightness(account, check),
        ),
        Plot(
            "servos",
            section,
            "What the motion asks of every servo, in per cent of its limit.",
            lambda: simulation.servo_use(account, check),
        ),
    ]
