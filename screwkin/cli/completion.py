"""Completion in the shell: what it asks while a line is typed, and the script by which it asks."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, get_type_hints

import typer

from screwkin.cli import APP, COMPLETION, OPTIONS, VERBS, verb_app
from screwkin.cli.completers import VALUES
from screwkin.cli.output import say
from screwkin.errors import one_of

NAME = "screwkin"
SHELLS = ("bash", "zsh", "fish", "powershell", "pwsh")


def answer() -> int:
    """Print what the shell asks for while a line is typed."""
    try:
        completion_app()(args=[], prog_name=NAME)
    except SystemExit as end:
        return int(end.code or 0)
    return 0


def script(install: bool, shell: str = "") -> int:
    """Install the script by which a shell asks, or print it.

    Args:
        install: into the shell's own folder, and its start-up file.
        shell: one of ``SHELLS``; empty: the one that this command runs in.

    Raises:
        UnknownNameError: no such shell, or none is recognised.
    """
    from typer._completion_shared import get_completion_script
    from typer._completion_shared import install as installed

    shell = one_of("shell", shell or _own_shell(), SHELLS)
    if install:
        _, path = installed(shell, NAME, COMPLETION)
        say(f"completion for {shell} is in {path}; a new terminal has it")
    else:
        print(get_completion_script(prog_name=NAME, complete_var=COMPLETION, shell=shell))
    return 0


def _own_shell() -> str:
    """The shell that runs this command; empty if it cannot be said."""
    import shellingham

    try:
        return str(shellingham.detect_shell()[0])
    except shellingham.ShellDetectionFailure:
        return ""


def completion_app() -> Any:
    """All verbs as one typer application; only the one on the shell's line is loaded."""
    app = typer.Typer(**{**APP, "add_completion": True})  # it also teaches typer the shells
    app.callback()(_group)
    verb = _verb_on_line()
    for name, text in VERBS.items():
        loaded = verb_app(name) if name == verb else None
        if loaded is None:
            app.command(name, help=text)(_unloaded)
        else:
            for command in loaded.registered_commands:
                _complete_values(name, command.callback)
            if loaded.registered_callback:
                app.add_typer(loaded, name=name)
            else:
                app.command(name, help=text)(loaded.registered_commands[0].callback)
    return app


def _complete_values(verb: str, function: Callable[..., int]) -> None:
    """Let typer ask for the values of a verb's parameters."""
    kinds = get_type_hints(function, include_extras=True)
    for name, kind in kinds.items():
        values = VALUES.get(f"{verb} {name}") or VALUES.get(name)
        for mark in getattr(kind, "__metadata__", ()):
            mark.autocompletion = values
    function.__annotations__.update(kinds)  # evaluated once: else typer would make other marks of their text


def _verb_on_line() -> str | None:
    """The verb of the line that is being typed, once a blank ends it."""
    line = os.environ.get("COMP_WORDS") or os.environ.get("_TYPER_COMPLETE_ARGS", "")
    words = [word for word in line.split() if word not in OPTIONS]
    return words[1] if len(words) > 1 and words[1] in VERBS else None


def _unloaded() -> None:
    """A verb that nobody asks about."""


def _group(
    quiet: bool = typer.Option(False, "--quiet", help=OPTIONS["--quiet"]),
    no_color: bool = typer.Option(False, "--no-color", help=OPTIONS["--no-color"]),
    debug: bool = typer.Option(False, "--debug", help=OPTIONS["--debug"]),
    version: bool = typer.Option(False, "--version", help=OPTIONS["--version"]),
) -> None:
    """Options that stand before any verb."""
