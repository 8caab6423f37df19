"""``gcs listen``: MAVLink messages of the vehicle as they arrive, or a list of all that are sent."""

from __future__ import annotations

from collections import Counter
from typing import Annotated, Any, NamedTuple

import typer

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message
from flightstack.process.command_line import expand_options, make_app
from gcs_cli.completion import message_names
from gcs_cli.errors import NO_ANSWER, USAGE, CliError
from gcs_cli.link.connection import Connection
from gcs_cli.output import Output
from gcs_cli.settings import LinkOptions, link_options, output_of
from gcs_cli.vehicle.message_fields import FieldError, check_fields, message_class, shown, values_of
from gcs_cli.vehicle_link import DurationOption, connect_vehicle, follow

app = make_app(add_completion=False)

_LIST_S = 3.0
_SET_INTERVAL = int(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL)


MessageArgument = Annotated[
    str | None,
    typer.Argument(
        metavar="[MESSAGE]", help="Name or id; without it, list all messages.", autocompletion=message_names
    ),
]
FieldOption = Annotated[
    list[str] | None, typer.Option("--field", metavar="NAME", help="Print only this field; may be repeated.")
]
RateOption = Annotated[
    float | None,
    typer.Option("--rate", metavar="HZ", min=0.01, max=1000.0, help="Request this rate.", show_default=False),
]
CountOption = Annotated[
    int | None, typer.Option("--count", metavar="N", min=1, help="End after N messages.", show_default=False)
]


class _Wanted(NamedTuple):
    """Messages to print: their kind, fields, requested rate and number."""

    kind: type
    fields: tuple[str, ...]
    rate_hz: float | None
    most: int | None


@app.command()
@expand_options
def listen(
    context: typer.Context,
    link: LinkOptions,
    message: MessageArgument = None,
    field: FieldOption = None,
    rate: RateOption = None,
    count: CountOption = None,
    duration: DurationOption = None,
) -> None:
    """Print messages of the vehicle, one a line, until Ctrl-C.

    Without MESSAGE, list every message on the link with its rate and sender, counted for 3 s. Values are printed alone
    with one --field, and with tabs between several. A rate that was requested is set back at the end.
    """
    output = output_of(context, link)
    wanted = _wanted(message, tuple(field or ()), rate, count)
    timeout_s = link_options(context, link).timeout_s
    with connect_vehicle(
        context, link, takes_recording=True, in_real_time=False, shares=True, several=rate is None
    ) as connection:
        if wanted is None:
            _list(connection, output, _LIST_S if duration is None else duration)
        else:
            _print(connection, output, wanted, timeout_s, duration)


def _wanted(
    message: str | None, fields: tuple[str, ...], rate_hz: float | None, count: int | None
) -> _Wanted | None:
    """Return what to print, None for the list of all messages; raise CliError (usage)."""
    if message is None:
        if fields or rate_hz is not None or count is not None:
            raise CliError("listen: --field, --rate and --count need a MESSAGE", USAGE)
        return None
    try:
        kind = message_class(message)
        check_fields(kind, fields)
    except FieldError as error:
        raise CliError(f"listen: {error}", USAGE) from None
    return _Wanted(kind, fields, rate_hz, count)


def _print(
    connection: Connection, output: Output, wanted: _Wanted, timeout_s: float, duration_s: float | None
) -> None:
    """Print the wanted messages as they are received."""
    kind: Any = wanted.kind
    printer = _Printer(connection, output, int(kind.id), wanted.fields, wanted.most)
    _request(connection, kind, wanted.rate_hz)
    try:
        _await_first(connection, printer, kind.msgname, timeout_s, wanted.rate_hz, duration_s)
        follow(connection, duration_s, lambda: printer.is_complete)
    except KeyboardInterrupt:
        return
    finally:
        connection.fleet.observe = None
        if wanted.rate_hz is not None:
            connection.send(_interval(connection, int(kind.id), 0.0))


def _request(connection: Connection, kind: Any, rate_hz: float | None) -> None:
    if rate_hz is not None:
        if connection.is_recording:
            raise CliError("listen: a recording takes no --rate", USAGE)
        number, interval_us = float(kind.id), 1e6 / rate_hz
        name = f"listen: {kind.msgname} at {rate_hz:g} Hz"
        connection.command((_SET_INTERVAL, (number, interval_us)), name)


def _interval(connection: Connection, number: int, interval_us: float) -> Message:
    """Return the request for an interval; 0: the vehicle's default."""
    rest = (0.0, 0.0, 0.0, 0.0, 0.0)
    return mavlink.MAVLink_command_long_message(
        *connection.session.target, _SET_INTERVAL, 0, float(number), interval_us, *rest
    )


def _await_first(
    connection: Connection,
    printer: _Printer,
    name: str,
    timeout_s: float,
    rate_hz: float | None,
    duration_s: float | None,
) -> None:
    """Wait for the first message; raise CliError (no answer)."""
    wait_s = timeout_s if duration_s is None else min(timeout_s, duration_s)
    if not connection.wait_for(lambda: printer.printed > 0, 1e9 if connection.is_recording else wait_s):
        hint = ": request it with --rate" if rate_hz is None and not connection.is_recording else ""
        raise CliError(f"listen: no {name} within {wait_s:g} s{hint}", NO_ANSWER)


class _Printer:
    """Prints the messages of one kind as they are received."""

    def __init__(
        self, connection: Connection, output: Output, number: int, fields: tuple[str, ...], count: int | None
    ) -> None:
        self._connection = connection
        self._output = output
        self._number = number
        self._fields = fields
        self._count = count
        self.printed = 0
        connection.fleet.observe = self._take

    @property
    def is_complete(self) -> bool:
        """True once ``count`` messages are printed."""
        return self.printed == self._count

    def _take(self, message: Message, _now_s: float) -> None:
        system, component = message.get_srcSystem(), message.get_srcComponent()
        if message.get_msgId() != self._number or self.is_complete:
            return
        if self._connection.fleet.chosen not in (None, system):
            return
        self.printed += 1
        values = values_of(message)
        names = self._fields or tuple(values)
        parts = [shown(message, name) for name in names]
        if self._fields:
            sentence = "\t".join(parts)
        else:
            pairs = "  ".join(f"{name} {part}" for name, part in zip(names, parts, strict=True))
            sentence = f"{message.get_type()}  {pairs}"
        self._output.say(
            "received",
            sentence,
            message=message.get_type(),
            system=system,
            component=component,
            unix_s=round(self._connection.unix_s, 6),
            fields={name: values[name] for name in names},
        )


def _list(connection: Connection, output: Output, duration_s: float) -> None:
    """Print each message on the link with its rate and sender."""
    counts: Counter[tuple[int, int, int, str]] = Counter()
    began_s = connection.now_s

    def take(message: Message, _now_s: float) -> None:
        number = message.get_header().msgId
        counts[message.get_srcSystem(), message.get_srcComponent(), number, message.get_type()] += 1

    connection.fleet.observe = take
    follow(connection, None if connection.is_recording else duration_s, lambda: False)
    connection.fleet.observe = None
    span_s = max(connection.now_s - began_s, 1e-3)
    width = max((len(name) for *_, name in counts), default=0)
    for (system, component, number, name), received in sorted(counts.items()):
        output.say(
            "stream",
            f"{system:>3}/{component:<3}  {number:>5}  {name:<{width}}  {received / span_s:8.1f} Hz",
            message=name,
            message_id=number,
            system=system,
            component=component,
            rate_hz=round(received / span_s, 3),
        )
