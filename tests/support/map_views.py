"""A vehicle and its plan on the map."""

from __future__ import annotations

from flightstack.core.contract import Vector3
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.plan import Frame, MissionItem
from gcs_cli.tui.map.scene import (
    Place,
)
from gcs_cli.vehicle.view_types import GeoPosition, Identity, Mission, Setpoint, Vector, VehicleView

HOME = GeoPoint(47.397742, 8.545594, 488.0)


FRAME = LocalFrame(HOME)


def item(command: int, place: Place | None = None, **fields: float) -> MissionItem:
    x = y = 0
    if place is not None:
        geo = FRAME.to_geo(Vector3(place.north_m, place.east_m, 0.0))
        x, y = round(geo.latitude_deg * 1e7), round(geo.longitude_deg * 1e7)
    return MissionItem(command, Frame.GLOBAL_RELATIVE_ALT_INT, x=x, y=y, z=10.0, **fields)


VIEW = VehicleView(
    identity=Identity(1, 1, 2, 12),
    geo=GeoPosition(HOME.latitude_deg, HOME.longitude_deg, 493.0, 5.0),
    home=GeoPosition(HOME.latitude_deg, HOME.longitude_deg, 488.0, 0.0),
    position_ned_m=Vector(100.0, 0.0, -5.0),
    setpoint=Setpoint(Vector(110.0, -4.0, -5.0)),
    heading_deg=45.0,
    mission=Mission(1, 2),
)
