"""``gcs status``: the state of the vehicle."""

from __future__ import annotations

import math
from typing import Any

import typer

from flightstack.mavlink.dialect import mavlink
from flightstack.process.command_line import expand_options, make_app
from gcs_cli.link.quality import LinkQuality
from gcs_cli.link.subscription import Snapshot
from gcs_cli.settings import LinkOptions, output_of
from gcs_cli.vehicle.field_units import UNKNOWN, number
from gcs_cli.vehicle.view_types import Estimator, Gnss, LoopTiming, VehicleView
from gcs_cli.vehicle_link import connect_vehicle

app = make_app(add_completion=False)

GATHER_S = 0.35
"""Longest wait for the values after the 0.1 s in which other vehicles are noticed; a request may be lost."""
_OF_RECORDING_S = 5.0
"""The same for a recording, whose time does not pass; messages come every 2 s."""
_STREAMED_S = 1.1
"""Longest wait for MISSION_CURRENT, which PX4 streams once a second and denies to a request."""
_NOT_RECORDED = frozenset({mavlink.MAVLINK_MSG_ID_MISSION_ITEM_REACHED})
"""Messages that a recording may not have: they are sent once."""
_LANDED = {1: "on ground", 2: "in air", 3: "taking off", 4: "landing"}


@app.command()
@expand_options
def status(context: typer.Context, link: LinkOptions) -> None:
    """Show the state of the vehicle."""
    with connect_vehicle(context, link, takes_recording=True, in_real_time=False) as connection:
        session = connection.session
        omitted = _NOT_RECORDED if connection.is_recording else frozenset()
        snapshot = Snapshot(lambda: session.view, session.own, omitted=omitted)
        session.attach(snapshot)
        connection.wait_for(
            lambda: snapshot.complete, _OF_RECORDING_S if connection.is_recording else GATHER_S
        )
        session.detach(snapshot)
        if not connection.is_recording:
            connection.wait_for(lambda: session.view.mission.current is not None, _STREAMED_S)
        view, quality = session.view, session.quality
    sentence = "\n".join(f"{name:<12}{text}" for name, text in status_lines(view, quality))
    output_of(context, link).say("status", sentence, **status_facts(view), **_link_facts(quality))


def _link_facts(quality: LinkQuality) -> dict[str, Any]:
    loss, round_trip_s = quality.loss, quality.round_trip_s
    return {
        "link_loss": None if loss is None else round(loss, 4),
        "round_trip_s": None if round_trip_s is None else round(round_trip_s, 6),
    }


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
        "landed": _LANDED.get(view.landed_state),
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
        **_health_facts(view),
        "inner_hz": None if timing is None else timing.inner_hz,
        "overruns": None if timing is None else timing.overruns,
        "texts": [entry.text for entry in view.texts],
    }


_GNSS_KEYS = ("gnss_fix", "gnss_satellites", "gnss_horizontal_accuracy_m")
_ESTIMATOR_KEYS = (
    "estimator_healthy", "estimator_worst_ratio", "estimator_horizontal_accuracy_m", "estimator_vertical_accuracy_m",
)  # fmt: skip


def _health_facts(view: VehicleView) -> dict[str, Any]:
    """Return the health of receiver and estimator."""
    facts: dict[str, Any] = dict.fromkeys((*_GNSS_KEYS, *_ESTIMATOR_KEYS))
    if (gnss := view.gnss) is not None:
        values = (gnss.fix_name, gnss.satellites, gnss.horizontal_accuracy_m)
        facts.update(zip(_GNSS_KEYS, values, strict=True))
    if (estimator := view.estimator) is not None:
        figures = (estimator.worst_ratio, estimator.horizontal_m, estimator.vertical_m)
        rounded = [None if value is None else round(value, 4) for value in figures]
        facts.update(zip(_ESTIMATOR_KEYS, (estimator.healthy, *rounded), strict=True))
    return facts


