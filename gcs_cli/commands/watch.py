"""``gcs watch``: the vehicle live on the terminal, or as lines where there is no terminal."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING

import typer

from gcs_cli.settings import ConnectOption, InstanceOption, TimeoutOption, open_link, settings_of

if TYPE_CHECKING:
    from rich.console import Console, RenderableType

    from gcs_cli.link.connection import Connection

FRAME_S = 0.125
LINE_S = 1.0


def watch(
    context: typer.Context,
    connect: ConnectOption = None,
    timeout: TimeoutOption = None,
    instance: InstanceOption = None,
) -> None:
    """Watch the vehicle; q or Ctrl-C ends."""
    from gcs_cli.link.subscription import ROTORS_AND_TIMING  # noqa: PLC0415

    settings = settings_of(context).merged(connect, timeout, instance)
    with open_link(settings) as connection:
        connection.session.subscribe(ROTORS_AND_TIMING)
        try:
            if _draws():
                watch_screen(connection)
            else:
                if settings.timeout_s is not None:
                    connection.meet(settings.patience_s)
                watch_lines(connection)
        except KeyboardInterrupt:
            return


def _draws() -> bool:
    """Tell whether stdout is a terminal that can be drawn on."""
    return sys.stdout.isatty() and os.environ.get("TERM") not in ("dumb", "unknown")


def watch_screen(connection: Connection) -> None:
    """Draw the full-screen view until q is pressed."""
    from rich.console import Console  # noqa: PLC0415
    from rich.live import Live  # noqa: PLC0415

    from gcs_cli.tui.keyboard import Keyboard  # noqa: PLC0415

    console = Console()
    with Keyboard() as keyboard, Live(console=console, screen=True, auto_refresh=False) as live:
        while not keyboard.pressed("q"):
            live.update(_picture(connection, console), refresh=True)
            _run(connection, connection.now_s + FRAME_S)


def _picture(connection: Connection, console: Console) -> RenderableType:
    from gcs_cli.tui.watch_render import render  # noqa: PLC0415

    width, height = console.size
    return render(connection.session.view, connection.now_s, width, height, str(connection.endpoint))


def _run(connection: Connection, until_s: float) -> None:
    while connection.now_s < until_s:
        connection.step(until_s)


def watch_lines(connection: Connection) -> None:
    """Print a line a second and one for each status text, until interrupted."""
    from gcs_cli.tui.watch_lines import state_line, text_line  # noqa: PLC0415

    seen = 0
    next_s = connection.now_s
    while True:
        view = connection.session.view
        for entry in view.texts_since(seen):
            print(text_line(entry), flush=True)
        seen = view.text_count
        if connection.now_s >= next_s:
            print(state_line(view, connection.now_s), flush=True)
            next_s += LINE_S
        connection.step(next_s)
