"""Run a connection for commands that print what vehicles send, until their end."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated

import typer

from flightstack.process.command_line import IN_OUTPUT
from gcs_cli.link.connection import Connection

LONGEST_S = 1e7
_STEP_S = 0.1

DurationOption = Annotated[
    float | None,
    typer.Option(
        "--duration",
        metavar="SECONDS",
        min=0.0,
        max=LONGEST_S,
        help="End after this time.  [default: at Ctrl-C]",
        show_default=False,
        **IN_OUTPUT,
    ),
]


def follow(connection: Connection, duration_s: float | None, has_ended: Callable[[], bool]) -> None:
    """Exchange messages until ``has_ended``, for ``duration_s``, to the end of a recording, or until Ctrl-C.

    ``has_ended`` is called after each step.
    """
    end_s = math.inf if duration_s is None else connection.now_s + duration_s
    try:
        while not has_ended() and connection.now_s < end_s and not connection.ended:
            connection.step(min(end_s, connection.now_s + _STEP_S))
        has_ended()
    except KeyboardInterrupt:
        return
