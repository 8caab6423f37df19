"""The line at the top of each screen: mode, armed, landed state, vehicle, time and link. Pure."""

from __future__ import annotations

from rich.text import Text

from gcs_cli.tui.fly.panels import clock_text
from gcs_cli.tui.palette import Palette
from gcs_cli.vehicle.field_units import number
from gcs_cli.vehicle.view_types import VehicleView

_LANDED = {1: "on ground", 2: "in air", 3: "taking off", 4: "landing"}
_GOOD_LINK, _POOR_LINK = 0.98, 0.9


def status_line(
    view: VehicleView,
    now_s: float,
    width: int,
    _height: int,
    colours: Palette,
    *,
    vehicles: int = 1,
    commands_all: bool = False,
) -> list[Text]:
    """Return the line, as much of it as ``width`` holds, with the number of ``vehicles`` on the link."""
    if view.identity is None:
        return [Text(" waiting for a vehicle", f"bold {colours.warning}")]
    right = link_text(view, now_s, colours)
    left = Text(no_wrap=True, overflow="crop")
    left.append(f" {view.mode or 'unknown mode'} ", f"bold {colours.background} on {colours.accent}")
    armed = colours.bad if view.armed else colours.good
    left.append(" ARMED " if view.armed else " DISARMED ", f"bold {colours.background} on {armed}")
    if commands_all:
        left.append(f" COMMANDS TO ALL {vehicles} ", f"bold {colours.background} on {colours.target}")
    if view.in_failsafe:
        left.append(" FAILSAFE ", f"bold {colours.background} on {colours.warning}")
    among = f" of {vehicles}" if vehicles > 1 else ""
    parts = [
        (f" {_LANDED.get(view.landed_state, '')}", colours.text),
        (f"  {view.identity.kind} {view.identity.system_id}{among}", colours.muted),
        (f"  t {clock_text(view.time_s)}", colours.text),
    ]
    if view.timing is not None and view.timing.real_time_factor is not None:
        parts.append((f"  ×{view.timing.real_time_factor:.1f}", colours.accent))
    for text, style in parts:
        if len(left) + len(text) + len(right) <= width and text.strip():
            left.append(text, style)
    left.append(" " * max(1, width - len(left) - len(right)))
    left.append_text(right)
    left.truncate(width)
    return [left]


def link_text(view: VehicleView, now_s: float, colours: Palette) -> Text:
    """Return share of received messages, rate and round trip of the link; the reason if the vehicle is gone."""
    alarm = f"bold {colours.background} on "
    if view.powered_off:
        return Text(" SHUT DOWN ", alarm + colours.warning)
    if view.lost(now_s):
        return Text(f" VEHICLE LOST for {view.silent_s(now_s):.0f} s ", alarm + colours.bad)
    quality = view.link.quality or 0.0
    style = (
        colours.good if quality >= _GOOD_LINK else colours.warning if quality >= _POOR_LINK else colours.bad
    )
    text = Text("● ", style)
    text.append("100%" if quality == 1.0 else f"{quality:.1%}", f"bold {colours.text}")
    text.append(f"  {number(view.link.rate_hz, 0)} msg/s ", colours.muted)
    if view.link.round_trip_s is not None:
        text.append(f" {1e3 * view.link.round_trip_s:.0f} ms ", colours.muted)
    return text
