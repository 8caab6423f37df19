"""The terminal view drawn from snapshots."""

from __future__ import annotations

import math
from functools import partial

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.text import Text

from gcs_cli.tui.fly.compact import compact, waiting
from gcs_cli.tui.fly.flight_display import flight_display
from gcs_cli.tui.fly.health_panels import health_panel, link_panel
from gcs_cli.tui.fly.history import History
from gcs_cli.tui.fly.horizon import SKY_CODE, heading_tape, sky_pixels
from gcs_cli.tui.fly.panels import messages_panel, mission_panel, position_panel, power_panel
from gcs_cli.tui.fly.timing_panels import timing_panel
from gcs_cli.tui.fly.trends import trends_panel
from gcs_cli.tui.palette import DARK
from gcs_cli.tui.status_line import status_line
from gcs_cli.tui.watch_lines import state_line, text_line
from gcs_cli.tui.widgets.drawing import Draw
from gcs_cli.vehicle.view_types import Battery, Euler, Mission, StatusText, Vector, VehicleView
from tests.support.view_panels import PANELS
from tests.support.watch_states import BARE, FAILING, FULL, TIMING, flown_history

SIZES = [(34, 6), (80, 24), (50, 12), (20, 2), (7, 1), (120, 60)]


def plain(lines: list[Text]) -> str:
    return "\n".join(line.plain for line in lines)


def drawn(panel: Draw, view: VehicleView, width: int = 46, height: int = 8, now_s: float = 10.0) -> str:
    return plain(panel(view, now_s, width, height, DARK))


@pytest.mark.parametrize(("width", "height"), SIZES)
@pytest.mark.parametrize(
    "view", [FULL, FAILING, BARE, VehicleView()], ids=["full", "failing", "bare", "none"]
)
@pytest.mark.parametrize("panel", PANELS)
def test_a_panel_has_no_more_lines_than_its_height(
    panel: Draw, view: VehicleView, width: int, height: int
) -> None:
    text = drawn(panel, view, width, height)
    assert text.count("\n") < max(height, 3)
    assert "nan" not in text.lower()


@pytest.mark.parametrize(
    ("panel", "parts"),
    [
        (status_line, ["MISSION", "ARMED", "in air", "0:41.3", "×52.3", "99.7%", "312 msg/s"]),
        (flight_display, ["+11.5°", "-5.7°", "074°", "2.2 ▶", "◀ 5.0"]),
        (position_panel, ["3.21", "3.33", "-4.20", "5.00", "2.24", "47.397742°"]),
        (power_panel, ["76% 15.1 V 12.4 A 12:34 left", "51%", "2310", "2400", "0 to 3000 rpm"]),
        (health_panel, ["none active", "3D fix  14 sats", "good  ratio 0.24", "4.0 m/s from NE 060°", "healthy"]),
        (link_panel, ["312 msg/s", "0.30%, 3 of 1003", "2.4 ms"]),
        (mission_panel, ["item 3 (last 6)", "reached 2", "active"]),
        (timing_panel, ["500/100 Hz", "lockstep", "130", "ticks 20500"]),
        (messages_panel, ["text number 7", "DEBUG"]),
    ],
)  # fmt: skip
def test_a_panel_shows_all_known_values(panel: Draw, parts: list[str]) -> None:
    text = drawn(panel, FULL, 100 if panel is status_line else 52, 12)
    for part in parts:
        assert part in text


def test_an_active_failsafe_is_shown_with_its_reason() -> None:
    text = drawn(health_panel, FAILING)
    assert "battery critical, return" in text
    for part in ("no fix", "no velocity, position", "ratio 1.70", "bad: gps, 3d mag"):
        assert part in text


def test_a_fence_breach_without_action_is_shown() -> None:
    assert "outside the fence" in drawn(health_panel, FULL._replace(fence_breached=True))


