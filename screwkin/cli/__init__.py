"""The command ``screwkin VERB …``: every verb is a module of this package, loaded when it is called.

A verb's module holds a function of the verb's name, whose signature typer reads; it returns the exit code.
0 good; 1 unexpected; 2 bad input or usage; 3 the answer is no; 4 refused for safety; 130 interrupted.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from io import TextIOWrapper
from typing import Any, NoReturn

from screwkin.errors import InputError, OutputError, ScrewkinError, missing_library, near, one_of

VERBS = {
    "demo": "A robot walks: table, mechanism, gait, ZMP, simulation, and a report with pictures.",
    "robots": "List the bundled robots and mechanisms.",
    "gaits": "List the bundled gaits.",
    "info": "Mass, closed mechanism and conditioning of a robot.",
    "check": "Audit a robot: masses, axes, limits, soles, and what simulators would change.",
    "table": "The screw table of a robot; also Markdown, LaTeX and symbolic.",
    "new": "The table of a humanoid from its URDF: limbs, soles and home, from geometry alone.",
    "convert": "Convert a robot between screw tables, URDF and DH tables.",
    "compare": "The screw model of a robot against its Denavit-Hartenberg model.",
    "ik": "Inverse kinematics methods compared on a limb: iterations, coverage, time.",
    "forces": "Efforts and forces that balance loads, or the forces of feet and joints along a trajectory.",
    "walk": "Plan the trajectory of a gait, with plots and a report.",
    "zmp": "Recompute CoM, ZMP, margins and spikes of a trajectory.",
    "validate": "Simulate a trajectory and give a verdict.",
    "sweep": "Simulate a walk under many settings and seeds, and count the falls.",
    "view": "A robot or a motion in the browser: joints to drag, gaits to tune, time to scrub.",
    "workspace": "Where a foot can go, held level, and which joint limit cuts there.",
    "stiffness": "Deflection of a foot on elastic joints, all over its workspace.",
    "codegen": "A robot's formulas as C, for other programs and microcontrollers.",
    "send": "Play a validated trajectory to the servos; a dry run unless --go.",
    "bus": "Servos on a bus, or virtual ones: screwkin bus --help lists the verbs.",
    "doctor": "What of screwkin works on this computer: libraries, engines, compiler, cache, ports.",
    "reproduce": "Every table and figure of a paper, its value beside ours.",
}

APP: Mapping[str, Any] = {
    "add_completion": False,
    "rich_markup_mode": None,  # a rich help would swallow brackets, and cost a tenth of a second
    "pretty_exceptions_enable": False,
}
"""How typer is set up, here and by the verbs that are groups of verbs."""

COMPLETION = "_SCREWKIN_COMPLETE"
"""The variable by which a shell asks for completions, instead of running a verb."""
_INTERRUPTED = 130

OPTIONS = {
    "--help": "Show this message; screwkin VERB --help explains a verb.",
    "--version": "Show the version.",
    "--install-completion": "Let the shell complete verbs, names and options: bash, zsh, fish, PowerShell.",
    "--show-completion": "Show the script that does so.",
    "--quiet": "With any verb: no results, remarks or bars; files, --json, errors and exit code stay.",
    "--no-color": "With any verb: no colours; so does the variable NO_COLOR.",
    "--debug": "With any verb: show the traceback of an error.",
}

_USAGE = """\
Usage: screwkin VERB [ARGUMENTS] [OPTIONS]

Humanoid robots by screw theory: from a screw table to a walking robot.

Verbs:
{verbs}

Options:
{options}

Begin with: screwkin demo"""


def main(argv: Sequence[str] | None = None) -> NoReturn:
    """Run the command line and exit with its code; the entry point of ``screwkin``."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without Unicode is no reason to fail
    sys.exit(run(sys.argv[1:] if argv is None else argv))


def run(argv: Sequence[str]) -> int:
    """Run the command line and return its exit code: every error ends as one message on stderr."""
    try:
        from screwkin.cli.terminal import with_manners

        words = [word for word in argv if word != "--debug"]
        debug = len(words) < len(argv) or bool(os.environ.get("SCREWKIN_DEBUG"))
        with with_manners(words) as words:
            return _run(words, debug)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return _INTERRUPTED


