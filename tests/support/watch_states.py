"""States of a vehicle for the tests of the terminal view."""

from __future__ import annotations

import math

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from gcs_cli.tui.fly.history import History
from gcs_cli.vehicle.link_counts import LinkCounts
from gcs_cli.vehicle.view_types import (
    Battery,
    Estimator,
    Euler,
    GeoPosition,
    Gnss,
    Identity,
    LoopTiming,
    Mission,
    Setpoint,
    StatusText,
    Vector,
    VehicleView,
)

NOW_S = 10.0
TIMING = LoopTiming(41, 20500, None, None, 500, 100, 52.3, 13.2, 25.5, 130, 4, 5, 6, True)
BARE = VehicleView(identity=Identity(1, 1, 2, 12), last_heartbeat_s=9.5)
FULL = BARE._replace(
    mode="MISSION",
    armed=True,
    landed_state=2,
    attitude=Euler(0.2, -0.1, 1.3),
    attitude_target=Euler(0.21, -0.1, 1.3),
    position_ned_m=Vector(3.21, -4.2, -5.0),
    velocity_ned_m_s=Vector(2.0, 1.0, 0.1),
    geo=GeoPosition(47.397742, 8.545594, 493.0, 5.0),
    home=GeoPosition(47.397742, 8.545594, 488.0, 0.0),
    setpoint=Setpoint(Vector(3.33, -4.1, -5.0), Vector(2.1, 1.0, 0.0), 0.0),
    mission=Mission(3, 7, 2, 3),
    rotor_rpm=(2310.0, 2290.0, 2305.0, 2400.0),
    rotor_peak_rpm=2850.0,
    throttle=0.51,
    timing=TIMING,
    time_s=41.3,
    texts=tuple(StatusText(i, i % 8, f"text number {i}", 1.0, i * 3.1) for i in range(8)),
    text_count=8,
    link=LinkCounts(1000, 3, 4, 9.9, 312.0, 9.0, 4, 0.0024),
    healthy=True,
    battery=Battery(0.76, 15.1, 12.4, 754.0),
    gnss=Gnss(3, 14, 0.8),
    estimator=Estimator(True, True, True, True, 0.24),
    wind_ned_m_s=Vector(-2.0, -3.5, 0.0),
)
FAILING = FULL._replace(
    system_status=5,
    mode="RTL",
    battery=Battery(0.12, 13.2, 18.0, 95.0),
    gnss=Gnss(1, 3, 9.9),
    estimator=Estimator(True, False, False, True, 1.7),
    healthy=False,
    unhealthy=("gps", "3d mag"),
    texts=(*FULL.texts[:4], StatusText(8, 2, "Failsafe: battery critical, return", 1.0, 40.2)),
)


def flown_history(now_s: float = NOW_S) -> History:
    """Return a history of two minutes of telemetry that rises and swings."""
    history, vehicle, ground = History(), Link(1, 1), Link(255, 190)
    for step in range(240):
        at_s = step * 0.5
        swing = math.sin(at_s / 7)
        messages = (
            mavlink.MAVLink_attitude_message(int(1e3 * at_s), 0.3 * swing, 0.1 * swing, 0.0, 0.0, 0.0, 0.0),
            mavlink.MAVLink_vfr_hud_message(0.0, 3 + 2 * swing, 90, 50 + int(9 * swing), 490.0, swing),
            mavlink.MAVLink_global_position_int_message(int(1e3 * at_s), 0, 0, 0, int(40 * step), 0, 0, 0, 0),
            mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 16_000 - 8 * step, 0, 90, 0, 0, 0, 0, 0, 0),
        )
        for message in messages:
            for received in ground.decode(vehicle.encode(message)):
                history.record(received, now_s - 120.0 + at_s)
    return history
