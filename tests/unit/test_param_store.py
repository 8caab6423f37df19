"""The parameter store: a value is always one that was declared, and float32 is one precision for every way in."""

from __future__ import annotations

import math
import struct
from decimal import Decimal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightstack.core.errors import ConfigError
from flightstack.core.float32 import shortest
from flightstack.params.behaviour import SPECS
from flightstack.params.spec import ParamSpec
from flightstack.params.store import ParamStore, apply_assignments

GAIN = ParamSpec("GAIN", 1.0 / 3.0, 0.0, 0.7, "1/s", "A computed default, an end that float32 misses")
COUNT = ParamSpec("COUNT", 3, -1, 2_000_000, "", "Integer", is_integer=True)
ACTION = ParamSpec("ACTION", 0, 0, 5, "", "Enumeration", True, choices=((0, "None"), (2, "Land"), (5, "End")))
ANY = ParamSpec("ANY", 0.0, -1e6, 1e6, "", "Anything")
ALL = (GAIN, COUNT, ACTION, ANY)

numbers = st.floats(width=64) | st.integers(-(10**400), 10**400).map(
    lambda n: math.inf if abs(n) > 1e308 else n
)


def float32(value: float) -> float:
    return struct.unpack("<f", struct.pack("<f", value))[0]


@given(st.lists(st.tuples(st.sampled_from([spec.name for spec in ALL] + ["NONE"]), numbers)))
def test_values_stay_in_range_and_refusals_change_nothing(changes) -> None:
    store, heard = ParamStore(ALL), []
    store.subscribe(lambda name, value: heard.append((name, value)))
    for name, value in changes:
        before, count = store.values(), len(heard)
        refusal = store.set(name, value)
        if refusal is not None:
            assert store.values() == before
            assert len(heard) == count
            assert refusal
        else:
            assert float32(store.value(name)) == pytest.approx(value, rel=1e-6, abs=1e-38)
            assert (len(heard) > count) == (store.value(name) != before[name])
        for spec in ALL:
            now = store.value(spec.name)
            assert spec.low <= now <= spec.high
            assert isinstance(now, int) == spec.is_integer
        assert store.value("ACTION") in (0, 2, 5)
    assert dict(heard).items() <= store.values().items(), "the last news of each is what it is"


@given(st.floats(-1e6, 1e6))
def test_a_value_is_the_same_by_any_way(value: float) -> None:
    """Typed, sent as float32, and read back from what a client saw."""
    typed, sent = ANY.accepted(value), ANY.accepted(float32(value))
    assert typed == sent
    assert isinstance(typed, float)
    assert float32(typed) == float32(value)
    assert ANY.accepted(float32(typed)) == typed


@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_the_shortest_decimal_names_the_float32(value: float) -> None:
    short = shortest(value)
    assert float32(short) == value
    assert digits(short) <= digits(value)


def digits(value: float) -> int:
    """Count the significant digits of a number as Python writes it."""
    return len(Decimal(repr(value)).normalize().as_tuple().digits)


def test_ends_and_default_survive_float32() -> None:
    store = ParamStore([GAIN])
    assert float32(0.7) != 0.7
    assert store.set("GAIN", float32(0.7)) is None
    assert store.value("GAIN") == 0.7
    assert store.set("GAIN", float32(1.0 / 3.0)) is None
    assert store.value("GAIN") == 1.0 / 3.0
    assert store.is_default("GAIN")
    assert store.set("GAIN", 0.70001) == "0.70001 is outside 0 to 0.7 1/s"


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        ("NONE", 1.0, "there is no such parameter"),
        ("COUNT", 1.5, "1.5 is not a whole number"),
        ("COUNT", math.nan, "nan is outside -1 to 2000000"),
        ("ACTION", 1, "1 is not one of 0, 2, 5"),
        ("ACTION", 6, "6 is outside 0 to 5"),
        ("ANY", -math.inf, "-inf is outside -1000000 to 1000000"),
        ("ANY", -(10**400), "-inf is outside -1000000 to 1000000"),
    ],
)
def test_a_refusal_is_a_sentence(name: str, value: float, sentence: str) -> None:
    assert ParamStore(ALL).set(name, value) == sentence


def test_listeners_hear_changes_alone_and_reset_is_one() -> None:
    store, heard = ParamStore(ALL), []
    store.subscribe(lambda name, value: heard.append((name, value)))
    store.set("COUNT", 3)
    store.set("COUNT", 4)
    store.set("COUNT", 4)
    store.set("ANY", 2.5)
    store.reset(["COUNT", "NO_SUCH"])
    assert heard == [("COUNT", 4), ("ANY", 2.5), ("COUNT", 3)]
    store.reset()
    assert heard[3:] == [("ANY", 0.0)]
    assert all(store.is_default(name) for name in store.specs)


