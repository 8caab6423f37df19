"""The parameter client: long lists, unknown names, integers of every width in both encodings."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Link
from flightstack.mavlink.param_values import LARGEST_INTEGER, parse_value, set_value
from gcs_cli.clients.param_client import ParamClient, ParamDone, ParamFailed
from tests.protocol.param_harness import Station, World, store_of
from tests.support.param_worlds import NAN, SEEDS, all_told, ignore_errors, world_of


def test_an_unknown_parameter_of_a_mute_vehicle_is_known_within_two_seconds() -> None:
    """PX4 does not answer about a parameter that does not exist."""
    world = world_of()
    ignore_errors(world.stations["gcs"])
    result = world.get("gcs", "NONE")
    assert isinstance(result, ParamFailed)
    assert (result.silent, "it seems to have no such parameter" in result.reason) == (False, True)
    assert world.now_s - 100.0 == pytest.approx(5 * 0.25)


@settings(max_examples=40)
@given(seed=SEEDS)
def test_an_existing_parameter_is_read_at_once_without_probes(seed: int) -> None:
    world = World(store_of(), Station("gcs"))
    world.get("gcs", f"P{seed % 99:03d}"[:4] + "_LONG_NAME_12"[: seed % 99 % 13])
    assert world.stations["gcs"].codec.sent == 1


KINDS = {1: (0, 255), 2: (-128, 127), 3: (0, 65535), 4: (-32768, 32767), 5: (0, 2**24), 6: (-(2**24), 2**24)}


@given(kind=st.sampled_from(sorted(KINDS)), data=st.data(), casts=st.booleans())
def test_integers_of_every_width_pass_in_both_encodings(kind: int, data: st.DataObject, casts: bool) -> None:
    low, high = KINDS[kind]
    if not casts:
        low, high = max(low, -LARGEST_INTEGER), min(high, LARGEST_INTEGER)
    number = data.draw(st.integers(low, high))
    field = set_value(float(number), kind, casts=casts)
    assert field is not None
    sent = mavlink.MAVLink_param_value_message(b"P", field, kind, 1, 0)
    (received,) = Link(255, 190).decode(Link(1, 1).encode(sent))
    told = parse_value(received, casts=casts)
    assert told is not None
    assert (told.value, told.is_integer, told.kind) == (number, True, kind)
    assert set_value(float(KINDS[4][1] + 1), 4, casts=casts) is None
    assert parse_value(mavlink.MAVLink_param_value_message(b"P", NAN, kind, 1, 0), casts=True) is None


def test_a_list_leaves_out_types_that_are_not_supported() -> None:
    client = ParamClient(Address(1, 1), Address(255, 190))
    client.start_list()
    client.poll(100.0)
    link = Link(1, 1)
    for index, kind in enumerate((9, 10, 6)):
        message = mavlink.MAVLink_param_value_message(b"P%d" % index, 0.0, kind, 3, index)
        for received in Link(255, 190).decode(link.encode(message)):
            client.receive(received, 100.0)
    assert isinstance(client.result, ParamDone)
    assert [parameter.name for parameter in client.result.parameters] == ["P0", "P2"]


def test_a_list_of_a_thousand_takes_half_a_second_and_one_request() -> None:
    world = world_of(1000)
    assert all_told(world, world.list("gcs"))
    assert world.now_s - 100.0 < 0.55  # measured: 0.50 s
    assert world.stations["gcs"].codec.sent == 1
    assert world.stations["gcs"].vehicle_codec.sent == 1001  # with the digest
