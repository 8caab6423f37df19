"""The fields that the user plots, as curves from the history. Shared by the screens that offer fields."""

from __future__ import annotations

from gcs_cli.tui.history import History, Stream
from gcs_cli.tui.plot_drawing import CURVE_COLOURS, Curve
from gcs_cli.vehicle.field_units import field_unit, shown_unit, shown_values

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


def field_choices(history: History, system_id: int | None, fields: PlotFields) -> list[Choice]:
    """Return all fields that were received, the plotted ones first, with their last values."""
    choices = []
    for stream in history.streams(system_id):
        last = stream.last_row()
        for index, field in enumerate(stream.fields):
            name = f"{stream.name}.{field}"
            _, unit = shown_unit(field_unit(stream.last, field))
            value = shown_values(stream.last, field, last[1 + index : 2 + index])[0]
            choices.append(Choice(name, f"{value_text(value)} {unit}", fields.colour(name)))
    received = {choice.name for choice in choices}
    choices += [Choice(name, "not received", fields.colour(name)) for name in fields.names if name not in received]
    return choices
