"""The browser viewer itself: the only file that talks to viser.

Browsers only write into a mailbox; one loop reads it, keeps the session, and draws. So nothing is shared
between threads but that mailbox, and a slider dragged fast plans for its last value alone.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import redirect_stdout
from io import StringIO
from socket import AF_INET, AF_INET6, socket
from typing import Any

import numpy as np

from screwkin.errors import InputError, needed_for
from screwkin.sim.solids import robot_size
from screwkin.viewer.panel import Mailbox, Panel
from screwkin.viewer.session import Session, advanced, handled, replanned
from screwkin.viewer.stage import Stage

HOST, PORT = "127.0.0.1", 8080
LAST_PORT = 2**16 - 1
PERIOD = 1 / 40
"""Time between two pictures [s] while a motion plays."""
READING = 0.25
"""How often numbers, sliders and plots follow a motion that plays [s]."""
REST = 0.5
"""How long one waits for something to be asked for [s] where nothing moves."""


def serve(
    session: Session,
    host: str = HOST,
    port: int = PORT,
    ready: Callable[[str], None] = lambda url: None,
    going_on: Callable[[], bool] = lambda: True,
) -> None:
    """Show a session in browsers until it is interrupted.

    A robot that walks and has no motion yet is shown first, and then its gait is planned.

    Args:
        session: to begin with.
        host: address to listen at; ``0.0.0.0`` for all of the computer's.
        port: to listen at; the next free one if it is taken.
        ready: called with the address to open, once it answers.
        going_on: asked before every picture.

    Raises:
        MissingDependencyError: viser is not installed. InputError: it cannot listen there.
    """
    with needed_for("The viewer"):
        import viser
    if not 1 <= port <= LAST_PORT:
        raise InputError(f"--port {port}: expected a whole number from 1 to {LAST_PORT}")
    try:
        with socket(AF_INET6 if ":" in host else AF_INET) as probe:
            probe.bind((host, 0))  # viser would wait forever where it cannot listen
        with redirect_stdout(StringIO()):  # it prints its own table of addresses, to the place of ours
            server = viser.ViserServer(host=host, port=port, verbose=False)
    except OSError as error:
        raise InputError(
            f"cannot listen at {host}, port {port}: {error}; give another --host or --port"
        ) from None
    try:
        _prepare(server, session)
        mailbox = Mailbox()
        stage, panel = Stage(server.scene, session), Panel(server.gui, session, mailbox)
        stage.show(session)
        name = f"[{host}]" if ":" in host else "localhost" if host == "0.0.0.0" else host
        ready(f"http://{name}:{server.get_port()}")
        _run(server, session, stage, panel, mailbox, going_on)
    finally:
        server.stop()


def _prepare(server: Any, session: Session) -> None:
    """Floor, light and the place from which one looks first."""
    size = robot_size(session.robot)
    middle = session.T_world_base[:3, 3] * np.array([1.0, 1.0, 0.6])
    server.gui.main_panel.dock_right()
    server.gui.configure_theme(show_logo=False, show_share_button=False)
    server.scene.set_up_direction("+z")
    server.scene.configure_default_lights(cast_shadow=False)  # shadows cost most where no graphics card is
    server.scene.configure_environment_map(None)
    server.scene.add_light_ambient("/ambient", intensity=1.2)
    server.initial_camera.position = tuple(middle + size * np.array([1.05, -1.22, 0.52]))
    server.initial_camera.look_at = tuple(middle)


def _run(
    server: Any, session: Session, stage: Stage, panel: Panel, mailbox: Mailbox, going_on: Callable[[], bool]
) -> None:
    """Handle what is asked for, go on in time, draw; until interrupted."""
    if session.track is None and session.gait is not None:
        session = replanned(session)
    before, said = time.monotonic(), -np.inf
    drawn: Session | None = None
    while going_on():
        asked = mailbox.taken(0.0 if session.clock.playing or drawn is None else REST)
        now = time.monotonic()
        for key, value in asked.items():
            what, _, name = key.partition(" ")
            if what == "mark":
                stage.mark(name, bool(value))
            elif what == "circuit":
                stage.circuit(str(value))
        session = handled(advanced(session, now - before), asked)
        before = now
        if session is not drawn or asked:
            speaks = bool(asked) or not session.clock.playing or now - said >= READING
            with server.atomic():
                stage.show(session)
                if speaks:
                    stage.say(session)
            if speaks:
                said = now
                panel.show(session)
            drawn = session
        if session.clock.playing:
            time.sleep(max(0.0, PERIOD - (time.monotonic() - now)))
