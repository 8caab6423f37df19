"""The terminal view drawn from snapshots."""

from __future__ import annotations

import io
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.console import Console, RenderableType

from gcs_cli.tui.horizon import heading_tape, horizon
from gcs_cli.tui.watch_lines import state_line, text_line
from gcs_cli.tui.watch_render import render
from gcs_cli.vehicle.view_types import (
    Battery,
    Euler,
    GeoPosition,
    Identity,
    LinkCounts,
    LoopTiming,
    Mission,
    Setpoint,
    StatusText,
    Vector,
    VehicleView,
)

TIMING = LoopTiming(41, 20500, 3, 2, 500, 100, 52.3, 13.2, 25.5, 130, 4, 5, 6, True)
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
    link=LinkCounts(1000, 3, 4, 9.9, 312.0, 9.0, 4),
)
SIZES = [(80, 24), (140, 40), (72, 20), (109, 50), (110, 20), (60, 15), (20, 5), (300, 100)]


def drawn(picture: RenderableType, width: int, height: int) -> list[str]:
    console = Console(
        width=width,
        height=height,
        file=io.StringIO(),
        force_terminal=True,
        color_system=None,
        legacy_windows=False,
    )
    console.print(picture, height=height, end="")
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue().removesuffix("\n").split("\n")


def screen(view: VehicleView, width: int = 80, height: int = 24, now_s: float = 10.0) -> str:
    return "\n".join(drawn(render(view, now_s, width, height), width, height))


@pytest.mark.parametrize(("width", "height"), SIZES)
@pytest.mark.parametrize("view", [FULL, BARE, VehicleView()], ids=["full", "bare", "none"])
def test_it_fits_every_window(view: VehicleView, width: int, height: int) -> None:
    lines = drawn(render(view, 10.0, width, height), width, height)
    assert len(lines) <= height
    assert max(len(line) for line in lines) <= width


@pytest.mark.parametrize(("width", "height"), [(80, 24), (140, 40)])
def test_it_shows_all_that_is_known(width: int, height: int) -> None:
    text = screen(FULL, width, height)
    for part in (
        "MISSION", "ARMED", "in air", "0:41.3", "×52.3", "99.7%", "312 msg/s",  # header
        "+11.5°", "-5.7°", "074°", "3.21", "3.33", "-4.20", "5.00", "2.24", "47.397742°",
        "0–3000 rpm", "2310", "2400", "51%", "item 3 (last 6)", "reached 2", "active",
        "500/100 Hz", "lockstep", "130", "overruns 3", "text number 7",
    ):  # fmt: skip
        assert part in text


def test_unknown_values_are_dashes() -> None:
    text = screen(BARE)
    assert "battery  —" in text
    assert "throttle —" in text
    assert "none loaded" in text
    assert "nan" not in text.lower()


def test_battery_is_shown_when_measured() -> None:
    assert "76% 12.1 V" in screen(FULL._replace(battery=Battery(0.76, 12.1, None)))


def test_real_time_shows_lateness_and_missed_deadlines() -> None:
    text = screen(FULL._replace(timing=TIMING._replace(lockstep=False)))
    assert "late 4/5/6" in text
    assert "missed 2" in text


def test_a_lost_vehicle_is_shown() -> None:
    assert "VEHICLE LOST for 8 s" in screen(FULL, now_s=17.5)
    assert "LOST" not in screen(FULL, now_s=14.0)


def test_a_vehicle_that_has_shut_down_is_not_lost() -> None:
    text = screen(FULL._replace(system_status=7), now_s=60.0)
    assert "SHUT DOWN" in text
    assert "LOST" not in text


def test_waiting_names_the_link() -> None:
    text = "\n".join(drawn(render(VehicleView(), 0.0, 80, 24, "UDP 127.0.0.1:14550"), 80, 24))
    assert "Waiting" in text
    assert "UDP 127.0.0.1:14550" in text


def test_long_messages_are_wrapped_and_the_newest_is_at_the_bottom() -> None:
    long = StatusText(8, 4, "refused because " + "very " * 20 + "unlikely", 1.0, 33.0)
    text = screen(FULL._replace(texts=(*FULL.texts, long)))
    lines = [line for line in text.splitlines() if "very" in line or "unlikely" in line]
    assert len(lines) > 1
    assert text.index("refused because") < text.index("unlikely")


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
    lines = drawn(render(view, 10.0, 80, 24), 80, 24)
    assert max(len(line) for line in lines) <= 80


def _sky(attitude: Euler, width: int = 21, height: int = 10) -> list[list[bool]]:
    """Tell for each cell whether its upper pixel is sky."""
    rows = []
    for line in horizon(attitude, width, height).split("\n"):
        colours = [line.get_style_at_offset(Console(), column).color for column in range(width)]
        rows.append([colour is not None and colour.name == "#1f5fa8" for colour in colours])
    return rows


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
    assert heading_tape(math.radians(90.0), 21).plain[10] == "E"
    assert heading_tape(math.radians(359.0), 21).plain[10] == "N"
    assert heading_tape(None, 5).plain == "  —  "


def test_lines_for_pipes() -> None:
    assert state_line(FULL, 10.0) == (
        "0:41.3  MISSION  armed  N +3.21 E -4.20 up 5.00 m  2.24 m/s  roll +11.5° pitch -5.7° yaw 074°  "
        "item 3 (last 6)  ×52.3"
    )
    assert state_line(VehicleView(), 0.0) == "waiting for a vehicle"
    assert state_line(FULL, 20.0) == "0:41.3 vehicle lost for 10 s"
    assert state_line(BARE, 10.0) == "—  —  disarmed"
    assert text_line(FULL.texts[4]) == "0:12.4  WARN: text number 4"


def test_a_small_window_says_that_no_mission_is_loaded_and_shows_no_negative_zero() -> None:
    text = screen(FULL._replace(position_ned_m=Vector(-0.01, 0.0, 0.0), mission=Mission(0, 0)), 40, 10)
    assert "north east up 0.0 0.0 0.0 m" in text
    assert "mission none loaded" in text
