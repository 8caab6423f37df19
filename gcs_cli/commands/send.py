"""``gcs send``: any MAVLink message to the vehicle."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from flightstack.mavlink.link import Message
from flightstack.process.command_line import expand_options, make_app
from gcs_cli.completion import message_names
from gcs_cli.errors import USAGE, CliError
from gcs_cli.link import calls
from gcs_cli.link.connection import Connection
from gcs_cli.settings import LinkOptions, output_of
from gcs_cli.vehicle.message_fields import FieldError, made_message, shown, values_of
from gcs_cli.vehicle_link import connect_vehicle

app = make_app(add_completion=False)

_PARAMS = tuple(f"param{number}" for number in range(1, 8))


@app.command()
@expand_options
def send(
    context: typer.Context,
    link: LinkOptions,
    message: Annotated[str, typer.Argument(help="Name or id.", autocompletion=message_names)],
    fields: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[FIELD=VALUE]...", help="Fields that are not zero; the target is the vehicle."
        ),
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option(
            "--rate", metavar="HZ", min=0.01, max=1000.0, help="Repeat at this rate.", show_default=False
        ),
    ] = None,
    count: Annotated[int, typer.Option("--count", metavar="N", min=1, help="Number of repetitions.")] = 1,
) -> None:
    """Send a MAVLink message to the vehicle.

    Enumerations may be given by name, flags joined by |, arrays with commas. A COMMAND_LONG or COMMAND_INT waits for
    the vehicle's answer. Put -- before the message if a value begins with a dash.
    """
    output = output_of(context, link)
    words = tuple(fields or ())
    _made(message, words, (0, 0))  # refuses wrong words before a vehicle is searched
    with connect_vehicle(context, link) as connection:
        made, given = _made(message, words, connection.session.target)
        name = made.msgname
        if name in ("COMMAND_LONG", "COMMAND_INT") and _is_for_vehicle(connection, made):
            _command(connection, made)
            answer = f", {shown(made, 'command')} accepted"
        else:
            _repeat(connection, made, count, rate)
            answer = "" if count == 1 else f", {count} times"
        sent = "  ".join(f"{field} {shown(made, field)}" for field in given)
        values = values_of(made)
    output.say(
        "sent", f"sent {name}{'  ' if sent else ''}{sent}{answer}", message=name, fields=values, count=count
    )


def _made(name: str, words: tuple[str, ...], target: tuple[int, int]) -> tuple[Message, dict[str, Any]]:
    try:
        return made_message(name, words, target)
    except FieldError as error:
        raise CliError(f"send: {error}", USAGE) from None


def _is_for_vehicle(connection: Connection, message: Message) -> bool:
    return (message.target_system, message.target_component) == connection.session.target


def _command(connection: Connection, message: Message) -> None:
    session, now_s = connection.session, connection.now_s
    if message.msgname == "COMMAND_LONG":
        params = [getattr(message, name) for name in _PARAMS]
        call = calls.command(session, message.command, params, now_s)
    else:
        params = [getattr(message, name) for name in _PARAMS[:4]]
        position = (message.x, message.y, message.z, message.frame)
        call = calls.command_int(session, message.command, params, *position, now_s)
    connection.complete(call, f"send: {shown(message, 'command')}")


def _repeat(connection: Connection, message: Message, count: int, rate_hz: float | None) -> None:
    due_s = connection.now_s
    for _ in range(count):
        connection.wait_for(lambda: False, due_s - connection.now_s)
        connection.send(message)
        due_s += 0.0 if rate_hz is None else 1.0 / rate_hz
