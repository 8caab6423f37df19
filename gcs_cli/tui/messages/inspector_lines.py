"""Lines of the message inspector: messages with rate, count, age and source, and their fields. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from rich.text import Text

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message
from gcs_cli.tui.fly.history import History, StreamKey
from gcs_cli.tui.palette import Palette
from gcs_cli.tui.plot.drawing import value_text
from gcs_cli.vehicle.field_units import enum_text, field_unit, shown_unit, unknown_value

_SILENT_PERIODS, _SILENT_S = 5.0, 3.0
_NAME_CELLS = 36
_MOST_ELEMENTS = 32
"""Longer arrays are shown in one line: they are raw data."""


class MessageRow(NamedTuple):
    """A message type from one source; ``message`` is the last one received."""

    key: StreamKey
    name: str
    rate_hz: float
    received: int
    age_s: float
    message: Message
    plottable: frozenset[str]
    """Numeric fields, as in ``q[2]``."""

    @property
    def is_silent(self) -> bool:
        """True if it has not arrived for several of its periods."""
        return self.age_s > max(_SILENT_S, _SILENT_PERIODS / self.rate_hz if self.rate_hz else 0.0)


class Line(NamedTuple):
    """A line of the list: of a message, or of one of its fields."""

    row: MessageRow
    field: str | None
    text: Text

    @property
    def key(self) -> tuple[StreamKey, str | None]:
        """Identifies the line while values change."""
        return self.row.key, self.field

    @property
    def plot_name(self) -> str | None:
        """Name of the field for the plot; None if it is not numeric."""
        return f"{self.row.name}.{self.field}" if self.field in self.row.plottable else None


def message_rows(history: History, now_s: float) -> list[MessageRow]:
    """Return all messages on the link, by source and name."""
    rows = [
        MessageRow(
            stream.key,
            stream.name,
            history.rate_hz(stream, now_s),
            stream.count,
            max(0.0, now_s - stream.last_s),
            stream.last,
            frozenset(stream.fields),
        )
        for stream in history.streams()
    ]
    return sorted(rows, key=lambda row: (row.key[:2], row.name))


def filtered(rows: Iterable[MessageRow], words: str) -> list[MessageRow]:
    """Return the rows whose message, source or fields contain all ``words``."""
    wanted = words.lower().split()
    return [row for row in rows if all(word in _searched(row) for word in wanted)]


def _searched(row: MessageRow) -> str:
    return f"{row.name} {source_name(row.key)} {' '.join(row.message.fieldnames)}".lower()


def source_name(key: StreamKey) -> str:
    """Return system and component, by name if MAVLink knows it."""
    entry = mavlink.enums["MAV_COMPONENT"].get(key.component_id)
    component = str(key.component_id) if entry is None else entry.name.removeprefix("MAV_COMP_ID_")
    return f"{key.system_id} {component}"


def header(width: int, colours: Palette) -> Text:
    """Return the titles of the columns."""
    return _columns("  message", "rate Hz", "count", "age s", "source", width, f"bold {colours.accent}")


def summary(rows: Sequence[MessageRow], shown: int, words: str, is_paused: bool, colours: Palette) -> Text:
    """Return the line above the list."""
    text = Text(no_wrap=True, end="")
    if is_paused:
        text.append(" PAUSED ", f"bold {colours.background} on {colours.warning}")
        text.append(" ")
    text.append(f"{len(rows)} messages, {sum(row.rate_hz for row in rows):.0f} a second")
    if words:
        text.append(f", {shown} with “{words}”", colours.accent)
    return text


def lines(
    rows: Iterable[MessageRow],
    expanded: frozenset[StreamKey],
    plotted: Sequence[str],
    width: int,
    colours: Palette,
) -> list[Line]:
    """Return the lines of ``rows``, with the fields of those that are expanded."""
    result = []
    for row in rows:
        is_open = row.key in expanded
        style = colours.muted if row.is_silent else colours.text
        cells = (f"{row.rate_hz:.1f}", str(row.received), f"{row.age_s:.1f}", source_name(row.key))
        result.append(
            Line(row, None, _columns(f"{'▾' if is_open else '▸'} {row.name}", *cells, width, style))
        )
        if is_open:
            result += [
                Line(row, field, _field_text(row, field, value, plotted, width, colours))
                for field, value in _elements(row.message)
            ]
    return result


def _columns(name: str, rate: str, count: str, age: str, source: str, width: int, style: str) -> Text:
    cells = max(12, min(_NAME_CELLS, width - 42))
    name = name if len(name) <= cells else name[: cells - 1] + "…"
    return Text(
        f"{name:<{cells}} {rate:>8} {count:>8} {age:>6}  {source}"[:width], style, no_wrap=True, end=""
    )


def _elements(message: Message) -> list[tuple[str, Any]]:
    """Return names and values of the fields; short arrays by element."""
    result: list[tuple[str, Any]] = []
    for name in message.fieldnames:
        value = getattr(message, name)
        if isinstance(value, list | tuple) and len(value) <= _MOST_ELEMENTS:
            result += [(f"{name}[{index}]", element) for index, element in enumerate(value)]
        else:
            result.append((name, value))
    return result


def _field_text(
    row: MessageRow, field: str, value: Any, plotted: Sequence[str], width: int, colours: Palette
) -> Text:
    text = Text(no_wrap=True, end="")
    is_plotted = f"{row.name}.{field}" in plotted
    text.append("  ● " if is_plotted else "    ", colours.accent)
    text.append(f"{field:<{max(10, min(_NAME_CELLS, width // 2) - 4)}} ", colours.muted)
    shown, note = field_texts(row.message, field, value)
    text.append(shown, f"bold {colours.text}")
    text.append(f"  {note}" if note else "", colours.accent)
    text.truncate(width, overflow="ellipsis")
    return text


def field_texts(message: Message, field: str, value: Any) -> tuple[str, str]:
    """Return the value with MAVLink's unit, and what it means: a name, or the value in a plain unit."""
    unit = field_unit(message, field)
    if isinstance(value, float):
        shown = f"{value:.7g}"
    elif isinstance(value, list | tuple):
        shown = " ".join(str(element) for element in value)
    else:
        shown = str(value)
    if not isinstance(value, int | float):
        return shown, ""
    if value == unknown_value(message, field):
        return f"{shown} {unit}", "unknown"
    factor, plain_unit = shown_unit(unit)
    meaning = enum_text(message, field, value)
    if not meaning and plain_unit != unit:
        scaled = value * factor
        meaning = f"{scaled:.7f} {plain_unit}" if unit == "degE7" else f"{value_text(scaled)} {plain_unit}"
    return f"{shown} {unit}".rstrip(), meaning
