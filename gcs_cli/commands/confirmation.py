"""Questions before dangerous commands: asked on a terminal, elsewhere answered by ``--yes``."""

from __future__ import annotations

import contextlib
import sys
import threading
from collections.abc import Iterator
from typing import Annotated

import typer

from gcs_cli.errors import USAGE, CliError
from gcs_cli.link.connection import Connection

_STEP_S = 0.1

YesOption = Annotated[bool, typer.Option("--yes", "-y", help="Do not ask.")]


def confirm(question: str, yes: bool, connection: Connection | None = None) -> None:
    """Ask on a terminal before a dangerous action; raise CliError if the answer is no or no one can be asked.

    ``connection`` stays alive while the user thinks.
    """
    if yes:
        return
    if sys.stdin is None or not sys.stdin.isatty():
        raise CliError(f"{question}: add --yes", USAGE)
    with contextlib.nullcontext() if connection is None else kept_alive(connection):
        # typer.confirm writes a space to stdout
        typer.echo(f"{question}. Continue? [y/N]: ", nl=False, err=True)
        answer = sys.stdin.readline()
    if answer.strip().lower() not in ("y", "yes"):
        raise CliError("cancelled: nothing was changed")


def confirm_if_armed(connection: Connection, change: str, yes: bool) -> None:
    """Ask before a change of what an armed vehicle flies by; ``change`` is a clause. Raise CliError."""
    if connection.session.view.armed:
        confirm(f"the vehicle is armed, and {change}", yes, connection)


@contextlib.contextmanager
def kept_alive(connection: Connection) -> Iterator[None]:
    """Exchange messages in a thread while the user types: without heartbeats the vehicle would lose the link."""
    stopped = threading.Event()

    def run() -> None:
        while not stopped.is_set():
            connection.step(connection.now_s + _STEP_S)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    try:
        yield
    finally:
        stopped.set()
        thread.join()
