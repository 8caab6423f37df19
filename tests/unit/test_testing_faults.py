"""Faults of links and simulator in a world: overlaps, delayed begins, and what may not be lost silently."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flightstack.core.errors import ConfigError
from flightstack.mavlink.dialect import mavlink
from flightstack.params.vehicle import GRAVITY_M_S2, load_vehicle
from flightstack.testing import Setup, load_scenario, run_scenario
from flightstack.testing.link import PERFECT
from flightstack.testing.properties import Signals, Window, always
from tests.support.truth import World


def test_overlapping_faults_of_a_link_end_each_at_its_own_time() -> None:
    with World() as world:
        channel = world.link.to_vehicle
        world.fault("link cut", for_s=1.0)
        world.run_for(0.5)
        world.fault("link loss 0.3", for_s=1.0)
        world.run_for(0.7)
        assert channel.conditions == PERFECT._replace(loss=0.3)
        world.run_for(0.5)
        assert channel.conditions == PERFECT


def test_restored_link_is_not_cut_again_at_the_end_of_a_fault() -> None:
    with World() as world:
        world.fault("link delay 0.2", for_s=1.0)
        world.link.restore()
        world.fault("link delay 0.1")
        world.run_for(1.2)
        assert world.link.to_vehicle.conditions == PERFECT._replace(delay_s=0.1)


def test_fault_that_begins_later_is_an_event_then() -> None:
    with World() as world:
        world.fault("rotor:1:weak=0.9@0.5")
        assert not world.events
        world.run_for(0.6)
        assert [(round(event.time_s, 1), event.name) for event in world.events] == [(0.5, "fault")]


def test_fault_of_a_sensor_is_refused_on_the_true_state() -> None:
    with World(state="truth") as world, pytest.raises(ConfigError, match="flies on the true state"):
        world.fault("sensor:mag:off")


@pytest.mark.parametrize("fault", ["state:freeze", "state nan", "state:drop", "state late 0.01"])
def test_fault_of_the_state_is_refused_on_sensors(fault: str) -> None:
    with World(state="estimated") as world, pytest.raises(ConfigError, match="flies on its sensors"):
        world.fault(fault)


def test_gravity_of_the_filter_is_that_of_the_simulator() -> None:
    with World(state="estimated") as world:
        estimation = world.engine.stack.estimation
        assert estimation is not None
        assert estimation.estimator.params.gravity_m_s2 == GRAVITY_M_S2


def test_setup_and_conditions_are_not_mixed() -> None:
    with pytest.raises(TypeError, match="give a setup or conditions, not both: seed"):
        World(Setup(), seed=7)


def test_unknown_condition_names_the_nearest_one() -> None:
    with pytest.raises(TypeError, match=r"wnd is no condition of a flight: did you mean wind\?"):
        World(wnd=(5.0, 0.0))


@pytest.mark.parametrize(
    ("conditions", "problem"),
    [
        ({"wind": (5.0, 0.0)}, "wind: wind cannot act: the vehicle paper_quad has no drag; set drag to true"),
        ({"gust": 1.0}, "gust: wind cannot act: the vehicle paper_quad has no drag; set drag to true"),
        (
            {"wind": (5.0, 0.0), "plant": "paper"},
            "wind: wind cannot act: the paper's model has no drag; use plant rigid or multibody",
        ),
        (
            {"drag": True, "plant": "paper"},
            "drag: the paper's model has no drag; use plant rigid or multibody",
        ),
        (
            {"drag": True, "vehicle": "x_quad"},
            "drag: the file of the vehicle x_quad has no optional_drag_n_s_m; its linear_drag_n_s_m acts anyway",
        ),
    ],
)
def test_wind_without_drag_names_the_keyword_to_set(conditions: dict[str, Any], problem: str) -> None:
    with pytest.raises(ConfigError) as caught:
        World(**conditions)
    assert str(caught.value) == problem


@pytest.mark.parametrize(
    ("conditions", "problem"),
    [
        ({"wind": 5.0}, "wind: 5.0 must be 2 or 3 numbers"),
        ({"wind": "north"}, "wind: 'north' must be 2 or 3 numbers"),
        ({"wind": "12"}, "wind: '12' must be 2 or 3 numbers"),
        ({"wind": (1, 2, 3, 4)}, "wind: (1, 2, 3, 4) must be 2 or 3 numbers"),
        ({"boat": (1.0, 2.0, 0.0)}, "boat: (1.0, 2.0, 0.0) must be 2 numbers"),
        ({"force": (1.0, 2.0)}, "force: (1.0, 2.0) must be 3 numbers"),
        ({"torque": ("a", "b", "c")}, "torque: ('a', 'b', 'c') must be 3 numbers"),
        ({"gust": "x"}, "gust: 'x' is not a number"),
        ({"seed": 1.5}, "seed: 1.5 is not a whole number"),
        ({"seed": "x"}, "seed: 'x' is not a whole number"),
        ({"seed": -1}, "seed: -1 is outside the allowed range 0 to 9.22337e+18"),
    ],
)
def test_condition_of_another_kind_is_refused(conditions: dict[str, Any], problem: str) -> None:
    with pytest.raises(ConfigError) as caught:
        World(vehicle="x_quad", **conditions)
    assert str(caught.value) == problem


def test_unknown_parameter_names_the_keyword_of_the_world() -> None:
    with pytest.raises(ConfigError, match=r"^params: MPC_XY_CRUSE: the vehicle has no such parameter"):
        World(params={"MPC_XY_CRUSE": 1.0})


def test_missing_plan_names_the_examples_without_another_error() -> None:
    with pytest.raises(ConfigError, match=r"the example plans are .*; did you mean square\?$") as caught:
        Setup().load_plan("sqare")
    assert caught.value.__context__ is None


@pytest.mark.parametrize("plan", ["nowhere/square.plan", "square.waypoints", "/nowhere/hop.plan"])
def test_missing_plan_is_not_replaced_by_an_example(plan: str) -> None:
    with pytest.raises(ConfigError, match="cannot be read"):
        Setup().load_plan(plan)


def test_event_outside_the_flight_is_no_window() -> None:
    time_s = np.arange(0.0, 10.0, 0.1)
    signals = Signals(time_s, {"altitude_m": time_s}, {"link_cut": [20.0]})
    with pytest.raises(ConfigError, match="has no sample of this flight"):
        always(signals, "altitude_m > 1000", Window("link_cut", 0.5))


def test_lost_piece_of_a_text_is_no_error() -> None:
    with World() as world:
        for sequence in (1, 0, 1, 1):
            world.gcs.session.observe(mavlink.MAVLink_statustext_message(6, b"x" * 50, 7, sequence))
        assert [len(text) for text in world.gcs.texts] == [100]


def test_events_go_on_while_a_request_waits_for_its_answer(tmp_path: Path) -> None:
    path = tmp_path / "late.toml"
    path.write_text(
        """
        duration_s = 6
        [[event]]
        at_s = 0.5
        link = "delay 1.5"
        [[event]]
        at_s = 1.0
        command = "arm"
        [[event]]
        at_s = 1.2
        link = "restore"
        [expect]
        outcome = "any"
        """
    )
    scenario = replace(load_scenario(path), path=path)
    verdict = run_scenario(scenario)
    times = {event.name: event.time_s for event in verdict.flight.caused}
    assert times["link_restore"] == pytest.approx(1.2, abs=0.02)


def test_scenario_has_a_slope_or_a_boat(tmp_path: Path) -> None:
    path = tmp_path / "ground.toml"
    for text, slope_rad, boat in (
        ("slope_deg = 10", math.radians(10.0), (0.0, 0.0, 0.0)),
        ("boat_m_s = [1, -0.5]", 0.0, (1.0, -0.5, 0.0)),
    ):
        path.write_text(f"duration_s = 1\n{text}\n[expect]")
        _, options = load_scenario(path).setup(1).plant_options(load_vehicle("x_quad"))
        assert (options.slope_rad, options.boat_ned_m_s) == (slope_rad, boat)
    path.write_text('duration_s = 1\nslope_deg = 10\nplant = "paper"\n[expect]')
    with pytest.raises(ConfigError, match="slope_deg: the ground of the paper plant is level"):
        load_scenario(path).setup(1).check()


def test_sensor_fault_of_a_scenario_is_flown(tmp_path: Path) -> None:
    path = tmp_path / "sensor.toml"
    path.write_text(
        """
        duration_s = 1
        vehicle = "x_quad"
        state = "estimated"
        [[event]]
        at_s = 0.5
        fault = "sensor baro bias 12"
        [expect]
        outcome = "any"
        """
    )
    with World(load_scenario(path).setup(1)) as world:
        world.run_for(0.6)
        before_hpa = world.engine.stack.estimation.samples.baro.pressure_hpa
        world.fault("sensor baro bias 12")
        world.run_for(0.4)
        assert world.engine.stack.estimation.samples.baro.pressure_hpa - before_hpa == pytest.approx(
            12.0, abs=0.1
        )
    assert [event.name for event in run_scenario(load_scenario(path)).flight.caused] == ["fault"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('seed = inf\nduration_s = 1\n[expect]', "is not a whole number"),
        (f"limit_s = 1{'0' * 400}\n[expect]", "is not a number"),
        ('duration_s = 1\n[[client]]\nname = "gcs"\n[expect]', "client\\[0\\].name"),
        ('duration_s = 1\n[[client]]\nname = "a b"\n[expect]', "client\\[0\\].name"),
        ('duration_s = 1\n[[client]]\nname = "a"\n[[client]]\nname = "a"\n[expect]', "client\\[1\\].name"),
        ('duration_s = 1\n[[event]]\nat_s = 1\nfault = "rotor 1 dead"\nclient = "gcs"\n[expect]', "link and command"),
    ],
    ids=range(6),
)  # fmt: skip
def test_bad_scenario_is_one_sentence(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=words):
        load_scenario(path)
