"""``gcs watch``: the live state of the vehicle, full screen on a terminal, else as lines."""

from __future__ import annotations

import os
import sys

import typer

from flightstack.process.command_line import expand_options, make_app
from gcs_cli.link.connection import Connection
from gcs_cli.link.subscription import ROTORS_AND_TIMING
from gcs_cli.settings import LinkOptions, link_options
from gcs_cli.tui.watch_lines import state_line, text_line
from gcs_cli.vehicle_link import open_link

app = make_app(add_completion=False)

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


def watch_screen(connection: Connection) -> None:
    """Show the full-screen view until the user quits."""
    from gcs_cli.tui.app import WatchApp
    from gcs_cli.tui.feed import Feed

    WatchApp(Feed(connection)).run()


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
