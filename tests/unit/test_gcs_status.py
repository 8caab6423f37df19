"""``gcs status`` and the terminal view of a vehicle with sensors."""

from __future__ import annotations

import math

from flightstack.mavlink.dialect import mavlink
from gcs_cli.commands.status import status_facts, status_lines
from gcs_cli.link.quality import LinkQuality
from gcs_cli.tui.fly.health_panels import health_panel
from gcs_cli.tui.palette import DARK
from gcs_cli.vehicle.view_types import VehicleView
from tests.support.folded_vehicle import Vehicle, heartbeat
from tests.support.watch_states import TIMING

GOOD = 0b1100111111


def seen(flags: int = GOOD, ratio: float = 0.3, accuracy_m: float = 0.6) -> VehicleView:
    vehicle = Vehicle()
    vehicle.send(heartbeat())
    vehicle.send(
        mavlink.MAVLink_gps_raw_int_message(0, 3, 1, 1, 1, 65535, 65535, 0, 0, 14, 0, 800, 1200, 250)
    )
    return vehicle.send(
        mavlink.MAVLink_estimator_status_message(
            0, flags, 0.1, ratio, 0.1, 0.1, math.nan, math.nan, accuracy_m, 2.0 * accuracy_m
        )
    )


def lines(view: VehicleView) -> dict[str, str]:
    return dict(status_lines(view, LinkQuality()))


def test_status_shows_receiver_and_estimator() -> None:
    shown = lines(seen())
    assert shown["gnss"] == "3D fix, 14 satellites, ±0.8 m"
    assert shown["estimator"] == "good, largest innovation 30 % of its gate, ±0.6 m"
    facts = status_facts(seen())
    assert (facts["gnss_fix"], facts["gnss_satellites"], facts["gnss_horizontal_accuracy_m"]) == (
        "3D fix",
        14,
        0.8,
    )
    assert (facts["estimator_healthy"], facts["estimator_worst_ratio"]) == (True, 0.3)
    assert facts["estimator_vertical_accuracy_m"] == 1.2


def test_status_of_a_rejecting_estimator_is_bad() -> None:
    assert lines(seen(ratio=1.5))["estimator"].startswith("bad, largest innovation 150 %")
    assert not status_facts(seen(flags=1))["estimator_healthy"]


def test_accuracy_of_the_true_state_is_not_shown() -> None:
    assert lines(seen(accuracy_m=0.0))["estimator"] == "good, largest innovation 30 % of its gate"


def test_view_without_sensors_shows_no_health_of_them() -> None:
    shown = lines(VehicleView())
    assert shown["gnss"] == shown["estimator"] == "—"
    assert status_facts(VehicleView())["estimator_healthy"] is None


def test_terminal_view_shows_accuracies_without_a_dilution() -> None:
    text = "\n".join(line.plain for line in health_panel(seen(), 1.0, 60, 8, DARK))
    assert "3D fix  14 sats  ±0.8 m" in text
    assert "good  ratio 0.30  ±0.6 m" in text


def test_wind_without_a_vertical_part_is_shown() -> None:
    vehicle = Vehicle()
    vehicle.send(heartbeat())
    nan = math.nan
    wind = mavlink.MAVLink_wind_cov_message(0, 3.0, -4.0, nan, 0.1, nan, nan, 0.3, nan)
    assert vehicle.send(wind).wind_ned_m_s == (3.0, -4.0, 0.0)


def test_status_tells_the_current_item_from_the_items_of_the_mission() -> None:
    vehicle = Vehicle()
    vehicle.send(heartbeat())
    vehicle.send(mavlink.MAVLink_mission_item_reached_message(1))
    assert lines(vehicle.send(mavlink.MAVLink_mission_current_message(2, 6, 3)))["mission"] == (
        "current item 2 (items 0 to 5), last reached 1"
    )
    assert lines(vehicle.send(mavlink.MAVLink_mission_current_message(0, 0)))["mission"] == "none"


def test_loops_in_lockstep_have_no_overruns() -> None:
    view = seen()._replace(timing=TIMING)
    assert lines(view)["inner loop"] == "500 Hz, lockstep"
    late = TIMING._replace(lockstep=False, overruns=3, missed=0)
    assert lines(view._replace(timing=late))["inner loop"] == "500 Hz, 3 overruns"
