"""Signed links from end to end: a vehicle with a key file, and pymavlink's ``setup_signing`` on a real socket."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

import pytest

from tests.interop.stack import HOST, RealVehicle
from tests.interop.witness import Witness, mavutil

mavlink = mavutil.mavlink
KEY, OTHER_KEY = bytes(range(32)), bytes(range(1, 33))
NAME = "MIS_TAKEOFF_ALT"


@pytest.fixture(scope="module")
def signed_vehicle(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RealVehicle]:
    directory = tmp_path_factory.mktemp("signed-vehicle")
    path = directory / "key"
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT, 0o600), "w") as file:
        file.write(KEY.hex())
    vehicle = RealVehicle(directory, 1.0, "--signing-key", str(path))
    yield vehicle
    vehicle.stop()


@pytest.fixture
def script(signed_vehicle: RealVehicle) -> Iterator[Witness]:
    """A script that has no key yet: it hears the vehicle, but is not heard."""
    script = connect(signed_vehicle)
    yield script
    script.close()


def connect(vehicle: RealVehicle) -> Witness:
    return Witness(f"tcp:{HOST}:{vehicle.tcp_port}", 1 + vehicle.instance)


def sign(script: Witness, key: bytes = KEY, **options: Any) -> None:
    """Use a key from now on, and hear the vehicle's time first: the script before this one did, and was as far.

    Timestamps are counted on in tens of microseconds, so a burst of the vehicle's takes them ahead of the clock,
    and a new script that believes the clock alone would repeat what the old one, of the same ids, has used.
    """
    script.connection.setup_signing(key, **options)
    good = script.mav.signing.goodsig_count
    script.until("HEARTBEAT", lambda _: script.mav.signing.goodsig_count > good)


def set_message(script: Witness, value: float) -> Any:
    name = NAME.encode()
    return mavlink.MAVLink_param_set_message(script.system, 1, name, value, mavlink.MAV_PARAM_TYPE_REAL32)


def first_answer(script: Witness) -> float:
    """Ask for the parameter, and return the first value that comes: that of an earlier PARAM_SET, if it was taken.

    TCP keeps the order, so that no time has to pass to know that something was not answered.
    """
    script.connection.param_fetch_one(NAME)
    value = script.until("PARAM_VALUE")
    assert value.get_signed()
    return float(value.param_value)


def test_what_is_signed_is_taken_and_what_is_not_is_refused(script: Witness) -> None:
    flags = script.until("HEARTBEAT").get_header().incompat_flags
    assert flags & mavlink.MAVLINK_IFLAG_SIGNED  # whoever has no key may listen
    script.mav.send(set_message(script, 6.0))
    script.connection.setup_signing(OTHER_KEY, allow_unsigned_callback=lambda *_: True)
    script.mav.send(set_message(script, 7.0))
    sign(script)
    assert first_answer(script) == 2.5
    script.mav.send(set_message(script, 5.0))
    assert script.until("PARAM_VALUE").param_value == 5.0
    assert script.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1).result == mavlink.MAV_RESULT_ACCEPTED
    assert script.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0).result == mavlink.MAV_RESULT_ACCEPTED
    assert script.mav.signing.goodsig_count > 0


def test_what_was_heard_is_not_taken_again_on_any_link(script: Witness, signed_vehicle: RealVehicle) -> None:
    sign(script)
    message = set_message(script, 5.0)
    script.mav.send(message)
    assert script.until("PARAM_VALUE").param_value == 5.0
    script.mav.send(set_message(script, 4.0))
    assert script.until("PARAM_VALUE").param_value == 4.0
    other = connect(signed_vehicle)
    try:
        for witness in (script, other):
            witness.connection.write(message.get_msgbuf())
        sign(other)
        assert first_answer(other) == 4.0
        assert first_answer(script) == 4.0
    finally:
        other.close()


def test_the_key_is_changed_on_the_ground_only(script: Witness, signed_vehicle: RealVehicle) -> None:
    sign(script, allow_unsigned_callback=lambda *_: True)
    change = (script.system, 1, list(OTHER_KEY), script.mav.signing.timestamp)
    script.connection.arducopter_arm()
    script.connection.motors_armed_wait()
    script.mav.setup_signing_send(*change)
    script.until("STATUSTEXT", lambda text: text.text == "Signing key refused: the vehicle is armed")
    script.connection.arducopter_disarm()
    script.connection.motors_disarmed_wait()
    script.mav.setup_signing_send(*change)
    script.connection.setup_signing(OTHER_KEY)
    script.until("STATUSTEXT", lambda text: text.text == "Signing is on: a new key is in use")
    assert first_answer(script) == 4.0
    assert bytes.fromhex((signed_vehicle.log.parent / "key").read_text()) == OTHER_KEY