def _loops_text(timing: LoopTiming) -> str:
    late = "lockstep" if timing.lockstep else f"{timing.overruns} overruns"
    return f"{number(timing.inner_hz, 0)} Hz, {late}"


def _rounded(values: tuple[float, ...] | None) -> list[float] | None:
    return None if values is None else [round(value, 4) for value in values]


def status_lines(view: VehicleView, quality: LinkQuality) -> list[tuple[str, str]]:
    """Return the values for people: names and texts with units, rounded; a dash for unknown values."""
    identity, attitude, geo, timing = view.identity, view.attitude, view.geo, view.timing
    angles = None if attitude is None else tuple(math.degrees(angle) for angle in attitude)
    remaining = None if view.battery is None else view.battery.remaining
    place = (
        None
        if geo is None
        else f"{geo.latitude_deg:.7f}°, {geo.longitude_deg:.7f}°, {geo.altitude_m:.1f} m above sea level"
    )
    loops = None if timing is None else _loops_text(timing)
    lines = {
        "vehicle": None if identity is None else f"{identity.kind}, system {identity.system_id}",
        "mode": view.mode,
        "armed": "yes" if view.armed else "no",
        "landed": _LANDED.get(view.landed_state),
        "time": None if view.time_s is None else f"{view.time_s:.1f} s",
        "attitude": _parts(angles, ("roll", "pitch", "yaw"), 1, "°"),
        "position": _parts(view.position_ned_m, ("north", "east", "down"), 2, " m"),
        "velocity": _parts(view.velocity_ned_m_s, ("north", "east", "down"), 2, " m/s"),
        "place": place,
        "gnss": _gnss_text(view.gnss),
        "estimator": _estimator_text(view.estimator),
        "mission": _mission_text(view),
        "battery": None if remaining is None else f"{100.0 * remaining:.0f} %",
        "rotors": ", ".join(number(rpm, 0) for rpm in view.rotor_rpm) + " rpm" if view.rotor_rpm else None,
        "inner loop": loops,
        "link": _link_text(quality),
    }
    texts = [("text", entry.text) for entry in view.texts]
    return [*((name, text or UNKNOWN) for name, text in lines.items()), *texts]


def _parts(values: tuple[float, ...] | None, names: tuple[str, ...], digits: int, unit: str) -> str | None:
    if values is None:
        return None
    return ", ".join(
        f"{name} {number(value, digits, unit)}" for name, value in zip(names, values, strict=True)
    )


def _gnss_text(gnss: Gnss | None) -> str | None:
    if gnss is None:
        return None
    satellites = None if gnss.satellites is None else f"{gnss.satellites} satellites"
    accuracy = gnss.horizontal_accuracy_m
    accurate = None if accuracy is None else f"±{accuracy:.1f} m"
    return ", ".join(part for part in (gnss.fix_name, satellites, accurate) if part)


def _estimator_text(estimator: Estimator | None) -> str | None:
    if estimator is None:
        return None
    ratio, accuracy = estimator.worst_ratio, estimator.horizontal_m
    largest = None if ratio is None else f"largest innovation {100.0 * ratio:.0f} % of its gate"
    accurate = None if accuracy is None else f"±{accuracy:.1f} m"
    return ", ".join(part for part in ("good" if estimator.healthy else "bad", largest, accurate) if part)


def _mission_text(view: VehicleView) -> str | None:
    mission = view.mission
    if mission.current is None:
        return None
    if not mission.total:
        return "none"
    last = mission.total - 1
    items = "the only item" if not last else f"items 0 to {last}"
    reached = "" if mission.reached is None else f", last reached {mission.reached}"
    return f"current item {mission.current} ({items}){reached}" + (", complete" if mission.complete else "")


def _link_text(quality: LinkQuality) -> str | None:
    loss = None if quality.loss is None else f"loss {100.0 * quality.loss:.1f} %"
    trip = None if quality.round_trip_s is None else f"round trip {1e3 * quality.round_trip_s:.1f} ms"
    return ", ".join(text for text in (loss, trip) if text) or None
