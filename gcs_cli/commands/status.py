"""``gcs status``: the state of the vehicle."""

from __future__ import annotations

import math
from typing import Any

import typer

from flightstack.process.command_line import expand_options, make_app
from gcs_cli.link.quality import LinkQuality
from gcs_cli.link.subscription import ROTORS_AND_TIMING
from gcs_cli.settings import LinkOptions, output_of
from gcs_cli.vehicle.view_types import VehicleView
from gcs_cli.vehicle_link import connect_vehicle

app = make_app(add_completion=False)

GATHER_S = 0.5
"""Longest wait for the values after the first heartbeat; a vehicle may not send all of them."""
SLOW_S = 1.2
"""The same for those that every autopilot sends, PX4 some of them once a second."""


@app.command()
@expand_options
def status(context: typer.Context, link: LinkOptions) -> None:
    """Show the state of the vehicle.

    Examples:
      gcs status
      gcs --connect tcp:127.0.0.1:5760 status --json
    """
    with connect_vehicle(context, link, takes_recording=True, in_real_time=False) as connection:
        session = connection.session
        session.subscribe(ROTORS_AND_TIMING)
        # most messages come several times a second; values that the vehicle does not send stay unknown
        if not connection.wait_for(lambda: _is_full(session.view), GATHER_S):
            connection.wait_for(lambda: _has_state(session.view), SLOW_S - GATHER_S)
        facts = {**status_facts(session.view), **_link_facts(session.quality)}
    lines = [f"{name:<20} {_shown(value)}" for name, value in facts.items()]
    output_of(context, link).say("status", "\n".join(lines), **facts)


def _link_facts(quality: LinkQuality) -> dict[str, Any]:
    loss, round_trip_s = quality.loss, quality.round_trip_s
    return {
        "link_loss": None if loss is None else round(loss, 4),
        "round_trip_s": None if round_trip_s is None else round(round_trip_s, 6),
    }


def _has_state(view: VehicleView) -> bool:
    known = (view.attitude, view.geo, view.mission.current, view.healthy)
    return all(part is not None for part in known) and view.landed_state != 0


def _is_full(view: VehicleView) -> bool:
    extra = (view.position_ned_m, view.timing, view.rotor_rpm or None)
    return _has_state(view) and all(part is not None for part in extra)


def status_facts(view: VehicleView) -> dict[str, Any]:
    """Return the values of ``--json``: SI units, degrees for angles, null for unknown values."""
    attitude = view.attitude
    battery, geo, timing = view.battery, view.geo, view.timing
    return {
        "system": None if view.identity is None else view.identity.system_id,
        "type": None if view.identity is None else view.identity.kind,
        "autopilot": None if view.identity is None else view.autopilot.name,
        "mode": view.mode,
        "armed": view.armed,
        "landed": {1: "on ground", 2: "in air", 3: "taking off", 4: "landing"}.get(view.landed_state),
        "time_s": view.time_s,
        "euler_deg": None if attitude is None else [round(math.degrees(a), 3) for a in attitude],
        "pos_ned_m": _rounded(view.position_ned_m),
        "vel_ned_m_s": _rounded(view.velocity_ned_m_s),
        "latitude_deg": None if geo is None else geo.latitude_deg,
        "longitude_deg": None if geo is None else geo.longitude_deg,
        "altitude_m": None if geo is None else geo.altitude_m,
        "relative_altitude_m": view.relative_altitude_m,
        "mission_current": view.mission.current,
        "mission_total": view.mission.total,
        "mission_reached": view.mission.reached,
        "mission_complete": None if view.mission.is_end_unknown else view.mission.complete,
        "battery_remaining": None if battery is None else battery.remaining,
        "rotor_rpm": list(view.rotor_rpm),
        "inner_hz": None if timing is None else timing.inner_hz,
        "overruns": None if timing is None else timing.overruns,
        "texts": [entry.text for entry in view.texts],
    }


def _rounded(values: tuple[float, ...] | None) -> list[float] | None:
    return None if values is None else [round(value, 4) for value in values]


def _shown(value: Any) -> str:
    if value is None or value == []:
        return "—"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "  ".join(str(part) for part in value) if isinstance(value, list) else str(value)
