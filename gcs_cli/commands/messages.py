"""``gcs messages``: the status texts of the vehicle as they arrive."""

from __future__ import annotations

from typing import Annotated

import typer

from flightstack.core.enums import Severity
from flightstack.process.command_line import expand_options, make_app
from gcs_cli.commands.following import DurationOption, follow
from gcs_cli.errors import USAGE, CliError
from gcs_cli.link.connection import Connection
from gcs_cli.output import Output
from gcs_cli.settings import LinkOptions, output_of
from gcs_cli.vehicle.view_types import StatusText
from gcs_cli.vehicle_link import connect_vehicle

app = make_app(add_completion=False)

LEVELS = tuple(severity.name.lower() for severity in Severity)


@app.command()
@expand_options
def messages(
    context: typer.Context,
    link: LinkOptions,
    level: Annotated[
        str,
        typer.Option(
            "--level",
            metavar="SEVERITY",
            help=f"Least severity: {', '.join(LEVELS)}.",
            autocompletion=lambda: list(LEVELS),
        ),
    ] = "debug",
    count: Annotated[
        int | None, typer.Option("--count", metavar="N", min=1, help="End after N texts.", show_default=False)
    ] = None,
    duration: DurationOption = None,
) -> None:
    """Print the status texts of the vehicle until Ctrl-C.

    A recording's texts are printed at once.
    """
    if level.lower() not in LEVELS:
        raise CliError(f"messages: --level {level}: choose one of {', '.join(LEVELS)}", USAGE)
    output = output_of(context, link)
    with connect_vehicle(
        context, link, takes_recording=True, in_real_time=False, shares=True, several=True
    ) as connection:
        printer = _Printer(connection, output, LEVELS.index(level.lower()), count)
        follow(connection, duration, printer.print_new)


class _Printer:
    """Prints texts of all vehicles up to a severity, ``count`` at most."""

    def __init__(self, connection: Connection, output: Output, worst: int, count: int | None) -> None:
        self._connection = connection
        self._output = output
        self._least_severe = worst
        self._left = count
        self._seen: dict[int, int] = {}

    def print_new(self) -> bool:
        """Print the texts that are new; return True once enough are printed."""
        fleet = self._connection.fleet
        chosen = fleet.chosen
        for number, session in fleet.sessions.items():
            if chosen not in (None, number):
                continue
            for entry in session.view.texts_since(self._seen.get(number, 0)):
                if self._left != 0 and entry.severity <= self._least_severe:
                    self._print(number, entry, names_system=len(fleet.sessions) > 1)
            self._seen[number] = session.view.text_count
        return self._left == 0

    def _print(self, system: int, entry: StatusText, names_system: bool) -> None:
        severity = LEVELS[min(entry.severity, len(LEVELS) - 1)]
        at = "" if entry.vehicle_time_s is None else f"{entry.vehicle_time_s:.1f} s  "
        name = f"system {system}  " if names_system else ""
        self._output.say(
            "message",
            f"{at}{name}{severity}: {entry.text}",
            time_s=entry.vehicle_time_s,
            system=system,
            severity=severity,
            text=entry.text,
        )
        if self._left is not None:
            self._left -= 1
