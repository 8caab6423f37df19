"""Messages from FIELD=VALUE words, and their fields as text."""

from __future__ import annotations

import math

import pytest

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from gcs_cli.completion import message_names
from gcs_cli.vehicle.message_fields import FieldError, made_message, message_class, shown, values_of


def made(text: str, target: tuple[int, int] = (7, 1)) -> object:
    name, *words = text.split()
    message, _ = made_message(name, words, target)
    (decoded,) = Link(0, 0).decode(Link(255, 190).encode(message))
    return decoded


def test_message_is_made_of_its_fields() -> None:
    message = made("command_long command=COMPONENT_ARM_DISARM param1=1 param2=nan")
    assert (message.target_system, message.target_component, message.command) == (7, 1, 400)  # type: ignore[attr-defined]
    assert message.param1 == 1.0  # type: ignore[attr-defined]
    assert math.isnan(message.param2)  # type: ignore[attr-defined]
    assert shown(message, "command") == "MAV_CMD_COMPONENT_ARM_DISARM"


@pytest.mark.parametrize(
    ("text", "field", "value"),
    [
        ("76 target_system=3", "target_system", 3),
        ("HEARTBEAT type=MAV_TYPE_GCS", "type", 6),
        ("HEARTBEAT base_mode=MANUAL_INPUT_ENABLED|MAV_MODE_FLAG_TEST_ENABLED", "base_mode", 66),
        ("HEARTBEAT custom_mode=0x10", "custom_mode", 16),
        ("STATUSTEXT text=hello", "text", "hello"),
        ("ACTUATOR_CONTROL_TARGET controls=0.5,-1", "controls", [0.5, -1.0, 0, 0, 0, 0, 0, 0]),
        ("ESC_STATUS rpm=1,2,3,4", "rpm", [1, 2, 3, 4]),
        ("LANDING_TARGET q=1,0,0,0", "q", [1.0, 0.0, 0.0, 0.0]),
    ],
)
def test_field_has_the_value(text: str, field: str, value: object) -> None:
    assert values_of(made(text))[field] == value


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("ATITUDE", "ATITUDE: the dialect has no such message; did you mean ATTITUDE"),
        ("60000", "60000: the dialect has no such message"),
        ("COMMAND_LONG comand=1", "comand: COMMAND_LONG has no such field; did you mean command?"),
        ("SYSTEM_TIME x=1", "x: SYSTEM_TIME has no such field; its fields are time_unix_usec, time_boot_ms"),
        ("COMMAND_LONG command", "command is not FIELD=VALUE"),
        ("COMMAND_LONG command=FLY", "command: 'FLY' is not a whole number or a name of MAV_CMD"),
        ("COMMAND_LONG command=70000", "command: 70000 is outside the allowed range 0 to 65535"),
        ("COMMAND_LONG param1=fast", "param1: 'fast' is not a number"),
        ("HEARTBEAT custom_mode=1.5", "custom_mode: '1.5' is not a whole number"),
        ("MANUAL_CONTROL x=-32769", "x: -32769 is outside the allowed range -32768 to 32767"),
        ("ESC_STATUS rpm=1,2,3,4,5", "rpm: 5 values, of 4"),
        (f"STATUSTEXT text={'x' * 51}", "is longer than 50 bytes"),
    ],
)
def test_wrong_word_is_named(text: str, said: str) -> None:
    with pytest.raises(FieldError) as error:
        made(text)
    assert said in str(error.value)


def test_every_message_of_the_dialect_can_be_made() -> None:
    for number, kind in mavlink.mavlink_map.items():
        message, _ = made_message(str(number), (), (1, 1))
        assert message_class(kind.msgname.lower()) is kind
        assert Link(255, 190).encode(message)


def test_completion_knows_the_messages_of_the_dialect() -> None:
    """Those of ArduPilot alone are known once such a vehicle was heard."""
    kinds = mavlink.mavlink_map.values()
    known = {kind.msgname for kind in kinds if not kind.__module__.endswith("ardupilotmega")}
    assert set(message_names("")) == known
    assert message_names("attitude_q") == ["attitude_quaternion", "attitude_quaternion_cov"]
