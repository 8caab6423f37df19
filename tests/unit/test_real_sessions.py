"""Recorded sessions with real autopilots, folded into the view.

``tests/data`` holds pieces of recordings in real time: ArduCopter SITL 90700977, thinned to some messages, and PX4 SIH
f2471861, its first 2.5 s whole and its flight thinned.
"""

from __future__ import annotations

import lzma
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from flightstack.mavlink.link import Link
from gcs_cli.actions.conditions import is_ready, parse_condition
from gcs_cli.actions.on_vehicle import find_mode, mode_choices
from gcs_cli.actions.run import refusal_reason
from gcs_cli.link.tlog import decode_records
from gcs_cli.vehicle.view_builder import update
from gcs_cli.vehicle.view_types import VehicleView

DATA = Path(__file__).parents[1] / "data"


def views(name: str, without: Sequence[str] = ()) -> list[VehicleView]:
    """Return the state of the vehicle after each frame of a recording, except for messages of these types."""
    link, view, seen = Link(0, 0, keeps_unknown=True), VehicleView(), []
    records = list(decode_records(lzma.decompress((DATA / f"{name}.tlog.xz").read_bytes())))
    for record in records:
        for message in link.decode(record.frame):
            if message.get_type() in without:
                continue
            view = update(view, message, (record.time_us - records[0].time_us) / 1e6)
            seen.append(view)
    return seen


def values(seen: list[VehicleView], read: Callable[[VehicleView], object]) -> list[object]:
    """Return the values in the order of their first appearance, without repetitions in a row."""
    found = [read(view) for view in seen]
    return [value for index, value in enumerate(found) if index == 0 or value != found[index - 1]]


@pytest.fixture(scope="module")
def arducopter() -> list[VehicleView]:
    return views("arducopter_flight")


def test_arducopter_names_its_modes(arducopter: list[VehicleView]) -> None:
    assert values(arducopter, lambda view: view.mode) == [None, "STABILIZE", "GUIDED", "AUTO"]


def test_arducopter_reports_its_state(arducopter: list[VehicleView]) -> None:
    view = arducopter[-1]
    assert view.home is not None
    assert view.home.altitude_m == pytest.approx(488.08)
    assert view.gnss is not None
    assert (view.gnss.fix_name, view.gnss.satellites) == ("RTK fixed", 10)
    assert view.estimator is not None
    assert view.estimator.healthy
    assert view.wind_ned_m_s is not None
    assert view.battery is not None
    assert view.rotor_rpm == ()  # 0.8 A and no speed


def test_arducopter_mission_is_counted_without_its_home(arducopter: list[VehicleView]) -> None:
    missions = [view.mission for view in arducopter]
    assert (missions[-1].current, missions[-1].total, missions[-1].reached) == (3, 4, 2)
    assert min(mission.current for mission in missions if mission.current is not None) == 0


def test_arducopter_can_arm_once_its_filter_has_a_position(arducopter: list[VehicleView]) -> None:
    assert values(arducopter, lambda view: view.can_arm) == [None, False, True, False, True]
    at_first_refusal = next(view for view in arducopter if any("Need Pos" in t.text for t in view.texts))
    assert not at_first_refusal.can_arm


def test_arducopter_takes_off_to_an_altitude_above_home(arducopter: list[VehicleView]) -> None:
    """The recorded NAV_TAKEOFF asks for 6 m; home is 488 m above the sea."""
    climb = [view.geo for view in arducopter if view.mode == "GUIDED" and view.armed and view.geo]
    assert climb[-1].relative_altitude_m == pytest.approx(6.0, abs=0.1)  # measured: 5.98
    assert climb[-1].altitude_m == pytest.approx(494.0, abs=0.5)


def test_arducopter_says_why_it_refuses_to_arm(arducopter: list[VehicleView]) -> None:
    last = next(view for view in reversed(arducopter) if view.texts and "Arm: Need" in view.texts[-1].text)
    assert refusal_reason(last, 0) == "Need Position Estimate"


def test_px4_lists_its_modes_under_the_names_of_other_clients() -> None:
    view = views("px4_sih_start")[-1]
    assert len(view.modes) == view.mode_total == 25
    assert {"HOLD", "POSITION", "ORBIT"} <= set(mode_choices(view))
    assert find_mode(view, "auto.loiter") == find_mode(view, "hold")
    assert find_mode(view, "posctl") == find_mode(view, "position")


def test_px4_reports_its_state() -> None:
    seen = views("px4_sih_flight")
    view = seen[-1]
    assert values(seen, lambda view: view.mode) == [None, "HOLD", "MISSION", "RTL"]
    assert view.estimator is not None
    assert view.gnss is not None
    assert (view.gnss.fix_name, view.gnss.satellites) == ("3D fix", 10)
    assert view.mission.reached == 2
    assert values(seen, lambda view: view.on_ground)[:3] == [None, True, False]


def test_px4_mission_without_a_state_is_complete_at_its_return() -> None:
    """PX4 f2471861 sends no MISSION_STATE, and does not report the return as reached."""
    seen, complete = views("px4_sih_flight"), parse_condition("complete")
    held = [complete.holds(view) for view in seen]
    first = held.index(True)
    assert (seen[first - 1].mode, seen[first].mode, seen[first].mission.current) == ("MISSION", "RTL", 3)
    assert all(held[first:])
    assert values(seen, lambda view: view.mission.is_end_unknown) == [False, True, False]


def test_px4_mission_whose_items_are_unknown_is_of_unknown_end() -> None:
    seen, complete = (
        views("px4_sih_flight", without=("MISSION_COUNT", "MISSION_ITEM_INT")),
        parse_condition("complete"),
    )
    assert not any(complete.holds(view) for view in seen)
    assert seen[-1].mission.is_end_unknown
    assert "does not report the state" in complete.value(seen[-1])


def test_px4_has_a_position_while_it_stands() -> None:
    """PX4 sets the flag of a constant position in ESTIMATOR_STATUS for a vehicle at rest."""
    view = views("px4_sih_start")[-1]
    assert view.has_position
    assert is_ready(view)


def test_messages_unknown_to_the_dialect_do_not_count_as_lost() -> None:
    link = views("px4_sih_start")[-1].link
    assert link.received > 1500
    assert link.lost == 0


def test_recording_of_ardupilot_is_read_with_its_dialect() -> None:
    content = lzma.decompress((DATA / "arducopter_flight.tlog.xz").read_bytes())
    script = (
        "import sys; from gcs_cli.logs.tlog_reader import read_tlog; "
        "log = read_tlog(sys.stdin.buffer.read(), 'a.tlog'); "
        "print(log.unknown, sorted({topic.name for topic in log.topics} & {'WIND', 'ESC_TELEMETRY_1_TO_4'}))"
    )
    done = subprocess.run([sys.executable, "-c", script], input=content, capture_output=True, check=True)
    assert done.stdout.decode().strip() == "0 ['ESC_TELEMETRY_1_TO_4', 'WIND']"
