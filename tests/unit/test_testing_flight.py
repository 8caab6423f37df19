"""A flight of the test library: outcome, figures, signals, events, properties, log."""

from __future__ import annotations

import math
import pickle
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pyulog import ULog

import flightstack.testing
from flightstack.core.errors import ConfigError
from flightstack.testing import (
    Flight,
    PropertyViolationError,
    Setup,
    State,
    flight_signals,
)
from flightstack.testing.expression import SIGNALS
from flightstack.testing.flight import signals_of
from flightstack.testing.log import unit_of
from gcs_cli.report.analysis import flight_of
from gcs_cli.report.summary import RunInfo, summarise
from gcs_cli.scenarios.figures import metrics_of
from tests.support.truth import World


@pytest.fixture
def world() -> Iterator[World]:
    with World(vehicle="x_quad") as made:
        yield made


@pytest.fixture(scope="module")
def flight() -> Flight:
    """One flight of the square in gusts, for all that only reads it."""
    with World(vehicle="x_quad", wind=(3.0, 1.0), gust=1.0, seed=5) as made:
        return made.fly("square")


def test_flight_is_shown_as_its_outcome(flight: Flight) -> None:
    """pytest has room for that in the message of a failed assertion."""
    assert repr(flight) == "Flight(completed: the mission was flown to its end)"
    assert repr(replace(flight, result=None)) == "Flight(without an outcome)"


# ---------------------------------------------------------------------- flights


def test_refused_flight_has_its_outcome_and_no_samples() -> None:
    with World(vehicle="x_quad", battery_percent=1.0) as world:
        flight = world.fly("square")
    assert flight.outcome == "refused"
    assert not flight.completed
    assert (flight.reached, flight.modes, flight.texts, dict(flight.log)) == ([], (), [], {})
    assert math.isnan(flight.max_error_m)
    assert math.isnan(flight.rms_error_m)
    assert math.isnan(flight.landing_error_m)
    assert "refused" in str(flight)
    with pytest.raises(ConfigError, match="has no samples: arming refused"):
        flight.always("altitude_m < 2")


def test_flight_of_a_vehicle_that_was_never_armed_is_empty(world: World) -> None:
    flight = world.flight()
    assert not flight.log
    with pytest.raises(ConfigError, match="the vehicle was not armed"):
        flight.at(0.0)


def test_figures_equal_those_of_the_summary(flight: Flight) -> None:
    summary = summarise(flight_of(flight.log.content, "log"), flight.plan, RunInfo(flight.outcome, "square"))
    assert flight.completed
    assert flight.reached == [row["seq"] for row in summary["waypoints"] if row["reached"]]
    assert flight.max_error_m == pytest.approx(summary["max_tracking_error_m"], abs=1e-6)
    assert flight.rms_error_m == pytest.approx(summary["rms_tracking_error_m"], abs=1e-6)
    assert flight.duration_s == pytest.approx(summary["sim_time_s"], abs=1e-6)


def test_signals_agree_with_the_log(flight: Flight) -> None:
    position = flight.log["vehicle_local_position"]
    signals = flight.signals
    assert np.array_equal(signals.values["altitude_m"], -position["z"])
    assert np.array_equal(signals.time_s, position.time_s)
    assert np.all(np.diff(signals.time_s) > 0.0)
    sample = flight.at(float(signals.time_s[100]))
    assert sample.altitude_m == signals.values["altitude_m"][100]
    part = flight.between(5.0, 6.0)
    assert part.time_s[0] >= 5.0
    assert part.time_s[-1] <= 6.0
    assert len(part.values["mode"]) == len(part.time_s)


def test_signals_are_made_once_and_only_if_asked_for(flight: Flight, monkeypatch: pytest.MonkeyPatch) -> None:
    values = signals_of(flight).values
    assert list(values) == list(SIGNALS)
    assert {values[name].shape for name in SIGNALS} == {flight.signals.time_s.shape}
    known = values["roll_deg"]
    monkeypatch.setattr(flight_signals, "MAKERS", {})
    assert values["roll_deg"] is known
    with pytest.raises(KeyError):
        values["no_signal"]


def test_signals_are_copied_whole(flight: Flight) -> None:
    copy = pickle.loads(pickle.dumps(flight.signals))
    assert list(copy.values) == list(flight.signals.values)
    assert copy.values["altitude_m"].tolist() == flight.signals.values["altitude_m"].tolist()


