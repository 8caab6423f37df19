"""The terminal view: from a vehicle's state to a screen. Pure."""

from __future__ import annotations

from rich.align import Align
from rich.console import Group, RenderableType
from rich.layout import Layout
from rich.table import Table
from rich.text import Text

from gcs_cli.tui.panels import (
    UNKNOWN,
    attitude_panel,
    clock_text,
    framed,
    message_lines,
    messages_panel,
    mission_panel,
    number,
    position_panel,
    rotors_panel,
)
from gcs_cli.tui.timing_panels import timing_line, timing_panel
from gcs_cli.vehicle.view_types import VehicleView

_NARROW, _LOW = 72, 20
_WIDE = 110
_POSITION, _ROTORS = 26, 24
_LANDED = {1: "on ground", 2: "in air", 3: "taking off", 4: "landing"}
_GOOD_LINK, _POOR_LINK = 0.98, 0.9


def render(view: VehicleView, now_s: float, width: int, height: int, link_name: str = "") -> RenderableType:
    """Draw ``view`` as of ``now_s`` on a screen of ``width`` × ``height`` cells."""
    if view.identity is None:
        return _waiting(link_name, height)
    if width < _NARROW or height < _LOW:
        return _compact(view, now_s, width, height)
    return _wide(view, now_s, width, height) if width >= _WIDE else _standard(view, now_s, width, height)


def _waiting(link_name: str, height: int) -> RenderableType:
    text = Text("Waiting for a vehicle's heartbeat", style="bold", justify="center")
    if link_name:
        text.append(f"\non {link_name}", style="not bold cyan")
    text.append("\n\nq quits", style="not bold bright_black")
    return Align.center(text, vertical="middle", height=height)


def _standard(view: VehicleView, now_s: float, width: int, height: int) -> Layout:
    top = 10 if height < 28 else 12 if height < 36 else 15
    left = width - _POSITION - _ROTORS
    messages = height - top - 8
    layout = _frame(view, now_s, width)
    layout["body"].split_column(
        Layout(name="top", size=top),
        Layout(mission_panel(view), size=3),
        Layout(timing_line(view.timing), size=3),
        Layout(messages_panel(view, width, messages - 2)),
    )
    layout["top"].split_row(
        Layout(attitude_panel(view, left, top), size=left),
        Layout(position_panel(view), size=_POSITION),
        Layout(rotors_panel(view, _ROTORS), size=_ROTORS),
    )
    return layout


def _wide(view: VehicleView, now_s: float, width: int, height: int) -> Layout:
    top = min(16, max(10, height * 2 // 5))
    column = width // 5
    left = width - 3 * (column + 2)
    messages = height - top - 5
    layout = _frame(view, now_s, width)
    layout["body"].split_column(
        Layout(name="top", size=top),
        Layout(mission_panel(view), size=3),
        Layout(messages_panel(view, width, messages - 2)),
    )
    layout["top"].split_row(
        Layout(attitude_panel(view, left, top), size=left),
        Layout(position_panel(view), size=column + 2),
        Layout(rotors_panel(view, column + 2), size=column + 2),
        Layout(timing_panel(view.timing, column + 2), size=column + 2),
    )
    return layout


def _frame(view: VehicleView, now_s: float, width: int) -> Layout:
    layout = Layout()
    layout.split_column(
        Layout(_header(view, now_s), size=1), Layout(name="body"), Layout(_footer(view, width), size=1)
    )
    return layout


def _header(view: VehicleView, now_s: float) -> Table:
    bar = Table.grid(expand=True, padding=(0, 1))
    bar.add_column(no_wrap=True)
    bar.add_column(justify="center", no_wrap=True)
    bar.add_column(justify="right", no_wrap=True)
    state = Text()
    state.append(f" {view.mode or 'unknown mode'} ", style="bold white on blue")
    state.append(" ARMED " if view.armed else " DISARMED ", style=_armed_style(view.armed))
    state.append(f" {_LANDED.get(view.landed_state, '')}")
    clock = Text(f"t {clock_text(view.time_s)}", style="bold")
    if view.timing is not None and view.timing.real_time_factor is not None:
        clock.append(f"  ×{view.timing.real_time_factor:.1f}", style="cyan")
    bar.add_row(state, clock, link_text(view, now_s))
    return bar


def _armed_style(armed: bool) -> str:
    return "bold white on red" if armed else "bold white on green"


def link_text(view: VehicleView, now_s: float) -> Text:
    """Link quality; the reason if the vehicle is gone."""
    if view.powered_off:
        return Text(" SHUT DOWN ", style="bold black on yellow")
    if view.lost(now_s):
        return Text(f" VEHICLE LOST for {view.silent_s(now_s):.0f} s ", style="bold white on red")
    quality = view.link.quality or 0.0
    style = "green" if quality >= _GOOD_LINK else "yellow" if quality >= _POOR_LINK else "red"
    text = Text("● ", style=style)
    text.append("link 100%" if quality == 1.0 else f"link {quality:.1%}", style="bold")
    text.append(f"  {number(view.link.rate_hz, 0)} msg/s ", style="bright_black")
    return text


def _footer(view: VehicleView, width: int) -> Text:
    assert view.identity is not None
    text = Text(no_wrap=True)
    text.append(" q", style="bold cyan")
    text.append(" quit   ", style="bright_black")
    text.append(f"{view.identity.kind} {view.identity.system_id}", style="bright_black")
    if view.home is not None and width >= _WIDE:
        home = view.home
        text.append(
            f"   home {home.latitude_deg:.7f}° {home.longitude_deg:.7f}° {home.altitude_m:.1f} m",
            style="bright_black",
        )
    lost, received = view.link.lost, view.link.received
    if lost:
        text.append(f"   {lost} messages lost of {received + lost}", "bright_black")
    return text


def _compact(view: VehicleView, now_s: float, width: int, height: int) -> RenderableType:
    """Draw the view for a window too small for panels."""
    position, mission = view.position_ned_m, view.mission
    place, item = "—", "none loaded"
    if position is not None:
        ned = (position.x, position.y, -position.z)
        place = " ".join(f"{round(value, 1) + 0.0:.1f}" for value in ned) + " m"  # no -0.0
    if mission.total:
        item = mission.item_text or f"item {UNKNOWN}"
    state = f"{view.mode}  {'ARMED' if view.armed else 'disarmed'}  t {clock_text(view.time_s)}"
    rows: list[RenderableType] = [
        Text(state, style="bold", no_wrap=True, overflow="ellipsis"),
        link_text(view, now_s),
        Text(f"north east up {place}", no_wrap=True, overflow="ellipsis"),
        Text(f"mission {item}", no_wrap=True, overflow="ellipsis"),
    ]
    texts = [line for entry in view.texts for line in message_lines(entry, width - 4)]
    rows += texts[-max(1, height - 2 - len(rows)) :]
    return framed("gcs watch", Group(*rows[: max(1, height - 2)]))
