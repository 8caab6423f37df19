"""``gcs messages``: the status texts of the vehicle as they arrive."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import typer

from flightstack.core.enums import Severity
from flightstack.mavlink.text_file import PastText
from flightstack.process.command_line import expand_options, make_app
from gcs_cli.errors import USAGE, CliError
from gcs_cli.link.connection import Connection
from gcs_cli.output import Output
from gcs_cli.settings import LinkOptions, output_of
from gcs_cli.transfers.past_texts import fetch_past_texts, texts_before
from gcs_cli.vehicle.view_types import StatusText
from gcs_cli.vehicle_link import DurationOption, connect_vehicle, follow

app = make_app(add_completion=False)

PAST = 10
"""Past texts that are shown by default."""
LEVELS = tuple(severity.name.lower() for severity in Severity)
LevelOption = Annotated[
    str,
    typer.Option(
        "--level",
        metavar="SEVERITY",
        help=f"Least severity: {', '.join(LEVELS)}.",
        autocompletion=lambda: list(LEVELS),
    ),
]
PastOption = Annotated[
    int,
    typer.Option(
        "--past",
        metavar="N",
        min=0,
        help="Begin with the last N texts that the vehicle keeps; PX4 and ArduPilot keep none.",
    ),
]


@app.command()
@expand_options
def messages(
    context: typer.Context,
    link: LinkOptions,
    level: LevelOption = "debug",
    count: Annotated[
        int | None, typer.Option("--count", metavar="N", min=1, help="End after N texts.", show_default=False)
    ] = None,
    duration: DurationOption = None,
    past: PastOption = PAST,
) -> None:
    """Print the status texts of the vehicle until Ctrl-C.

    First come those that were sent before the command began, which --count does not count. MAVLink repeats no text:
    they are read from a file of the vehicle, which only this flight stack has. A recording's texts are printed at once.
    """
    if level.lower() not in LEVELS:
        raise CliError(f"messages: --level {level}: choose one of {', '.join(LEVELS)}", USAGE)
    output = output_of(context, link)
    with connect_vehicle(
        context, link, takes_recording=True, in_real_time=False, shares=True, several=True
    ) as connection:
        printer = TextPrinter(connection, output, LEVELS.index(level.lower()), count)
        if past and not connection.is_recording and len(connection.fleet.sessions) == 1:
            printer.print_past(fetch_past_texts(connection), past)
        follow(connection, duration, printer.print_new)


class TextPrinter:
    """Prints texts of all vehicles up to a severity, ``count`` at most."""

    def __init__(self, connection: Connection, output: Output, worst: int, count: int | None) -> None:
        self._connection = connection
        self._output = output
        self._least_severe = worst
        self._left = count
        self._seen: dict[int, int] = {}

    def print_past(self, texts: Sequence[PastText], most: int) -> None:
        """Print the last ``most`` of the texts that the vehicle sent before the first one received."""
        session = self._connection.session
        received = session.view.texts_since(0)
        shown = [text for text in texts_before(texts, received) if text.severity <= self._least_severe]
        for text in shown[-most:]:
            self._say(session.target[0], text.time_s, text.severity, text.text, past=True)

    def print_new(self) -> bool:
        """Print the texts that are new; return True once enough are printed."""
        fleet = self._connection.fleet
        chosen = fleet.chosen
        for number, session in fleet.sessions.items():
            if chosen not in (None, number):
                continue
            for entry in session.view.texts_since(self._seen.get(number, 0)):
                if self._left != 0 and entry.severity <= self._least_severe:
                    self._print(number, entry)
            self._seen[number] = session.view.text_count
        return self._left == 0

    def _print(self, system: int, entry: StatusText) -> None:
        self._say(system, entry.vehicle_time_s, entry.severity, entry.text, past=False)
        if self._left is not None:
            self._left -= 1

    def _say(self, system: int, time_s: float | None, severity: int, text: str, *, past: bool) -> None:
        name = LEVELS[min(severity, len(LEVELS) - 1)]
        at = "" if time_s is None else f"{time_s:.1f} s  "
        sender = f"system {system}  " if len(self._connection.fleet.sessions) > 1 else ""
        self._output.say(
            "message",
            f"{at}{sender}{name}: {text}",
            time_s=time_s,
            system=system,
            severity=name,
            text=text,
            past=past,
        )
