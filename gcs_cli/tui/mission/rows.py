"""The mission as rows: item, leg, altitude, parameters, progress, distance and time to go. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from rich.text import Text

from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.plan import Command, MissionItem, Plan
from gcs_cli.plans.itinerary import DEFAULT_SPEEDS, Itinerary, Stop, home_of_items, itinerary
from gcs_cli.plans.names import any_command_name
from gcs_cli.plans.table import altitude_text, clock, distance, parameters_text
from gcs_cli.tui.palette import Palette
from gcs_cli.tui.widgets.row_list import Cell, Column, row_text, stretched
from gcs_cli.vehicle.view_types import VehicleView

_POSITIONS_FROM = 108
"""Width from which a row shows latitude and longitude."""

_WIDEST = 130


class Progress(NamedTuple):
    """Current item of the vehicle's mission; None if unknown or not in flight."""

    current: int | None = None
    reached: int | None = None
    left_m: float | None = None
    """Horizontal distance from the vehicle to the current item."""


class MissionTable(NamedTuple):
    """A mission with its itinerary."""

    items: tuple[MissionItem, ...]
    flight: Itinerary
    stops: dict[int, Stop]
    home: GeoPoint


def mission_table(plan: Plan, home: GeoPoint | None) -> MissionTable:
    """Return the table of a plan, flown from ``home``."""
    start = home_of_items(plan.items, home or plan.home)
    flight = itinerary(plan.items, start)
    return MissionTable(plan.items, flight, {stop.seq: stop for stop in flight.stops}, start)


def mission_progress(table: MissionTable, view: VehicleView) -> Progress:
    """Return the progress that the vehicle reports, numbered as the items of the table."""
    if view.mission.complete:
        return Progress(reached=len(table.items) - 1)
    current, reached = (
        None if number is None or number >= len(table.items) else number
        for number in (view.mission.current, view.mission.reached)
    )
    stop = None if current is None else table.stops.get(current)
    left_m = None
    if stop is not None and view.geo is not None and view.armed:
        here = LocalFrame(table.home).to_ned(GeoPoint(*view.geo[:2], table.home.altitude_m))
        left_m = 0.0 if stop.place_ne_m is None else math.dist((here.x, here.y), stop.place_ne_m)
    return Progress(current, reached, left_m)


def to_go(table: MissionTable, seq: int, progress: Progress) -> tuple[float, float] | None:
    """Return distance [m] and time [s] to an item: from the vehicle in flight, else from the start of the mission.

    None for an item that is not reached, or lies behind.
    """
    stop = table.stops.get(seq)
    if stop is None or progress.current is None or progress.left_m is None:
        return None if stop is None else (stop.distance_m, stop.time_s)
    current = table.stops.get(progress.current)
    if current is None or seq < progress.current:
        return None
    approach_s = progress.left_m / DEFAULT_SPEEDS.cruise_m_s
    return (
        progress.left_m + stop.distance_m - current.distance_m,
        approach_s + stop.time_s - current.time_s,
    )


def mission_columns(width: int, *, in_flight: bool) -> list[Column]:
    """Return the columns for a width."""
    goal = "to go" if in_flight else "total"
    columns = [
        Column("", 1),
        Column("item", 4, True),
        Column("command", 17),
        Column("leg", 8, True),
        Column("to", 4, True),
        Column("altitude", 9, True),
        Column("parameters", 9),
        Column(goal, 8, True),
        Column("time", 7, True),
    ]
    if width >= _POSITIONS_FROM:
        columns[2] = columns[2]._replace(width=22)
        columns[3:3] = [Column("latitude", 11, True), Column("longitude", 12, True)]
    return stretched(columns, min(width, _WIDEST), len(columns) - 3)


def mission_row(
    table: MissionTable, seq: int, progress: Progress, columns: Sequence[Column], colours: Palette
) -> Text:
    """Return the row of an item."""
    item, stop = table.items[seq], table.stops.get(seq)
    mark, style = "", colours.text
    if seq == progress.current:
        mark, style = "▶", f"bold {colours.accent}"
    elif progress.reached is not None and seq <= progress.reached:
        mark, style = "✓", colours.muted
    goal = to_go(table, seq, progress)
    has_leg = stop is not None and stop.leg_m >= 0.05
    place = item.position_deg
    cells = [
        Cell(mark, colours.good if mark == "✓" else style),
        Cell(str(seq), style),
        Cell(any_command_name(item.command).removeprefix("NAV_"), style),
        Cell("" if place is None else f"{place[0]:.7f}", colours.muted),
        Cell("" if place is None else f"{place[1]:.7f}", colours.muted),
        Cell(f"{stop.leg_m:.1f} m" if stop and has_leg else "", style),
        Cell("" if stop is None or stop.heading_deg is None else f"{stop.heading_deg:03.0f}°", style),
        Cell(altitude_text(item), style),
        Cell(meaning(item), colours.muted),
        Cell("" if goal is None else distance(goal[0]), style),
        Cell("" if goal is None else clock(goal[1]), style),
    ]
    if len(columns) < len(cells):
        del cells[3:5]
    return row_text(columns, cells)


def meaning(item: MissionItem) -> str:
    """Return the parameters of an item in words, or their numbers."""
    one, two = item.param1, item.param2
    if item.command in (Command.NAV_WAYPOINT, Command.NAV_LOITER_TIME, Command.NAV_DELAY):
        return f"{one:g} s" if one > 0.0 else ""
    if item.command == Command.DO_CHANGE_SPEED:
        return f"{two:g} m/s" if two > 0.0 else "default" if two == -2.0 else ""
    if item.command == Command.DO_JUMP:
        return f"→ {one:g} ×{'∞' if two < 0.0 else f'{two:g}'}"
    return parameters_text(item)


def summary(table: MissionTable, progress: Progress) -> str:
    """Return number of items, length and duration; in flight the distance and time to go."""
    count = "1 item" if len(table.items) == 1 else f"{len(table.items)} items"
    if not table.items:
        return "no mission"
    if progress.current is not None and progress.left_m is not None and table.flight.stops:
        goal = to_go(table, table.flight.stops[-1].seq, progress)
        if goal is not None:
            return f"item {progress.current} of {count}, {distance(goal[0])} and {clock(goal[1])} to go"
    if math.isinf(table.flight.time_s):
        return f"{count}, repeats for ever"
    flight = table.flight
    return f"{count}, {distance(flight.distance_m)} in {clock(flight.time_s)}, up to {flight.highest_m:g} m"
