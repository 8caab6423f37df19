"""Parameters of the target: list, read, write, refusal."""

from __future__ import annotations

import math

import pytest

from flightstack.core.float32 import as_float32
from flightstack.firmware.numbers import TARGET_NUMBERS, default_numbers
from flightstack.mavlink.dialect import mavlink
from tests.firmware.app_support import (
    GCS,
    REAL32,
    RESET,
    Target,
    command,
    kinds,
    read,
    step,
    write,
)
from tests.firmware.codec_support import sealed

DOES_NOT_EXIST, OUT_OF_RANGE = 1, 2
COUNT = len(TARGET_NUMBERS)


# ---------------------------------------------------------------------------------------------------- parameters


def test_a_list_has_every_number_once_in_order_with_its_default(target: Target) -> None:
    told = target.ask(mavlink.MAVLink_param_request_list_message(1, 1))
    assert kinds(told) == ["PARAM_VALUE"] * COUNT
    assert [message.param_id for message in told] == [number.name for number in TARGET_NUMBERS]
    assert [message.param_index for message in told] == list(range(COUNT))
    assert {(message.param_count, message.param_type) for message in told} == {(COUNT, REAL32)}
    defaults = default_numbers()
    wrong = [
        m.param_id for m in told if m.param_value != pytest.approx(defaults[m.param_id], rel=1e-6, abs=1e-9)
    ]
    assert wrong == []


def test_a_list_under_way_lets_a_report_pass(target: Target) -> None:
    """The line takes a frame at a time; the step is asked for in the middle of the list, which begins once more."""
    target.give(target.pack(mavlink.MAVLink_param_request_list_message(1, 1)))
    first = target.heard(target.take(120))
    assert kinds(first) == ["PARAM_VALUE"] * len(first)
    target.give(target.pack(step(0, RESET)))
    rest = kinds(target.heard())
    assert "FS_PIL_REPORT" in rest[:2]  # behind what was begun
    assert len(first) + rest.count("PARAM_VALUE") == COUNT


def test_who_asks_for_the_list_again_gets_all_of_it(target: Target) -> None:
    request = target.pack(mavlink.MAVLink_param_request_list_message(1, 1))
    target.give(request)
    target.heard(target.take(37 * 50))
    target.give(request)
    told = target.heard()
    assert [m.param_index for m in told if m.get_type() == "PARAM_VALUE"][-COUNT:] == list(range(COUNT))


def test_numbers_are_read_by_name_and_by_index(target: Target) -> None:
    for index, number in enumerate(TARGET_NUMBERS):
        by_name, by_index = target.ask(read(number.name)), target.ask(read("", index))
        assert [m.param_index for m in by_name + by_index] == [index, index]
        assert {m.param_id for m in by_name + by_index} == {number.name}


@pytest.mark.parametrize(
    ("name", "index"),
    [("", COUNT), ("", 32767), ("NO_SUCH", -1), ("POS_XY_P_AND_MORE", -1), ("", -1), ("pos_xy_p", -32768)],
)
def test_what_is_not_there_is_refused_by_name(target: Target, name: str, index: int) -> None:
    (error,) = target.ask(read(name, index))
    assert error.get_type() == "PARAM_ERROR"
    assert (error.error, error.param_index, error.param_id) == (DOES_NOT_EXIST, index, name[:16])
    assert (error.target_system, error.target_component) == GCS


def test_a_name_that_is_not_ascii_is_no_parameter(target: Target) -> None:
    payload = b"\xff\xff\x01\x01" + bytes(range(0xF0, 0x100))
    target.give(sealed(20, payload))
    (error,) = target.heard()
    assert error.error == DOES_NOT_EXIST


def test_a_change_is_told_and_kept(target: Target) -> None:
    (told,) = target.ask(write("POS_XY_P", 1.1))
    assert (told.get_type(), told.param_id, told.param_value) == ("PARAM_VALUE", "POS_XY_P", as_float32(1.1))
    assert target.ask(read("POS_XY_P"))[0].param_value == as_float32(1.1)
    (told,) = target.ask(write("FS_ROTORS", 6.0, mavlink.MAV_PARAM_TYPE_INT32))  # the number in the float
    assert told.param_value == 6.0


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("POS_XY_P", math.nan), ("POS_XY_P", math.inf), ("POS_XY_P", -math.inf), ("POS_XY_P", -1.0),
        ("FS_ROTORS", 9.0), ("FS_ROTORS", 4.5), ("FS_MASS", 0.0), ("FS_CTRL", 2.0), ("FS_SPIN_3", 3e38),
    ],
)  # fmt: skip
def test_a_value_out_of_range_is_refused_and_the_old_one_told(
    target: Target, name: str, value: float
) -> None:
    (before,) = target.ask(read(name))
    error, told = target.ask(write(name, value))
    assert (error.get_type(), error.error, error.param_id) == ("PARAM_ERROR", OUT_OF_RANGE, name)
    assert error.param_index == -1
    assert (told.get_type(), told.param_value) == ("PARAM_VALUE", before.param_value)


def test_an_unknown_parameter_cannot_be_set(target: Target) -> None:
    (error,) = target.ask(write("NO_SUCH", 1.0))
    assert (error.get_type(), error.error, error.param_index) == ("PARAM_ERROR", DOES_NOT_EXIST, -1)


@pytest.mark.parametrize(("system", "component"), [(2, 1), (1, 2), (0, 2), (255, 190)])
def test_what_is_for_others_is_not_answered(target: Target, system: int, component: int) -> None:
    requests = [
        read("POS_XY_P", -1, system, component),
        write("POS_XY_P", 1.0, REAL32, system, component),
        mavlink.MAVLink_param_request_list_message(system, component),
        command(mavlink.MAV_CMD_REQUEST_MESSAGE, 148, system=system, component=component),
        mavlink.MAVLink_ping_message(0, 0, system, component),
    ]
    assert target.ask(*requests) == []


@pytest.mark.parametrize(("system", "component"), [(0, 0), (1, 0), (0, 1)])
def test_what_is_for_everybody_is_answered(target: Target, system: int, component: int) -> None:
    assert kinds(target.ask(read("POS_XY_P", -1, system, component))) == ["PARAM_VALUE"]
    assert kinds(target.ask(command(4711, system=system, component=component))) == ["COMMAND_ACK"]