def test_unknown_values_are_dashes() -> None:
    assert "battery    —" in drawn(power_panel, BARE)
    assert "none loaded" in drawn(mission_panel, BARE)
    assert "wind       —" in drawn(health_panel, BARE)


def test_all_rotors_fit_into_few_rows() -> None:
    eight = FULL._replace(rotor_rpm=tuple(1000.0 + i for i in range(8)))
    text = drawn(power_panel, eight, 40, 5)
    assert all(str(1000 + i) in text for i in range(8))


def test_real_time_shows_lateness_and_missed_deadlines() -> None:
    text = drawn(
        timing_panel, FULL._replace(timing=TIMING._replace(lockstep=False, overruns=3, missed=2)), height=3
    )
    assert "late 4/5/6" in text
    assert "missed 2" in text


def test_an_active_failsafe_is_on_every_screen() -> None:
    assert "FAILSAFE" in drawn(status_line, FAILING, 80)
    assert "FAILSAFE" not in drawn(status_line, FULL, 80)


def test_a_lost_vehicle_is_shown() -> None:
    assert "VEHICLE LOST for 8 s" in drawn(status_line, FULL, 80, now_s=17.5)
    assert "LOST" not in drawn(status_line, FULL, 80, now_s=14.0)


def test_a_vehicle_that_has_shut_down_is_not_lost() -> None:
    text = drawn(status_line, FULL._replace(system_status=7), 80, now_s=60.0)
    assert "SHUT DOWN" in text
    assert "LOST" not in text


def test_waiting_names_the_link() -> None:
    text = plain(waiting("UDP 127.0.0.1:14550", 80, 24, DARK))
    assert "Waiting" in text
    assert "UDP 127.0.0.1:14550" in text


def test_long_messages_are_wrapped_and_the_newest_is_at_the_bottom() -> None:
    long = StatusText(8, 4, "refused because " + "very " * 20 + "unlikely", 1.0, 33.0)
    text = drawn(messages_panel, FULL._replace(texts=(*FULL.texts, long)), 60, 7)
    lines = [line for line in text.splitlines() if "very" in line or "unlikely" in line]
    assert len(lines) > 1
    assert text.index("refused because") < text.index("unlikely")


def test_battery_time_follows_from_the_consumption_since_arming() -> None:
    view = FULL._replace(battery=Battery(0.8, 15.0, 9.0), charge_at_arming=(0.0, 0.9), time_s=60.0)
    assert view.battery_time_s == pytest.approx(480.0)
    assert view._replace(charge_at_arming=(0.0, 0.81)).battery_time_s is None


def test_tape_marks_the_setpoint_and_centres_the_value() -> None:
    rows = drawn(flight_display, FULL, 60, 14).splitlines()
    middle = (len(rows) - 2) // 2
    assert "2.2 ▶" in rows[middle]
    assert "◀ 5.0" in rows[middle]
    far = FULL._replace(setpoint=FULL.setpoint._replace(position_ned_m=Vector(0.0, 0.0, -300.0)))
    assert "◂" in drawn(flight_display, far, 60, 14).splitlines()[0]


def test_target_altitude_and_distance_from_home_count_from_home() -> None:
    """The local origin is where the estimator began: neither below nor beside a home that was set later."""
    assert FULL.geo is not None
    moved = FULL._replace(
        geo=FULL.geo._replace(relative_altitude_m=2.0),
        home=FULL.geo._replace(latitude_deg=FULL.geo.latitude_deg - 1e-3, altitude_m=491.0),
    )
    middle = drawn(flight_display, moved, 60, 14).splitlines()[6]
    assert "◀ 2.0" in middle  # value and setpoint, 5 m above the origin, are at one place
    assert "from home  111.2 m" in drawn(position_panel, moved, height=9)