def test_figures_of_a_flight_need_few_signals(flight: Flight, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("mode", "item", "distance_to_home_m", "error_m"):
        monkeypatch.delitem(flight_signals.MAKERS, name)
    assert metrics_of(replace(flight))["max_tilt_deg"] > 1.0


def test_error_is_that_of_the_flight(world: World) -> None:
    """The setpoint sinks half a metre into the ground after the touchdown."""
    errors_m: list[float] = []
    world.watch(lambda: errors_m.append(world.state.error_m))
    flight = world.fly("hop")
    world.run_for(1.0)
    assert flight.signals.values["error_m"].max() == flight.max_error_m < 0.1
    assert max(errors_m) == pytest.approx(flight.max_error_m, abs=0.01)
    assert flight.signals.values["error_m"][-1] == errors_m[-1] == 0.0
    flight.always("error_m < 0.1")


def test_signals_of_a_vehicle_on_its_sensors_are_true() -> None:
    """The estimate follows GNSS and the setpoint follows the estimate: only the truth shows how far off both are."""
    states: list[State] = []
    with flightstack.testing.World() as sensed:
        sensed.watch(lambda: states.append(sensed.state))
        flight = sensed.fly("hop")
    flown = [state for state in states if state.time_s >= flight.signals.time_s[0]]
    for name in ("north_m", "east_m", "altitude_m"):
        found = np.interp([s.time_s for s in flown], flight.signals.time_s, flight.signals.values[name])
        assert np.abs(found - [getattr(state, name) for state in flown]).max() < 0.05
    assert max(state.error_m for state in flown) == pytest.approx(flight.max_error_m, abs=0.02)
    known = flight.data.tracking_error().values.max()
    assert known < 0.2 < flight.max_error_m - known  # 0.07 m of 0.7 m


def test_failsafe_ends_with_disarming(world: World) -> None:
    world.takeoff(3.0)
    world.run_until("altitude_m > 2.5", timeout_s=20.0)
    world.param_set("NAV_DLL_ACT", 3)  # land
    world.link.cut()
    world.run_until("landed", timeout_s=60.0)
    assert world.state.failsafe
    world.run_until("not armed", timeout_s=10.0)
    assert not world.state.failsafe
    world.flight().always("failsafe and armed after failsafe")


def test_modes_and_events_are_in_order(flight: Flight) -> None:
    assert [span.mode for span in flight.modes][:2] == ["HOLD", "MISSION"]
    assert all(one.end_s == two.begin_s for one, two in zip(flight.modes, flight.modes[1:], strict=False))
    names = [event.name for event in flight.events]
    assert names.index("takeoff") < names.index("item_1") < names.index("landing")
    times_s = [event.time_s for event in flight.events]
    assert times_s == sorted(times_s)


def test_violation_is_an_assertion_with_the_values(flight: Flight) -> None:
    assert flight.always("altitude_m < 50").margin > 0.0
    assert flight.eventually("landed within 120 s of takeoff").holds
    assert flight.until("armed", "landed").holds
    assert flight.within("altitude_m > 2", "landed", limit_s=120.0).holds
    with pytest.raises(PropertyViolationError, match=r"violated at t = .*\n.*altitude_m = "):
        flight.always("altitude_m < 1 after takeoff")


def test_sample_before_the_flight_is_an_error(flight: Flight) -> None:
    with pytest.raises(IndexError, match="the flight begins at"):
        flight.at(-1.0)


# ---------------------------------------------------------------------- log


def test_topics_equal_those_of_pyulog(flight: Flight, tmp_path: Path) -> None:
    path = tmp_path / "flight.ulg"
    path.write_bytes(flight.log.content)
    reference = ULog(str(path))
    assert set(flight.log) == {item.name for item in reference.data_list}
    for item in reference.data_list:
        topic = flight.log[item.name]
        assert np.array_equal(topic.time_s, item.data["timestamp"] * 1e-6)
        for key, values in item.data.items():
            name, bracket, index = key.partition("[")
            if bracket:
                np.testing.assert_array_equal(topic[name][:, int(index.rstrip("]"))], values)
            elif key != "timestamp":
                np.testing.assert_array_equal(topic[name], values)
    assert flight.log.parameters == reference.initial_parameters
    assert flight.texts == [text.message for text in reference.logged_messages]


def test_unknown_names_list_what_there_is(flight: Flight) -> None:
    with pytest.raises(KeyError, match=r"no topic speed; it has .*vehicle_local_position"):
        flight.log["speed"]
    with pytest.raises(KeyError, match=r"topic vehicle_local_position has no field speed; it has .*vz"):
        flight.log["vehicle_local_position"]["speed"]


@pytest.mark.parametrize(
    ("field", "unit"),
    [
        ("vx", "m/s"), ("z", "m"), ("torque_n_m", "N m"), ("thrust_n", "N"), ("rotor_rad_s", "rad/s"),
        ("accel_rad_s2", "rad/s²"), ("voltage_v", "V"), ("wait_us", "µs"), ("q", ""), ("nav_state", ""),
        ("distance_m", "m"), ("lat", "°"), ("alt", "m"),
    ],
)  # fmt: skip
def test_units_follow_from_the_names(field: str, unit: str) -> None:
    assert unit_of(field) == unit


def test_setup_text_is_what_was_changed() -> None:
    assert Setup(seed=2, params={"A": 1.0}).changed() == {"seed": 2, "params": {"A": 1.0}}
