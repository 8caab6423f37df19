"""The items of a plan as rows: for a table, and as the facts that ``--json`` prints. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from flightstack.plan import Command, MissionItem
from flightstack.plan.commands import FenceCommand
from gcs_cli.plans.itinerary import Itinerary, Stop
from gcs_cli.plans.names import any_command_name
from gcs_cli.tables import new_table

if TYPE_CHECKING:
    from rich.table import Table


def item_facts(seq: int, item: MissionItem, stop: Stop | None = None) -> dict[str, Any]:
    """Return an item as ``--json`` prints it, with the leg to it if it is flown."""
    latitude, longitude = item.position_deg or (None, None)
    facts: dict[str, Any] = {
        "seq": seq,
        "command": any_command_name(item.command),
        "frame": int(item.frame),
        "params": list(item.params),
        "latitude_deg": latitude,
        "longitude_deg": longitude,
        "altitude_m": item.z,
    }
    if stop is not None:
        facts |= {
            "leg_m": stop.leg_m,
            "heading_deg": stop.heading_deg,
            "distance_m": stop.distance_m,
            "time_s": stop.time_s,
        }
    return facts


def itinerary_facts(flight: Itinerary) -> dict[str, Any]:
    """Return the totals of a mission."""
    return {
        "distance_m": flight.distance_m,
        "time_s": flight.time_s,
        "highest_m": flight.highest_m,
        "farthest_m": flight.farthest_m,
    }


def mission_table(items: Sequence[MissionItem], flight: Itinerary) -> Table:
    """Return the table of a mission: number, command, position, altitude, leg, heading, time and parameters."""
    table = new_table()
    for name in ("item", "command"):
        table.add_column(name, no_wrap=True, justify="right" if name == "item" else "left")
    for name in ("latitude", "longitude", "altitude", "leg", "heading", "time"):
        table.add_column(name, no_wrap=True, justify="right")
    table.add_column("parameters", overflow="fold", style="bright_black")
    stops = {stop.seq: stop for stop in flight.stops}
    for seq, item in enumerate(items):
        stop = stops.get(seq)
        place = item.position_deg
        table.add_row(
            str(seq),
            any_command_name(item.command),
            "" if place is None else f"{place[0]:.7f}",
            "" if place is None else f"{place[1]:.7f}",
            altitude_text(item),
            "" if stop is None or stop.leg_m < 0.05 else f"{stop.leg_m:.1f} m",
            "" if stop is None or stop.heading_deg is None else f"{stop.heading_deg:03.0f}°",
            "not reached"
            if stop is None and item.command != Command.DO_JUMP
            else ""
            if stop is None
            else clock(stop.time_s),
            parameters_text(item),
        )
    return table


def places_table(items: Sequence[MissionItem]) -> Table:
    """Return the table of a geofence or of rally points."""
    table = new_table()
    for name in ("item", "command", "latitude", "longitude", "altitude", "parameters"):
        table.add_column(name, no_wrap=True, justify="left" if name == "command" else "right")
    for seq, item in enumerate(items):
        latitude, longitude = item.position_deg or (math.nan, math.nan)
        table.add_row(
            str(seq), any_command_name(item.command), f"{latitude:.7f}", f"{longitude:.7f}", altitude_text(item),
            parameters_text(item),
        )  # fmt: skip
    return table


def parameters_text(item: MissionItem) -> str:
    """Return parameters 1 to 4 without the trailing ones that are unset or zero."""
    params = list(item.params)
    while params and (params[-1] == 0.0 or math.isnan(params[-1])):
        params.pop()
    return " ".join("–" if math.isnan(value) else f"{value:g}" for value in params)


def totals(flight: Itinerary) -> str:
    """Return the totals of a mission in one sentence."""
    if math.isinf(flight.time_s):
        return "the mission repeats for ever"
    return (
        f"{distance(flight.distance_m)} in {clock(flight.time_s)}, up to {flight.highest_m:g} m above home "
        f"and {distance(flight.farthest_m)} from it"
    )


def distance(metres: float) -> str:
    """Return a distance with its unit."""
    return f"{metres / 1000.0:.2f} km" if metres >= 1000.0 else f"{metres:.0f} m"


def clock(seconds: float) -> str:
    """Return a duration as minutes and seconds, or hours, minutes and seconds."""
    if not math.isfinite(seconds):
        return "∞"
    whole = round(seconds)
    hours, minutes = divmod(whole // 60, 60)
    return f"{hours}:{minutes:02d}:{whole % 60:02d}" if hours else f"{minutes}:{whole % 60:02d}"


def altitude_text(item: MissionItem) -> str:
    """Return the altitude of an item with its unit; empty without one, as in a geofence."""
    if item.command in FenceCommand.__members__.values():
        return ""
    if item.position_deg is None and not (item.command == Command.NAV_TAKEOFF and math.isfinite(item.z)):
        return ""
    if math.isnan(item.z):
        return "–"
    suffix = {0: " AMSL", 5: " AMSL", 10: " AGL", 11: " AGL"}.get(item.frame, "")
    return f"{item.z:g} m{suffix}"
