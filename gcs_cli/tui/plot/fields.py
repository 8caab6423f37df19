"""The fields that the user plots, as curves from the history. Shared by the screens that offer fields."""

from __future__ import annotations

from functools import partial

import numpy as np

from flightstack.mavlink.link import Message
from gcs_cli.tui.fly.history import History, Stream
from gcs_cli.tui.plot.drawing import CURVE_COLOURS, Curve, value_text
from gcs_cli.tui.plot.field_picker import Choice
from gcs_cli.vehicle.field_units import enum_text, field_unit, field_value, shown_unit, shown_values

FIRST_FIELDS = ("ATTITUDE.roll", "ATTITUDE.pitch", "VFR_HUD.alt", "VFR_HUD.groundspeed")
MOST_FIELDS = len(CURVE_COLOURS)


class PlotFields:
    """Names of fields such as ``ATTITUDE.roll``; each keeps its colour while others come and go."""

    def __init__(self) -> None:
        self._colours = dict(zip(FIRST_FIELDS, CURVE_COLOURS, strict=False))

    @property
    def names(self) -> tuple[str, ...]:
        """The plotted fields in the order in which they were added."""
        return tuple(self._colours)

    def colour(self, name: str) -> str | None:
        """Return the colour of a plotted field, else None."""
        return self._colours.get(name)

    def add(self, name: str) -> bool:
        """Plot a field; return False if the most are plotted already."""
        if name not in self._colours:
            free = [colour for colour in CURVE_COLOURS if colour not in self._colours.values()]
            if not free:
                return False
            self._colours[name] = free[0]
        return True

    def remove(self, name: str) -> None:
        """Plot a field no more."""
        self._colours.pop(name, None)

    def clear(self) -> None:
        """Plot nothing."""
        self._colours.clear()

    def curves(self, history: History, system_id: int | None) -> list[Curve]:
        """Return the curves; fields that were not received have no samples."""
        streams = {stream.name: stream for stream in history.streams(system_id)}
        return [
            _curve(history, streams.get(name.partition(".")[0]), name, system_id, colour)
            for name, colour in self._colours.items()
        ]


def _curve(history: History, stream: Stream | None, name: str, system_id: int | None, colour: str) -> Curve:
    series = history.series(name, system_id)
    if stream is None:
        return Curve(name, "", series.times_s, series.values, colour)
    field = name.partition(".")[2]
    _, unit = shown_unit(field_unit(stream.last, field))
    return Curve(name, unit, series.times_s, shown_values(stream.last, field, series.values), colour)


def value_note(message: Message, field: str) -> str:
    """Return a field's value in the shown unit, or the name of an enumeration's value."""
    value = field_value(message, field)
    unit = field_unit(message, field)
    if not unit and isinstance(value, int):
        return enum_text(message, field, value) or str(value)
    shown = shown_values(message, field, np.array([value], dtype=np.float64))[0]
    return f"{value_text(float(shown))} {shown_unit(unit)[1]}"


def _last_note(stream: Stream, field: str) -> str:
    return value_note(stream.last, field)


def field_choices(history: History, system_id: int | None, fields: PlotFields) -> list[Choice]:
    """Return all fields that were received, with their last values, then the plotted ones that were not."""
    choices = []
    for stream in history.streams(system_id):
        for field in stream.fields:
            name = f"{stream.name}.{field}"
            note = partial(_last_note, stream, field)
            choices.append(Choice(name, note, fields.colour(name)))
    received = {choice.name for choice in choices}
    choices += [
        Choice(name, lambda: "not received", fields.colour(name))
        for name in fields.names
        if name not in received
    ]
    return choices
