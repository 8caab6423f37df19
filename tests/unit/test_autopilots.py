"""The facts about each autopilot: mode names and numbers, and the form of its commands."""

from __future__ import annotations

import math

import pytest

from flightstack.core.enums import CUSTOM_MODE
from flightstack.mavlink.dialect import mavlink
from flightstack.services.telemetry.modes import MODES, NOT_SELECTABLE
from gcs_cli.actions.on_vehicle import find_mode, mode_choices
from gcs_cli.autopilots.autopilot import Autopilot, Role
from gcs_cli.autopilots.registry import autopilot_of
from gcs_cli.vehicle.view_types import AvailableMode, Identity, VehicleView

QUADROTOR = int(mavlink.MAV_TYPE_QUADROTOR)
PX4 = autopilot_of(mavlink.MAV_AUTOPILOT_PX4)
ARDUPILOT = autopilot_of(mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)
GENERIC = autopilot_of(mavlink.MAV_AUTOPILOT_GENERIC)


def test_autopilots_are_chosen_by_the_number_in_the_heartbeat() -> None:
    assert [facts.name for facts in (PX4, ARDUPILOT, GENERIC)] == ["px4", "ardupilot", "generic"]
    assert autopilot_of(99) is GENERIC


def test_px4_modes_are_named_by_main_and_sub_mode() -> None:
    assert PX4.mode_name(QUADROTOR, 4 << 16 | 5 << 24) == "RTL"
    assert PX4.mode_name(QUADROTOR, 3 << 16) == "POSITION"
    assert PX4.mode_name(QUADROTOR, 77 << 16) is None
    assert PX4.mode_number("loiter", QUADROTOR) == PX4.mode_number("Hold", QUADROTOR) == 4 << 16 | 3 << 24
    assert PX4.mode_number("nonsense", QUADROTOR) is None


def test_arducopter_modes_are_those_of_its_enumeration() -> None:
    assert ARDUPILOT.mode_name(QUADROTOR, 4) == "GUIDED"
    assert ARDUPILOT.mode_name(mavlink.MAV_TYPE_GROUND_ROVER, 4) == "HOLD"
    assert ARDUPILOT.mode_number("alt hold", QUADROTOR) == ARDUPILOT.mode_number("ALT_HOLD", QUADROTOR) == 2


@pytest.mark.parametrize("facts", [PX4, ARDUPILOT], ids=lambda facts: facts.name)
def test_every_role_has_a_mode(facts: Autopilot) -> None:
    for role in facts.roles:
        assert facts.role_mode(role, QUADROTOR) is not None


def test_modes_of_our_vehicle_are_px4s() -> None:
    for entry in MODES:
        assert PX4.mode_name(QUADROTOR, CUSTOM_MODE[entry.mode]) is not None
        selectable = not entry.properties & NOT_SELECTABLE
        assert PX4.selectable(QUADROTOR, CUSTOM_MODE[entry.mode]) == selectable


def test_hold_of_arducopter_needs_no_remote_control() -> None:
    assert ARDUPILOT.roles[Role.HOLD] == "BRAKE"


def test_mode_commands_have_each_autopilots_form() -> None:
    assert PX4.select_mode(4 << 16 | 6 << 24).params == (1.0, 4.0, 6.0)
    assert ARDUPILOT.select_mode(17).params == (1.0, 17.0)


def test_yaw_is_a_reposition_on_px4_and_a_condition_on_ardupilot() -> None:
    turn = PX4.yaw(90.0)
    assert (turn.number, turn.params[3]) == (mavlink.MAV_CMD_DO_REPOSITION, pytest.approx(math.pi / 2))
    assert ARDUPILOT.yaw(90.0)[:2] == (mavlink.MAV_CMD_CONDITION_YAW, (90.0, 0.0, 0.0, 0.0))


def test_selectable_modes_come_from_the_table_until_the_vehicle_lists_them() -> None:
    view = VehicleView(identity=Identity(1, 1, QUADROTOR, mavlink.MAV_AUTOPILOT_PX4))
    choices = mode_choices(view)
    assert "HOLD" in choices
    assert "TERMINATION" not in choices


@pytest.mark.parametrize(
    ("name", "mode"),
    [
        ("auto.loiter", "HOLD"),
        ("AUTO.MISSION", "MISSION"),
        ("auto:rtl", "RTL"),
        ("AUTO.FOLLOW_TARGET", "FOLLOW"),
    ],
)
def test_px4_modes_have_the_names_of_its_console_and_of_mavros(name: str, mode: str) -> None:
    assert PX4.mode_number(name, QUADROTOR) == PX4.mode_number(mode, QUADROTOR)


def test_any_mode_number_is_sent_to_a_vehicle_whose_modes_are_unknown() -> None:
    view = VehicleView(identity=Identity(1, 1, QUADROTOR, mavlink.MAV_AUTOPILOT_GENERIC))
    assert find_mode(view, "7") == 7
    assert find_mode(view, str(2**32)) is None
    listed = view._replace(modes=(AvailableMode(3, "Cruise", True, 0),))
    assert (find_mode(listed, "3"), find_mode(listed, "cruise"), find_mode(listed, "7")) == (3, 3, None)