def test_trends_show_the_newest_value_and_the_range() -> None:
    series = partial(flown_history().series, system_id=1)
    text = plain(trends_panel(series, 10.0, 40, 30, DARK))
    assert "altitude 9.6 m  0.4 to 9.6" in text
    assert "battery 14.1 V" in text
    assert plain(trends_panel(History().series, 10.0, 40, 30, DARK)) == "no telemetry yet"


@settings(max_examples=40)
@given(
    st.tuples(*[st.floats(-1e38, 1e38)] * 3),
    st.lists(st.floats(-3e9, 3e9), max_size=8),
    st.floats(0.0, 5e6),
    st.integers(0, 65535),
)
def test_absurd_values_are_drawn(
    position: tuple[float, float, float], rpm: list[float], time_s: float, item: int
) -> None:
    view = FULL._replace(
        position_ned_m=Vector(*position),
        velocity_ned_m_s=Vector(*position),
        rotor_rpm=tuple(rpm),
        rotor_peak_rpm=max((abs(value) for value in rpm), default=0.0),
        time_s=time_s,
        mission=Mission(item, 5, None, 9),
    )
    for panel in PANELS:
        drawn(panel, view, 80, 24)


def _sky(attitude: Euler, width: int = 21, height: int = 10) -> list[list[bool]]:
    """Tell for each cell whether its upper pixel is sky."""
    return (sky_pixels(attitude, width, 2 * height)[::2] == SKY_CODE).tolist()


def test_horizon_level_has_sky_above_and_ground_below() -> None:
    rows = _sky(Euler(0.0, 0.0, 0.0))
    assert all(rows[0])
    assert not any(rows[-1])


def test_horizon_moves_down_when_the_nose_goes_up() -> None:
    def sky_rows(pitch_deg: float) -> int:
        return sum(row[0] for row in _sky(Euler(0.0, math.radians(pitch_deg), 0.0)))

    assert sky_rows(-15.0) < sky_rows(0.0) < sky_rows(15.0)


def test_horizon_rises_on_the_right_in_a_bank_to_the_right() -> None:
    rows = _sky(Euler(math.radians(20.0), 0.0, 0.0))
    left, right = sum(row[0] for row in rows), sum(row[-1] for row in rows)
    assert left > right


def test_heading_tape_has_the_heading_in_the_middle() -> None:
    assert heading_tape(math.radians(90.0), 11).plain[5] == "E"
    assert heading_tape(math.radians(359.0), 11).plain[5] == "N"
    assert heading_tape(math.radians(359.0), 21).plain[7:12] == " 359°"[:5]
    assert heading_tape(None, 5).plain == "  —  "


def test_lines_for_pipes() -> None:
    assert state_line(FULL, 10.0) == (
        "0:41.3  MISSION  armed  N +3.21 E -4.20 up 5.00 m  2.24 m/s  roll +11.5° pitch -5.7° yaw 074°  "
        "item 3 (last 6)  battery 76%  ×52.3"
    )
    assert state_line(VehicleView(), 0.0) == "waiting for a vehicle"
    assert state_line(FULL, 20.0) == "0:41.3 vehicle lost for 10 s"
    assert state_line(BARE, 10.0) == "—  —  disarmed"
    assert text_line(FULL.texts[4]) == "0:12.4  WARN: text number 4"


def test_a_small_window_says_that_no_mission_is_loaded_and_shows_no_negative_zero() -> None:
    view = FULL._replace(position_ned_m=Vector(0.0, 0.0, 0.01), geo=None, mission=Mission(0, 0))
    text = drawn(compact, view, 40, 10)
    assert "altitude 0.0 m" in text
    assert "mission  none loaded" in text


@pytest.mark.parametrize("width", range(30, 100))
def test_number_of_vehicles_is_shown_with_the_vehicle_only(width: int) -> None:
    assert FULL.identity is not None
    (line,) = status_line(FULL, 0.0, width, 1, DARK, vehicles=3, commands_all=True)
    assert (" of 3" in line.plain) == (f"{FULL.identity.kind} {FULL.identity.system_id} of 3" in line.plain)
