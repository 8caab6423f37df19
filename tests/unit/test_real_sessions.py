"""Recorded sessions with real autopilots, folded into the view.

``tests/data`` holds pieces of recordings in real time: ArduCopter SITL 90700977, thinned to some messages, and PX4 SIH
f2471861, its first 2.5 s whole and its flight thinned.
"""

from __future__ import annotations

import lzma
from collections.abc import Callable
from pathlib import Path

import pytest

from flightstack.mavlink.link import Link
from gcs_cli.actions.conditions import Completion, is_ready, parse_condition
from gcs_cli.link.tlog import decode_records
from gcs_cli.vehicle.vehicle_view import update
from gcs_cli.vehicle.view_types import MISSION_ACTIVE, MISSION_COMPLETE, Identity, Mission, VehicleView

DATA = Path(__file__).parents[1] / "data"


def views(name: str) -> list[VehicleView]:
    """Return the state of the vehicle after each frame of a recording."""
    link, view, seen = Link(0, 0, keeps_unknown=True), VehicleView(), []
    records = list(decode_records(lzma.decompress((DATA / f"{name}.tlog.xz").read_bytes())))
    for record in records:
        for message in link.decode(record.frame):
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
    assert len(view.rotor_rpm) == 4
    assert view.mission.reached == 3


def test_arducopter_can_arm_once_its_filter_has_a_position(arducopter: list[VehicleView]) -> None:
    assert values(arducopter, lambda view: view.can_arm) == [None, False, True, False, True]
    at_first_refusal = next(view for view in arducopter if any("Need Pos" in t.text for t in view.texts))
    assert not at_first_refusal.can_arm


def test_px4_reports_its_state() -> None:
    seen = views("px4_sih_flight")
    view = seen[-1]
    assert values(seen, lambda view: view.mode) == [None, "HOLD", "MISSION", "RTL"]
    assert view.estimator is not None
    assert view.gnss is not None
    assert (view.gnss.fix_name, view.gnss.satellites) == ("3D fix", 10)
    assert view.mission.reached == 2
    assert values(seen, lambda view: view.on_ground)[:3] == [None, True, False]


@pytest.mark.parametrize("ends_with_return", [True, False])
def test_px4_mission_without_a_state_is_complete_at_its_return(ends_with_return: bool) -> None:
    """PX4 f2471861 sends no MISSION_STATE, and does not report the return as reached."""
    seen, completion = views("px4_sih_flight"), Completion(ends_with_return)
    held = [completion.holds(view) for view in seen]
    if not ends_with_return:
        assert not any(held)
        assert "does not report the state" in parse_condition("complete").value(seen[-1])
        return
    first = held.index(True)
    assert (seen[first - 1].mode, seen[first].mode, seen[first].mission.current) == ("MISSION", "RTL", 3)
    landed = seen[-1]._replace(armed=False, landed_state=1, mode="HOLD")
    assert completion.holds(landed)
    assert Completion(ends_with_return).holds(landed)  # a client that connects later


def test_completed_mission_counts_until_it_begins_again() -> None:
    """PX4 clears the state when the vehicle disarms."""
    view, completion = VehicleView(identity=Identity(1, 1, 2, 12)), Completion()
    states = (MISSION_ACTIVE, MISSION_COMPLETE, 2, MISSION_ACTIVE)
    views = [view._replace(mission=Mission(0, 3, None, state)) for state in states]
    assert [completion.holds(view) for view in views] == [False, True, True, False]


def test_px4_has_a_position_while_it_stands() -> None:
    """PX4 sets the flag of a constant position in ESTIMATOR_STATUS for a vehicle at rest."""
    view = views("px4_sih_start")[-1]
    assert view.has_position
    assert is_ready(view)


def test_messages_unknown_to_the_dialect_do_not_count_as_lost() -> None:
    link = views("px4_sih_start")[-1].link
    assert link.received > 1500
    assert link.lost == 0