def test_override_lasts_until_parameter_is_set() -> None:
    store, heard = ParamStore(ALL), []
    apply_assignments(store, ["any=2", "ANY = 3", "COUNT=3"])
    store.subscribe(lambda name, value: heard.append((name, value)))
    assert (store.value("ANY"), store.is_overridden("ANY"), store.is_overridden("COUNT")) == (3.0, True, True)
    store.set("ANY", 3.0)
    store.reset(["COUNT"])
    assert heard == [("ANY", 3.0), ("COUNT", 3)], "the same number, but now it is to stay"
    assert not store.is_overridden("ANY")


def test_assignments_that_cannot_be() -> None:
    for text, sentence in (
        ("COUNT=1.5", "--param: COUNT=1.5: 1.5 is not a whole number"),
        ("NONE=1", "--param: NONE: the vehicle has no such parameter; `gcs param list` shows them"),
        ("ANY=x", "--param: ANY=x must be NAME=VALUE with a number"),
    ):
        with pytest.raises(ConfigError) as error:
            apply_assignments(ParamStore(ALL), [text])
        assert str(error.value) == sentence


def test_names_are_sorted_and_single() -> None:
    assert list(ParamStore(ALL).specs) == ["ACTION", "ANY", "COUNT", "GAIN"]
    with pytest.raises(ValueError, match="twice"):
        ParamStore([GAIN, GAIN])


def test_declarations_are_sound() -> None:
    for spec in SPECS.values():
        assert spec.accepted(spec.default) == spec.default, spec
        assert spec.group != "Miscellaneous", spec
        assert not spec.help.endswith("."), spec
        if spec.is_integer:
            assert spec.decimals == 0, spec
            assert all(float(number).is_integer() for number in (spec.default, spec.low, spec.high)), spec
        for choice, meaning in spec.choices:
            assert spec.low <= choice <= spec.high, spec
            assert meaning[0].isupper(), spec


LEAST = ParamSpec("THR_MIN", 1.0, 0.0, 100.0, "N", "Least")
LARGEST = ParamSpec("THR_MAX", 10.0, 0.0, 100.0, "N", "Largest", at_least="THR_MIN")
limits = st.tuples(
    st.sampled_from(["THR_MIN", "THR_MAX"]), st.sampled_from([0.0, 1.0, 5.0, 10.0, 20.0, 50.0])
)


def test_a_parameter_of_a_pair_beyond_the_other_is_refused() -> None:
    store = ParamStore((LEAST, LARGEST))
    assert store.set("THR_MIN", 11.0) == "11 is above THR_MAX, which is 10"
    assert store.set("THR_MAX", 0.5) == "0.5 is below THR_MIN, which is 1"
    assert store.set("THR_MIN", 10.0) is None
    assert store.values() == {"THR_MAX": 10.0, "THR_MIN": 10.0}


@given(st.lists(limits), st.sampled_from([None, ["THR_MIN"], ["THR_MAX"]]))
def test_a_pair_is_in_order_at_every_change(changes, names) -> None:
    store = ParamStore((LEAST, LARGEST))
    seen = store.values()

    def check(name: str, value: float) -> None:  # a listener passes each change on, such as to a target
        seen[name] = value
        assert seen["THR_MIN"] <= seen["THR_MAX"]

    store.subscribe(check)
    for name, value in changes:
        store.set(name, value)
    store.reset(names)
    assert store.is_default("THR_MIN") or names == ["THR_MAX"]
    assert store.is_default("THR_MAX") or names == ["THR_MIN"]


@pytest.mark.parametrize("order", [("THR_MIN=20", "THR_MAX=30"), ("THR_MAX=30", "THR_MIN=20"),
                                   ("THR_MAX=0.5", "THR_MIN=0.25"), ("THR_MIN=0.25", "THR_MAX=0.5")])  # fmt: skip
def test_a_pair_is_given_in_any_order(order: tuple[str, str]) -> None:
    store = ParamStore((LEAST, LARGEST))
    apply_assignments(store, order)
    assert store.values() == {name: float(value) for name, value in (text.split("=") for text in order)}
    with pytest.raises(ConfigError, match="THR_MIN=60: 60 is above THR_MAX, which is 50"):
        apply_assignments(store, ("THR_MIN=60", "THR_MAX=50"))
