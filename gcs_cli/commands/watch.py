"""``gcs watch``: the live state of the vehicle, full screen on a terminal, in a browser, or as lines."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import os
import shutil
import sys
from typing import Annotated

import typer

from flightstack.process import collection
from flightstack.process.command_line import IN_OUTPUT, expand_options, make_app
from flightstack.process.console import complain
from gcs_cli.errors import FAILED, USAGE, CliError
from gcs_cli.link.connection import Connection
from gcs_cli.link.subscription import ROTORS_AND_TIMING
from gcs_cli.output import can_draw
from gcs_cli.settings import DEFAULT_TIMEOUT_S, LinkOptions, link_options, signing_key_of
from gcs_cli.tui.screens import SCREENS
from gcs_cli.tui.watch_lines import state_line, text_line
from gcs_cli.vehicle_link import connect_vehicle, open_link

app = make_app(add_completion=False)

LINE_S = 1.0
EXPLAIN_S = DEFAULT_TIMEOUT_S
"""Time without a vehicle after which lines are explained on stderr."""
GATHER_S = 2.0
"""Time that ``--once`` waits for the vehicle's messages; most arrive several times a second."""
DEFAULT_SERVED = "127.0.0.1:8000"
_MODES = ", ".join(entry.mode for entry in SCREENS)

OnceOption = Annotated[bool, typer.Option("--once", help="Print one screen and exit.", **IN_OUTPUT)]
ScreenOption = Annotated[
    str, typer.Option("--screen", metavar="NAME", help=f"The screen to begin with: {_MODES}.", **IN_OUTPUT)
]
ServeOption = Annotated[
    str | None,
    typer.Option(
        "--serve",
        metavar="HOST:PORT",
        help=f"Serve the view to browsers, for example at {DEFAULT_SERVED}. They can command the vehicle.",
        show_default=False,
        **IN_OUTPUT,
    ),
]


@app.command()
@expand_options
def watch(
    context: typer.Context,
    link: LinkOptions,
    screen: ScreenOption = SCREENS[0].mode,
    once: OnceOption = False,
    serve: ServeOption = None,
) -> None:
    """Watch and command the vehicle; q or Ctrl-C ends.

    On a terminal a full screen, else one line per second and per message.
    """
    if screen not in {entry.mode for entry in SCREENS}:
        raise CliError(f"--screen {screen}: choose one of {_MODES}", USAGE)
    if serve is not None:
        serve_view(serve, [*_link_arguments(context, link), "--screen", screen])
        return
    if once:
        with connect_vehicle(context, link, takes_recording=True) as connection:
            _print_once(connection, screen)
        return
    with open_link(context, link, takes_recording=True, shares=True) as connection:
        connection.fleet.subscribe(ROTORS_AND_TIMING)
        timeout_s = link_options(context, link).timeout
        try:
            if can_draw():
                watch_screen(connection, screen)
            else:
                if timeout_s is not None:
                    connection.wait_for_vehicle(timeout_s)
                watch_lines(connection)
        except KeyboardInterrupt:
            return


def watch_screen(connection: Connection, screen: str = SCREENS[0].mode) -> None:
    """Show the full-screen view until the user quits."""
    from gcs_cli.tui.app import WatchApp
    from gcs_cli.tui.feed import Feed

    _follow_terminal_size()
    feed = Feed(connection)
    view = WatchApp(feed, screen)
    collection.resume()  # of garbage: it would search all modules every few seconds
    view.run()
    if feed.error is not None:
        raise feed.error
    if view.return_code:
        raise typer.Exit(FAILED)


def _follow_terminal_size() -> None:
    """Forget COLUMNS and LINES of the environment: Textual would prefer them to the size of the terminal.

    GNU Readline sets both in any program that loads it, for the programs that it starts.
    """
    with contextlib.suppress(OSError, ValueError):  # not on a terminal
        if os.get_terminal_size(sys.stdout.fileno()).columns > 0:
            os.environ.pop("COLUMNS", None)
            os.environ.pop("LINES", None)


def _print_once(connection: Connection, screen: str) -> None:
    from gcs_cli.tui.feed import Feed
    from gcs_cli.tui.once import print_once

    feed = Feed(connection)

    def is_full() -> bool:
        view = feed.view
        known = (
            view.attitude,
            view.position_ned_m,
            view.geo,
            view.mission.current,
            view.battery,
            view.timing,
        )
        return all(part is not None for part in known)

    print_once(feed, screen, shutil.get_terminal_size(), is_full, GATHER_S)
    if feed.error is not None:
        raise feed.error


def serve_view(address: str, arguments: list[str]) -> None:
    """Serve the view at ``HOST:PORT`` until interrupted; each browser runs ``gcs watch`` with ``arguments``."""
    host, _, port = address.rpartition(":")
    if not (host and port.isascii() and port.isdigit() and 0 < int(port) < 65536):
        raise CliError(f"--serve {address}: expected HOST:PORT, for example {DEFAULT_SERVED}", USAGE)
    try:
        from gcs_cli.tui.serve import WatchServer
    except ImportError:
        raise CliError('--serve needs textual-serve: pip install "flightstack[serve]"', USAGE) from None
    WatchServer([sys.executable, "-m", "gcs_cli", *arguments], host, int(port)).serve()


def _link_arguments(context: typer.Context, link: LinkOptions) -> list[str]:
    """Return the command with the same link."""
    key, chosen = signing_key_of(context), link_options(context, link)
    arguments = [] if key is None else ["--signing-key", str(key)]
    arguments.append("watch")
    for field in dataclasses.fields(chosen):
        value = getattr(chosen, field.name)
        if value is not None and not isinstance(value, bool):
            arguments += [f"--{field.name}", str(value)]
    return arguments


def watch_lines(connection: Connection) -> None:
    """Print one line per second and one per status text, until interrupted."""
    seen = 0
    next_s = connection.now_s
    explain_s = math.inf if connection.is_recording else next_s + EXPLAIN_S
    while not connection.ended:
        view = connection.session.view
        for entry in view.texts_since(seen):
            print(text_line(entry), flush=True)
        seen = view.text_count
        if connection.now_s >= next_s:
            print(state_line(view, connection.now_s), flush=True)
            next_s += LINE_S
        if view.identity is None and connection.now_s >= explain_s:
            complain(f"gcs: watch: {connection.no_vehicle_error(EXPLAIN_S)}; still waiting")
            explain_s = math.inf
        connection.step(next_s)
