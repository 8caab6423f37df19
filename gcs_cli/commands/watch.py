"""``gcs watch``: the live state of the vehicle, full screen on a terminal, else as lines."""

from __future__ import annotations

import os
import select
import sys
import termios
import tty
from typing import Any

import typer
from rich.console import Console
from rich.live import Live

from flightstack.process.command_line import expand_options, make_app
from gcs_cli.link.connection import Connection
from gcs_cli.link.subscription import ROTORS_AND_TIMING
from gcs_cli.settings import LinkOptions, link_options
from gcs_cli.tui.watch_lines import state_line, text_line
from gcs_cli.tui.watch_render import render
from gcs_cli.vehicle_link import open_link

app = make_app(add_completion=False)

FRAME_S = 0.125
LINE_S = 1.0


@app.command()
@expand_options
def watch(context: typer.Context, link: LinkOptions) -> None:
    """Watch the vehicle; q or Ctrl-C ends."""
    chosen = link_options(context, link)
    with open_link(context, link, takes_recording=True, shares=True) as connection:
        connection.session.subscribe(ROTORS_AND_TIMING)
        try:
            if _can_draw():
                watch_screen(connection)
            else:
                if chosen.timeout is not None:
                    connection.wait_for_vehicle(chosen.timeout)
                watch_lines(connection)
        except KeyboardInterrupt:
            return


def _can_draw() -> bool:
    """Return True if stdout is a terminal that can draw."""
    return sys.stdout.isatty() and os.environ.get("TERM") not in ("dumb", "unknown")


class Keyboard:
    """Reads single keys from the terminal without waiting or echo, within the ``with`` block.

    If stdin is not a terminal, no key is ever pressed.
    """

    def __init__(self) -> None:
        self._descriptor = sys.stdin.fileno() if sys.stdin is not None and sys.stdin.isatty() else None
        self._before: list[Any] = []

    def pressed(self, key: str) -> bool:
        """Return True if ``key``, in either case, was pressed since the last call."""
        if self._descriptor is None or not select.select([self._descriptor], [], [], 0)[0]:
            return False
        return key in os.read(self._descriptor, 1024).decode(errors="replace").lower()

    def __enter__(self) -> Keyboard:
        if self._descriptor is not None:
            self._before = termios.tcgetattr(self._descriptor)
            tty.setcbreak(self._descriptor)
        return self

    def __exit__(self, *_: object) -> None:
        if self._descriptor is not None:
            termios.tcsetattr(self._descriptor, termios.TCSADRAIN, self._before)


def watch_screen(connection: Connection) -> None:
    """Draw the full-screen view until q is pressed."""
    console = Console()
    with Keyboard() as keyboard, Live(console=console, screen=True, auto_refresh=False) as live:
        while not keyboard.pressed("q"):
            now_s, (width, height) = connection.now_s, console.size
            live.update(
                render(connection.session.view, now_s, width, height, str(connection.endpoint)), refresh=True
            )
            while connection.now_s < now_s + FRAME_S:
                connection.step(now_s + FRAME_S)


def watch_lines(connection: Connection) -> None:
    """Print one line per second and one per status text, until interrupted."""
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
