"""Requests of a ``World``: their results, and the client that sends them."""

from __future__ import annotations

from dataclasses import replace

import pytest

from flightstack.core.contract import Vector3
from flightstack.core.port_numbers import GROUND
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from flightstack.services.routing.peer import PeerAddress
from flightstack.testing import RefusedError
from tests.support.truth import World


def test_refused_command_has_its_mav_result_and_reason() -> None:
    with World() as world, pytest.raises(RefusedError) as refusal:
        world.land()
    assert refusal.value.result == mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    assert refusal.value.reason == "the vehicle is disarmed"


def test_refused_upload_has_its_mav_mission_result() -> None:
    with World() as world:
        (item, *_) = world.setup.load_plan("square.plan").items
        with pytest.raises(RefusedError) as refusal:
            world.upload([replace(item, z=-50.0)])
    assert refusal.value.result != mavlink.MAV_MISSION_ACCEPTED
    assert refusal.value.reason.startswith("item 0")


def test_companion_sends_the_requests_while_the_ground_station_is_cut_off() -> None:
    with World() as world:
        world.sender = world.add_client("companion", is_companion=True)
        world.link.cut()
        world.takeoff(2.0)
        world.run_until("mode == 'HOLD'", 20.0)
        assert "COMMAND_ACK" in world.sender.received
    assert "COMMAND_ACK" not in world.gcs.received


def test_command_int_flies_to_a_position_within_a_centimetre() -> None:
    with World() as world:
        world.takeoff(2.0)
        world.run_until("mode == 'HOLD'")
        place = world.engine.stack.places.frame.to_geo(Vector3(3.0, -2.0, 0.0))
        x, y = round(place.latitude_deg * 1e7), round(place.longitude_deg * 1e7)
        frame = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
        world.command_int(mavlink.MAV_CMD_DO_REPOSITION, (-1, 1, 0, 0), x, y, 2.0, frame=frame)
        world.run_for(10.0)
        assert world.state.position_ned_m == pytest.approx((3.0, -2.0, -2.0), abs=0.01)


def test_world_ignores_what_the_vehicle_sends_to_other_peers() -> None:
    with World() as world:
        heartbeat = mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3)
        other = PeerAddress(GROUND, "another", 9)
        world.engine.stack.ground.receive(other, Link(250, 190).encode(heartbeat), world.time_s)
        world.run_for(1.0)
        assert world.gcs.counts["HEARTBEAT"] > 0
