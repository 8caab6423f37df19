"""State and texts of the vehicle as lines, for pipes and files. Pure."""

from __future__ import annotations

import math

from gcs_cli.tui.fly.panels import SEVERITIES, clock_text
from gcs_cli.vehicle.view_types import StatusText, VehicleView


def state_line(view: VehicleView, now_s: float) -> str:
    """Return the state of the vehicle in one line; a dash for unknown values."""
    if view.identity is None:
        return "waiting for a vehicle"
    if view.powered_off:
        return f"{clock_text(view.time_s)} vehicle has shut down"
    if view.lost(now_s):
        return f"{clock_text(view.time_s)} vehicle lost for {view.silent_s(now_s):.0f} s"
    parts = [clock_text(view.time_s), view.mode or "—", "armed" if view.armed else "disarmed"]
    if view.position_ned_m is not None:
        north, east, down = view.position_ned_m
        north, east, up = (round(value, 2) + 0.0 for value in (north, east, -down))  # no -0.00
        parts.append(f"N {north:+.2f} E {east:+.2f} up {up:.2f} m")
    if view.velocity_ned_m_s is not None:
        parts.append(f"{math.hypot(view.velocity_ned_m_s.x, view.velocity_ned_m_s.y):.2f} m/s")
    if view.attitude is not None:
        roll, pitch, yaw = (math.degrees(angle) for angle in view.attitude)
        parts.append(f"roll {roll:+.1f}° pitch {pitch:+.1f}° yaw {round(yaw) % 360:03d}°")
    if view.mission.item_text:
        parts.append(view.mission.item_text)
    if view.battery is not None and view.battery.remaining is not None:
        parts.append(f"battery {view.battery.remaining:.0%}")
    if view.timing is not None and view.timing.real_time_factor is not None:
        parts.append(f"×{view.timing.real_time_factor:.1f}")
    return "  ".join(parts)


def text_line(entry: StatusText) -> str:
    """Return one status text in one line."""
    return f"{clock_text(entry.vehicle_time_s)}  {SEVERITIES[min(entry.severity, 7)]}: {entry.text}"
