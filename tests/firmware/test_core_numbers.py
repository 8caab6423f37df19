"""The numbers that a target is given: which there are, and what it does not take."""

from __future__ import annotations

import math

import pytest

from flightstack.control.controller import laws_with
from flightstack.control.controller_loading import load_controller
from flightstack.core.errors import ConfigError
from flightstack.firmware.numbers import (
    TARGET_NUMBERS,
    declared,
    default_numbers,
    target_numbers,
)
from flightstack.params.gains_file import open_gains
from flightstack.params.tunable import Tunable
from flightstack.params.vehicle import load_vehicle
from tests.support.plugin_site import example_module
from tests.support.rotor_sets import multirotor, ring

NAMES = {number.name for number in TARGET_NUMBERS}


@pytest.mark.parametrize("controller", ["pid", "backstepping"])
def test_a_flight_gives_every_number_but_the_other_laws_gains(controller: str) -> None:
    values = target_numbers(
        load_vehicle("x_quad"), load_controller(controller), open_gains("paper"), math.radians(30.0), 250.0, 5
    )
    other = "BS_" if controller == "pid" else "PID_"
    assert NAMES - values.keys() == {name for name in NAMES if name.startswith(other)}
    assert values.keys() <= NAMES
    assert values["FS_CTRL"] == ["pid", "backstepping"].index(controller)
    assert (values["FS_INNER_HZ"], values["FS_OUTER_DIV"]) == (250.0, 5.0)
    assert values["MPC_TILTMAX_AIR"] == pytest.approx(30.0, rel=1e-15)


def test_the_rotors_that_a_vehicle_has_not_are_zero() -> None:
    values = target_numbers(ring(6), load_controller("pid"), open_gains("tuned"), 0.6, 500.0, 5)
    assert values["FS_ROTORS"] == 6.0
    assert values["FS_HIGH_5"] > 0.0
    assert not any(values[f"FS_{name}"] for name in ("HIGH_6", "LOW_7", "SPIN_6", "ALLOC_60", "EFF_07"))


def test_the_defaults_are_of_every_law() -> None:
    assert default_numbers().keys() == NAMES


def test_user_controller_gives_every_field_of_its_parameters() -> None:
    controller = example_module().CONTROLLER
    values = target_numbers(ring(4), controller, open_gains("tuned"), 0.6, 500.0, 5)
    numbers = {number.name: number.place for number in declared(laws_with(controller))}
    assert values["FS_CTRL"] == 2.0
    for field in controller.params_type._fields:
        (name,) = (name for name, place in numbers.items() if place == f"controller.lqr.{field}")
        assert name in values


def test_undeclared_field_of_a_user_controller_has_a_number() -> None:
    tunable = Tunable("rate_roll", "LQR_ROLL_RATE", 0.0, 1e3, "1/s", "gain")
    controller = example_module().CONTROLLER._replace(tunables=(tunable,))
    values = target_numbers(ring(4), controller, open_gains("tuned"), 0.6, 500.0, 5)
    assert values["LQR_ROLL_RATE"] > 0.0
    assert [values[f"FS_LAW_{index}"] for index in (6, 7, 8)] == list(ring(4).inertia_kg_m2)


def test_a_number_beyond_the_target_is_refused_with_its_range() -> None:
    places = [(0.2, 0.2), (-0.2, 0.2), (-0.2, -0.2), (0.2, -0.2)]
    heavy = multirotor(places, [1, -1, 1, -1], mass_kg=2000.0)
    with pytest.raises(ConfigError, match=r"FS_MASS=2000.*0\.001 to 1000"):
        target_numbers(heavy, load_controller("pid"), open_gains("tuned"), 0.6, 500.0, 5)
