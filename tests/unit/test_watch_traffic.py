"""Aircraft on the map of ``gcs watch``, from ADSB_VEHICLE."""

from __future__ import annotations

import pytest

from flightstack.core.contract import Vector3
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.param_values import INT32, wire_value
from flightstack.plan import Plan
from gcs_cli.tui.fly.history import History
from gcs_cli.tui.map.drawing import draw_map
from gcs_cli.tui.map.model import MapModel
from gcs_cli.tui.map.traffic import KEPT_S, OWN_ADDRESS, Aircraft, Traffic
from gcs_cli.tui.map.viewport import Viewport
from gcs_cli.tui.palette import DARK
from tests.support.map_views import FRAME, VIEW

NOW_S = 100.0
VALID = mavlink.ADSB_FLAGS_VALID_COORDS | mavlink.ADSB_FLAGS_VALID_ALTITUDE | mavlink.ADSB_FLAGS_VALID_HEADING


def report(
    address: int = 0x3C6444,
    callsign: bytes = b"DLH4AB",
    flags: int = VALID,
    altitude_type: int = mavlink.ADSB_ALTITUDE_TYPE_GEOMETRIC,
    silent_s: int = 0,
):
    geo = FRAME.to_geo(Vector3(40.0, 30.0, 0.0))
    lat, lon = round(geo.latitude_deg * 1e7), round(geo.longitude_deg * 1e7)
    return mavlink.MAVLink_adsb_vehicle_message(
        address, lat, lon, altitude_type, 613_000, 9000, 0, 0, callsign, 0, silent_s, flags, 0
    )


def test_aircraft_is_drawn_with_its_altitude_above_the_vehicle() -> None:
    traffic = Traffic()
    traffic.record(report(), NOW_S)
    scene = MapModel().scene(VIEW, History(), Plan(()), traffic.aircraft(NOW_S))
    (craft,) = scene.others
    assert (craft.name, craft.heading_deg, craft.is_traffic) == ("DLH4AB +120 m", 90.0, True)
    assert craft.place == pytest.approx((40.0, 30.0), abs=0.02)
    assert "→DLH4AB +120 m" in draw_map(scene, Viewport(width=80, height=40), DARK).text().plain


def test_pressure_altitude_is_not_compared_with_the_vehicle() -> None:
    traffic = Traffic()
    traffic.record(report(altitude_type=mavlink.ADSB_ALTITUDE_TYPE_PRESSURE_QNH), NOW_S)
    (craft,) = MapModel().scene(VIEW, History(), Plan(()), traffic.aircraft(NOW_S)).others
    assert craft.name == "DLH4AB PA 613 m"


def test_age_of_an_aircraft_counts_from_its_own_transmission() -> None:
    traffic = Traffic()
    traffic.record(report(silent_s=20), NOW_S)
    assert traffic.aircraft(NOW_S + KEPT_S - 20.0)
    assert not traffic.aircraft(NOW_S + KEPT_S - 19.0)


def test_aircraft_leaves_the_map_when_it_is_not_reported() -> None:
    traffic = Traffic()
    traffic.record(report(), NOW_S)
    assert traffic.aircraft(NOW_S + KEPT_S)
    assert not traffic.aircraft(NOW_S + KEPT_S + 1.0)


def test_traffic_does_not_change_the_extent_of_the_map() -> None:
    far = Aircraft("far", 48.0, 9.0, None, heading_deg=None, heard_s=NOW_S)
    model = MapModel()
    alone = model.scene(VIEW, History(), Plan(())).extent()
    assert (model.scene(VIEW, History(), Plan(()), [far]).extent() == alone).all()


@pytest.mark.parametrize(
    ("message", "names"),
    [
        (report(callsign=b""), ["3C6444"]),
        (report(flags=0), []),
        (mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3), []),
    ],
)
def test_only_aircraft_with_a_position_count(message, names) -> None:
    traffic = Traffic()
    traffic.record(message, NOW_S)
    assert [each.name for each in traffic.aircraft(NOW_S)] == names


OWN = 0x3C6444


def own_report():
    message = report(OWN)
    message.pack(mavlink.MAVLink(None, 1, 1))
    return message


@pytest.mark.parametrize("casts", [False, True], ids=["px4", "ardupilot"])
def test_the_vehicle_s_own_transponder_is_no_traffic(casts) -> None:
    traffic = Traffic()
    traffic.record(report(OWN), NOW_S)
    traffic.record(report(0x123456), NOW_S)
    value = float(OWN) if casts else wire_value(OWN, is_integer=True)
    answer = mavlink.MAVLink_param_value_message(OWN_ADDRESS.encode(), value, INT32, 9, 3)
    traffic.record(answer, NOW_S, casts_parameters=casts)
    assert len(traffic.aircraft(NOW_S)) == 1


def test_own_address_is_requested_until_it_is_known() -> None:
    traffic, message = Traffic(), own_report()
    request = traffic.own_address_request(message, NOW_S)
    assert (request.target_system, request.target_component, request.param_id) == (1, 1, OWN_ADDRESS)
    assert traffic.own_address_request(message, NOW_S + 9.0) is None
    assert traffic.own_address_request(message, NOW_S + 10.0) is not None
    answer = mavlink.MAVLink_param_value_message(
        OWN_ADDRESS.encode(), wire_value(OWN, is_integer=True), INT32, 9, 3
    )
    answer.pack(mavlink.MAVLink(None, 1, 1))
    traffic.record(answer, NOW_S)
    assert traffic.own_address_request(message, NOW_S + 20.0) is None


def test_a_vehicle_without_own_address_is_asked_three_times() -> None:
    traffic, message = Traffic(), own_report()
    asked = [traffic.own_address_request(message, NOW_S + 10.0 * step) for step in range(9)]
    assert sum(request is not None for request in asked) == 3


def test_aircraft_are_bounded_and_old_ones_make_room() -> None:
    traffic = Traffic()
    for address in range(300):
        traffic.record(report(address), NOW_S)
    assert len(traffic.aircraft(NOW_S)) == 200
    traffic.record(report(999), NOW_S + KEPT_S + 1.0)
    assert len(traffic.aircraft(NOW_S + KEPT_S + 1.0)) == 1