def _run(words: Sequence[str], debug: bool) -> int:
    try:
        code = _dispatch(words)
        sys.stdout.flush()
        return code
    except BrokenPipeError:
        from screwkin.cli.output import drop_output

        drop_output()  # the reader has gone, as in ``screwkin table … | head``
        return 1
    except Exception as error:
        if debug:
            import traceback

            traceback.print_exc()
        return _report(error, words, debug)


def _dispatch(words: Sequence[str]) -> int:
    """Call the verb of a command line."""
    if COMPLETION in os.environ:
        return int(_completion().answer())
    name = words[0] if words else "--help"
    if name in ("--help", "-h", "help"):
        from screwkin.cli.output import aligned, say

        say(_USAGE.format(verbs=aligned([*VERBS.items()], "  "), options=aligned([*OPTIONS.items()], "  ")))
        return 0
    if name == "--version":
        from screwkin import __version__

        print(f"screwkin {__version__}")
        return 0
    if name in ("--install-completion", "--show-completion"):
        return int(_completion().script(name == "--install-completion", *words[1:2]))
    if name.startswith("-"):
        question = near(name, OPTIONS)
        raise InputError(f"unknown option {name}. {question}screwkin --help lists the options and verbs")
    one_of("verb", name, VERBS)
    import typer

    from screwkin.cli.output import remarks_of_robots

    app = verb_app(name)
    try:
        with remarks_of_robots():
            code: Any = app(args=list(words[1:]), prog_name=f"screwkin {name}", standalone_mode=False)
    except typer.Abort:
        code = _INTERRUPTED
    if code == _INTERRUPTED:  # typer's answer to an interrupt, older versions abort
        raise KeyboardInterrupt
    return int(code or 0)


def _completion() -> Any:
    """The module of completion, which knows the verbs."""
    return import_module(f"{__name__}.completion")


def verb_app(name: str) -> Any:
    """The typer application of a verb."""
    import typer

    verb = getattr(import_module(f"screwkin.cli.{name}"), name)
    if isinstance(verb, typer.Typer):
        return verb
    app = typer.Typer(**APP)
    app.command(name)(verb)
    return app


def _meant(error: Any) -> str:
    """What typer says of an option that does not exist, and the nearest one; empty for other errors."""
    option, command = getattr(error, "option_name", None), getattr(error.ctx, "command", None)
    if option is None or command is None or not hasattr(error, "possibilities"):
        return ""
    names = [name for parameter in command.params for name in (*parameter.opts, *parameter.secondary_opts)]
    return f"{error.message}. {near(option, [*names, *OPTIONS])}".rstrip()


def _report(error: Exception, words: Sequence[str], debug: bool) -> int:
    """Print an error as one message, with ``--json`` also as an object on stdout; returns its exit code."""
    if isinstance(error, ModuleNotFoundError) and not str(error.name).startswith("screwkin"):
        error = missing_library(error, f"screwkin {words[0]}")
    if isinstance(error, ScrewkinError):
        code, message = error.exit_code, str(error)
    elif hasattr(error, "format_message"):  # typer's own: an unknown option, a missing argument
        code, message = 2, f"{_meant(error) or error.format_message()} (screwkin {words[0]} --help)"
    else:
        code, message = 1, f"unexpected {type(error).__name__}: {error}"
    from screwkin.cli.terminal import folded

    print(folded(f"error: {message}", sys.stderr), file=sys.stderr)
    if code == 1 and not debug:
        print(f"For the traceback: screwkin {' '.join(words)} --debug", file=sys.stderr)
    if "--json" in words:
        from screwkin.cli.output import print_json

        facts = {"limb": getattr(error, "limb", ""), "sample": getattr(error, "sample", -1)}
        known = {key: value for key, value in facts.items() if value not in ("", -1)}
        with suppress(OutputError):  # the message has been told on stderr
            print_json({"error": message, "exit_code": code, **known})
    return code
