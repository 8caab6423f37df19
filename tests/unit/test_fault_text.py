"""The text of faults of the simulator: both notations, and what is refused."""

from __future__ import annotations

import math
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightstack.core.contract import Vector3
from sim_bridge.errors import UsageProblemError
from sim_bridge.plant.faults.schedule import Fault, Kind, parse_fault
from sim_bridge.plant.faults.table import TABLE, Row


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("rotor:2:off@12.5", Fault(Kind.ROTOR_OFF, 1, 0.0, 12_500_000)),
        ("rotor:2:weak=0.7@10-20", Fault(Kind.ROTOR_WEAK, 1, 0.7, 10_000_000, 20_000_000)),
        ("rotor:1:stuck=150@8", Fault(Kind.ROTOR_STUCK, 0, 150.0, 8_000_000)),
        ("state:freeze@10-12", Fault(Kind.STATE_FREEZE, -1, 0.0, 10_000_000, 12_000_000)),
        ("state:nan@5-5.1", Fault(Kind.STATE_NAN, -1, 0.0, 5_000_000, 5_100_000)),
        ("state:drop@5-6", Fault(Kind.STATE_DROP, -1, 0.0, 5_000_000, 6_000_000)),
        ("battery:level=0.1@20", Fault(Kind.BATTERY_LEVEL, -1, 0.1, 20_000_000)),
        ("rotor:4:off", Fault(Kind.ROTOR_OFF, 3)),
        ("sensor:imu2:off@3", Fault(Kind.SENSOR_OFF, begin_us=3_000_000, sensor="imu2")),
        ("sensor:gyro:bias=1,-2,3", Fault(Kind.SENSOR_BIAS, vector=Vector3(1.0, -2.0, 3.0), sensor="gyro")),
        ("sensor:baro:drift=-0.1", Fault(Kind.SENSOR_DRIFT, vector=Vector3(-0.1, 0.0, 0.0), sensor="baro")),
        ("sensor:gnss:jam=0.5", Fault(Kind.GNSS_JAM, value=0.5, sensor="gnss")),
        ("sensor:mag:turn=90", Fault(Kind.MAG_TURN, value=90.0, sensor="mag")),
    ],
)
def test_fault_is_parsed(text: str, fault: Fault) -> None:
    assert parse_fault(text, 4) == fault


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "the part is not one of rotor, payload,"), ("rotor", "expected rotor N dead, rotor N efficiency SHARE"),
        ("rotor:off@3", "expected rotor:N:off, rotor:N:weak=SHARE (SHARE 0 to 1), rotor:N:stuck=RAD_S (RAD_S 0 to"),
        ("rotor:1:dance", "expected rotor:N:off"), ("state:1:freeze", "expected state:freeze, state:nan, state:drop"),
        ("engine:off", "the part is not one of rotor"), ("engine off", "the part is not one of rotor"),
        ("rotor:0:off", "rotors 1 to 4"), ("rotor:5:off", "rotors 1 to 4"), ("rotor:x:off", "rotors 1 to 4"),
        ("rotor:1:off=3", "expected rotor:N:off"), ("rotor:1:weak", "expected rotor:N:weak=SHARE (SHARE 0 to 1)"),
        ("rotor:1:weak=2", "0 to 1"),
        ("rotor:1:weak=much", "not a number"), ("rotor:1:stuck=nan", "0 to 100000"), ("rotor:1:weak=1_0", "0 to 1"),
        ("rotor:1:off@", "a time is missing after @"), ("rotor:1:off@-3", "the begin must be 0 to 1000000 s"),
        ("rotor:1:off@5-", "a time is missing after -"), ("rotor:1:off@-", "a time is missing after @"),
        ("rotor:1:off@5-5", "not after its begin"), ("rotor:1:off@5-4", "not after its begin"),
        ("rotor:1:off@inf", "0 to 1000000"), ("battery:level=0.5@3-4", "give no end"), ("battery:level=-1", "0 to 1"),
        ("rotor 5 dead", "rotors 1 to 4"), ("rotor 1 delayed 3", "SECONDS must be 0.0001 to 2 s"),
        ("payload heavy", "expected payload KG at X,Y,Z (KG 0.001 to 100 kg; X,Y,Z -2 to 2 m)"),
        ("payload 1 at 0,0", "X,Y,Z must be three numbers separated by commas, each -2 to 2 m"),
        ("payload 1 at 0,0,3", "Z must be -2 to 2 m"),
        ("payload cut @3-4", "acts at one time: give no end"),
        ("wind step 5", "three numbers"), ("state late", "expected state late SECONDS (SECONDS 0.0001 to 10 s)"),
        ("ground effect maybe", "expected ground effect on or ground effect off"), ("gust -1", "M_S must be 0 to 100"),

        ("rotor:2:off@2--3", "the end must be 0 to 1000000 s"),
        ("wind:step=1,2,x", "D 'x' is not a number"), ("rotor=1=off", "the part is not one of rotor, payload"),
        ("battery  level 2", "0 to 1"),
        ("sensor:sonar:off", "'sonar' is not a sensor: imu, gyro, accel, mag, baro, gnss, range, flow; imu2, gyro2"),
        ("sensor:mag2:off", "'mag2' is not a sensor"), ("sensor gyro0 off", "'gyro0' is not a sensor"),
        ("sensor:imu:bias=1,2,3", "imu is gyro and accelerometer: name one of them"),
        ("sensor:imu:noise=1", "imu is gyro and accelerometer"),
        ("sensor:mag:noise=11", "SPREAD must be 0 to 10 gauss"),
        ("sensor:gyro:bias=1", "VALUE of gyro must be 3 numbers separated by commas, each -2000 to 2000 °/s"),
        ("sensor:baro:bias=1,2", "VALUE of baro must be one number, -1000 to 1000 hPa"),
        ("sensor:mag:bias=0,0,11", "VALUE must be -10 to 10 gauss"), ("sensor baro bias x", "'x' is not a number"),
        ("sensor:gyro:jam=0.5", "expected sensor:SENSOR:off, sensor:SENSOR:freeze"),
        ("sensor:mag:loss=2", "SHARE must be 0 to 1"), ("sensor", "expected sensor SENSOR off, sensor SENSOR frozen"),
    ],
)  # fmt: skip
def test_a_bad_fault_is_named_in_one_sentence(text: str, said: str) -> None:
    with pytest.raises(UsageProblemError) as caught:
        parse_fault(text, 4, "--fault")
    assert said in str(caught.value)
    assert str(caught.value).startswith(f"--fault {text}: ")
    assert "\n" not in str(caught.value)


