"""Messages packed by precompiled formats equal pymavlink's, byte for byte."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.fields import PACKING_ERRORS, RANGES, fit
from flightstack.mavlink.link import Link
from flightstack.mavlink.packed import Packing
from flightstack.services.telemetry import motion, sensors
from tests.support.tools import NIGHTLY

PACKINGS = (*motion.PACKINGS, *sensors.PACKINGS)
SINGLES = st.floats(width=32) | st.sampled_from([0.0, -0.0, math.nan, math.inf, -math.inf])
BEYOND = st.one_of(
    st.integers(-(2**70), 2**70), st.floats(), st.sampled_from([3.5e38, -1e300, math.nan, math.inf])
)
"""Values of any field, most of them out of its range."""

EXAMPLES = 60 if NIGHTLY else 15
"""For each of 8 messages, whose fields have a few types: 120 examples by day."""


def in_range(code: str) -> st.SearchStrategy[float]:
    return SINGLES if code in "fd" else st.just(0) | st.integers(*RANGES[code])


def assert_equals_pymavlink(packing: Packing, values: list[float]) -> None:
    link, codec = Link(7, 1), mavlink.MAVLink(None, 7, 1)
    packed, message = packing(*values), packing.message(*values)
    assert (packed.get_type(), packed.get_msgId()) == (message.get_type(), message.get_msgId())
    try:
        frame = message.pack(codec)
    except PACKING_ERRORS:
        fit(message)
        frame = message.pack(codec)
    assert link.encode(packed) == frame


@pytest.mark.parametrize("packing", PACKINGS, ids=lambda packing: packing.name)
@settings(max_examples=EXAMPLES)
@given(data=st.data())
def test_packed_message_has_pymavlinks_bytes(packing: Packing, data: st.DataObject) -> None:
    values = data.draw(st.tuples(*map(in_range, packing.codes)))
    assert_equals_pymavlink(packing, list(values))


@pytest.mark.parametrize("packing", PACKINGS, ids=lambda packing: packing.name)
@settings(max_examples=EXAMPLES)
@given(data=st.data())
def test_packed_message_fits_values_out_of_range(packing: Packing, data: st.DataObject) -> None:
    size = len(packing.codes)
    values = data.draw(st.lists(BEYOND, min_size=size, max_size=size))
    assert_equals_pymavlink(packing, values)


def test_values_missing_at_the_end_of_a_message_are_zero() -> None:
    for packing in PACKINGS:
        size = len(packing.codes)
        assert packing(*[1] * (size - 1)).payload == packing(*[1] * (size - 1), 0).payload
        assert packing().payload == b"\x00"