WORDS = {
    "rotor 2 dead": Fault(Kind.ROTOR_OFF, 1), "rotor 2 efficiency 0.7": Fault(Kind.ROTOR_WEAK, 1, 0.7),
    "rotor 2 stuck 150": Fault(Kind.ROTOR_STUCK, 1, 150.0), "rotor 2 delayed 0.05": Fault(Kind.ROTOR_DELAYED, 1, 0.05),
    "payload 0.3 at 0.1,0,0.05": Fault(Kind.PAYLOAD, value=0.3, vector=Vector3(0.1, 0.0, 0.05)),
    "payload cut": Fault(Kind.PAYLOAD_CUT),
    "centre of gravity 0.02, 0, 0": Fault(Kind.CENTRE, vector=Vector3(0.02, 0.0, 0.0)),
    "wind step 5,0,-1": Fault(Kind.WIND_STEP, vector=Vector3(5.0, 0.0, -1.0)),
    "gust 2": Fault(Kind.WIND_GUST, value=2.0),
    "wind shear 0.14": Fault(Kind.WIND_SHEAR, value=0.14), "ground effect on": Fault(Kind.GROUND_EFFECT),
    "ground effect off": Fault(Kind.GROUND_EFFECT_OFF), "battery level 0.2": Fault(Kind.BATTERY_LEVEL, value=0.2),
    "battery sag 0.05": Fault(Kind.BATTERY_SAG, value=0.05), "battery cell dead": Fault(Kind.BATTERY_CELL),
    "state frozen": Fault(Kind.STATE_FREEZE), "state nan": Fault(Kind.STATE_NAN),
    "state dropped": Fault(Kind.STATE_DROP),
    "sensor gyro2 off": Fault(Kind.SENSOR_OFF, sensor="gyro2"),
    "sensor imu frozen": Fault(Kind.SENSOR_FREEZE, sensor="imu"),
    "sensor mag bias 0.1, 0, 0": Fault(Kind.SENSOR_BIAS, vector=Vector3(0.1, 0.0, 0.0), sensor="mag"),
    "sensor gnss drift 0.5,0,0": Fault(Kind.SENSOR_DRIFT, vector=Vector3(0.5, 0.0, 0.0), sensor="gnss"),
    "sensor baro noise 2": Fault(Kind.SENSOR_NOISE, value=2.0, sensor="baro"),
    "sensor flow late 0.2": Fault(Kind.SENSOR_LATE, value=0.2, sensor="flow"),
    "sensor range loss 0.3": Fault(Kind.SENSOR_LOSS, value=0.3, sensor="range"),
    "sensor gnss jammed 0.9": Fault(Kind.GNSS_JAM, value=0.9, sensor="gnss"),
    "sensor mag turned 90": Fault(Kind.MAG_TURN, value=90.0, sensor="mag"),
    "sensor imu vibration 10": Fault(Kind.VIBRATION, value=10.0, sensor="imu"),
    "state late 0.1": Fault(Kind.STATE_LATE, value=0.1), "clock stalled": Fault(Kind.CLOCK_STALL),
    "clock jump -0.5": Fault(Kind.CLOCK_JUMP, value=-0.5), "clear": Fault(Kind.CLEAR),
}  # fmt: skip
VALUES = {
    "N": "3",
    "SHARE": "0.25",
    "X,Y,Z": "0.1,0.2,-0.3",
    "N,E,D": "1,-2,3",
    "SENSOR": "accel2",
    "VALUE": "1,2,3",
}


@pytest.mark.parametrize("text", WORDS)
def test_fault_in_words_is_parsed(text: str) -> None:
    assert parse_fault(text, 4) == WORDS[text]
    assert parse_fault(f" {text} @ 3.5", 4) == WORDS[text]._replace(begin_us=3_500_000)


def test_words_of_this_test_are_the_whole_table() -> None:
    assert {fault.kind for fault in WORDS.values()} == set(Kind) == {row.kind for row in TABLE}


@pytest.mark.parametrize("row", TABLE, ids=lambda row: row.compact)
def test_both_notations_of_a_row_are_the_same_fault(row: Row) -> None:
    compact, words = row.compact, row.words
    for name in sorted(("N", "SENSOR", "VALUE", *row.ranges), key=len, reverse=True):
        value = VALUES.get(name, "0.5")
        compact, words = (re.sub(rf"\b{name}(?![\w,])", value, text) for text in (compact, words))
    fault = parse_fault(f"{compact}@7", 4)
    assert fault == parse_fault(f"{words} @7", 4)
    assert fault.kind is row.kind
    assert fault.begin_us == 7_000_000


@settings(max_examples=300)
@given(
    st.one_of(
        st.text(max_size=40),
        st.from_regex(
            r"(rotor:\d*:|state:|battery:|payload[: ]|sensor:(gyro2|baro|mag|imu):)\w*=?[\d.e,-]*@?[\d.e-]*"
        ),
    )
)
def test_any_fault_text_is_parsed_or_rejected(text: str) -> None:
    try:
        fault = parse_fault(text, 4)
    except UsageProblemError:
        return
    assert fault.begin_us >= 0
    assert math.isfinite(fault.value)
