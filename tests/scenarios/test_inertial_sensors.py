"""Flights with several inertial sensors, of which some fail."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from pyulog import ULog

from flightstack.core.contract import FloatArray
from flightstack.core.errors import ConfigError
from flightstack.mavlink.dialect import mavlink
from flightstack.testing import RefusedError, World
from tests.support.estimate_errors import Errors, Watch
from tests.support.inertial_sensors import x_quad_with_imus
from tests.support.tools import NIGHTLY

HEIGHT_M = 4.0


@pytest.fixture(name="vehicle", scope="module")
def two_imus(tmp_path_factory: pytest.TempPathFactory) -> str:
    return x_quad_with_imus(tmp_path_factory.mktemp("vehicles"))


def selected(world: World) -> int:
    """Return the number of the inertial sensor that the vehicle flies on, from 1."""
    lanes = world.engine.stack.estimation.sensed().lanes
    assert lanes is not None
    return lanes.selection.selected + 1


def climb(world: World) -> None:
    world.takeoff(HEIGHT_M)
    world.run_until("altitude_m > 1.5")


def hover(world: World) -> None:
    climb(world)
    world.run_until("mode == 'HOLD'")


def fly_mission(world: World) -> None:
    world.upload("square")
    world.arm()
    world.start_mission()
    world.run_until("altitude_m > 2.0")
    world.run_for(4.0)


def come_back(world: World) -> None:
    fly_mission(world)
    world.rtl()
    world.run_for(2.0)


def go(world: World) -> None:
    hover(world)
    world.goto(10.0, 5.0)
    world.run_for(1.5)


def fly_squares(world: World) -> None:
    hover(world)
    for corner in ((6.0, 0.0), (6.0, 6.0), (0.0, 6.0), (0.0, 0.0)) * 2:
        world.goto(*corner)
        world.run_for(7.5)


def land(world: World) -> None:
    hover(world)
    world.land()
    world.run_for(1.5)


PHASES = {each.__name__: each for each in (climb, hover, go, fly_mission, come_back, land)}
SOME_PHASES = PHASES if NIGHTLY else ("climb", "fly_mission", "land")


def motion(vehicle: str, phase: str, fault: str | None) -> tuple[FloatArray, list[str]]:
    """Return the true states (50, 13) of the half second after a fault in a phase of flight, and all texts."""
    with World(vehicle=vehicle, state="estimated", seed=3) as world:
        world.wait_until_ready()
        PHASES[phase](world)
        if fault is not None:
            world.fault(f"sensor:imu1:{fault}")
        states = []
        for _ in range(50):
            world.step()
            states.append(world.engine.simulator.frame.state.copy())
        if fault is not None:
            assert selected(world) == 2
            if world.state.mode != "LAND":
                world.land()
            world.run_until("not armed", 60.0)
    return np.array(states), world.texts


@pytest.mark.parametrize("phase", SOME_PHASES)
def test_vehicle_flies_on_without_a_jump_when_an_inertial_sensor_fails(vehicle: str, phase: str) -> None:
    healthy, _ = motion(vehicle, phase, None)
    for fault, reason in (("off", "missing"), ("freeze", "stuck")):
        states, texts = motion(vehicle, phase, fault)
        off = np.abs(states - healthy)
        print(f"{fault}: {off[:, 3:6].max():.3f} m/s, {np.degrees(2.0 * off[:, 7:9].max()):.2f} degrees")
        assert off[:, 3:6].max() < 0.2  # measured at most 0.091
        assert np.degrees(2.0 * off[:, 7:9].max()) < 1.5  # tilt; measured at most 0.67
        assert f"Inertial sensor 1 is {reason}: flying on 2" in texts
        assert texts[-1] == "Disarmed"


SQUARE_LIMITS = Errors(1.0, 2.0, 0.15, 0.7, 0.4, 1.5)
"""Those of a flight without a fault, but for 0.5° of tilt; measured at most 0.70°, 0.81°, 0.04 m/s, 0.19 m, 0.18 m."""


FAULTS = [
    ("imu1:off", "missing"),
    ("gyro1:bias=3,0,0", "disagrees with inertial sensor 2"),
    ("gyro1:noise=100", "disagrees with inertial sensor 2"),
    ("accel1:bias=0.5,0,0", "disagrees with inertial sensor 2"),
]
MORE_FAULTS = [
    ("imu1:freeze", "stuck"),
    ("gyro1:bias=10,10,10", "disagrees with inertial sensor 2"),
]


@pytest.mark.parametrize(("fault", "reason"), FAULTS + NIGHTLY * MORE_FAULTS)
def test_square_is_completed_with_a_faulty_inertial_sensor(vehicle: str, fault: str, reason: str) -> None:
    with World(vehicle=vehicle, state="estimated") as world:
        watch = Watch(world)
        world.after(15.0, lambda: world.fault(f"sensor:{fault}"))
        flight = world.fly("square")
        assert selected(world) == 2
    assert flight.completed, flight.outcome
    assert any(f"Inertial sensor 1 {reason}" in text or f"is {reason}" in text for text in world.texts)
    errors = watch.errors()
    print([round(value, 2) for value in errors])
    assert all(error < limit for error, limit in zip(errors, SQUARE_LIMITS, strict=True))


@pytest.mark.parametrize("fault", ["gyro2:bias=10,10,10", "accel2:bias=0.5,0,0", "imu2:off", "imu2:freeze"])
def test_vehicle_does_not_change_to_a_faulty_inertial_sensor(vehicle: str, fault: str) -> None:
    with World(vehicle=vehicle, state="estimated", seed=2) as world:
        world.wait_until_ready()
        hover(world)
        world.fault(f"sensor:{fault}")
        world.run_for(12.0)
        assert selected(world) == 1
        assert ("A spare inertial sensor has failed" in world.texts) is ("imu2" in fault)


def test_three_inertial_sensors_outvote_one(tmp_path: Path) -> None:
    with World(vehicle=x_quad_with_imus(tmp_path, 3), state="estimated") as world:
        world.wait_until_ready()
        hover(world)
        world.fault("sensor:gyro1:bias=0,10,0")
        world.run_for(0.4)
        assert selected(world) != 1
        assert "Inertial sensor 1 disagrees with the others: flying on" in world.texts[-2]
        world.fault("sensor:imu2:off")
        world.fault("sensor:imu1:off")
        world.run_for(0.2)
        assert selected(world) == 3
        world.land()
        world.run_until("not armed", 30.0)
        assert world.texts[-1] == "Disarmed"


@pytest.mark.parametrize("second_s", [0.0, 3.0])
def test_loss_of_all_inertial_sensors_is_the_failsafe_of_one(vehicle: str, second_s: float) -> None:
    with World(vehicle=vehicle, state="estimated") as world:
        world.wait_until_ready()
        hover(world)
        world.fault("sensor:imu1:off")
        world.run_for(second_s)
        world.fault("sensor:imu2:off")
        world.run_for(0.2)
        assert any("Inertial sensor is missing or stuck: rotors hold" in text for text in world.texts)
        world.run_until("not armed", 20.0)


def test_failure_of_one_instance_is_injected_and_prevents_arming(vehicle: str) -> None:
    with World(vehicle=vehicle, state="estimated", params={"SYS_FAILURE_EN": 1}) as world:
        world.wait_until_ready()
        gyro, off, ok = mavlink.FAILURE_UNIT_SENSOR_GYRO, mavlink.FAILURE_TYPE_OFF, mavlink.FAILURE_TYPE_OK
        world.command(mavlink.MAV_CMD_INJECT_FAILURE, gyro, off, 2)
        world.run_for(0.5)
        with pytest.raises(RefusedError, match="an inertial sensor has failed"):
            world.arm()
        world.command(mavlink.MAV_CMD_INJECT_FAILURE, gyro, ok, 2)
        world.run_for(2.0)
        world.arm()


def test_parameter_limits_the_number_of_estimators(vehicle: str) -> None:
    with World(vehicle=vehicle, state="estimated", params={"EKF2_MULTI_IMU": 1}) as world:
        world.wait_until_ready()
        hover(world)
        assert world.engine.stack.estimation.sensed().lanes is None
        world.fault("sensor:imu1:off")
        world.run_for(0.2)
        assert any("rotors hold" in text for text in world.texts)


def test_change_of_the_inertial_sensor_is_logged_as_a_reset(vehicle: str) -> None:
    with World(vehicle=vehicle, state="estimated") as world:
        world.wait_until_ready()
        hover(world)
        world.run_for(2.0)
        world.fault("sensor:imu1:off")
        world.run_for(2.0)
        log = ULog(io.BytesIO(world.engine.newest_log()))
    selector = log.get_dataset("estimator_selector_status").data
    assert (selector["primary_instance"][0], selector["primary_instance"][-1]) == (0, 1)
    assert (selector["gyro_device_id"][0], selector["gyro_device_id"][-1]) == (1, 2)
    assert selector["instances_available"].tolist() == [2] * len(selector["timestamp"])
    assert selector["instance_changed_count"][-1] == 1
    assert (selector["healthy[0]"][0], selector["healthy[0]"][-1], selector["healthy[1]"][-1]) == (1, 0, 1)
    position = log.get_dataset("vehicle_local_position").data
    for name in ("xy_reset_counter", "z_reset_counter", "vxy_reset_counter", "heading_reset_counter"):
        assert position[name][-1] - position[name][0] == 1, name


def test_estimator_in_c_refuses_several_inertial_sensors(vehicle: str) -> None:
    """It follows one: a fault of that one would end the flight without a word."""
    with pytest.raises(ConfigError, match="follows one inertial sensor, and the vehicle has 2"):
        World(vehicle=vehicle, loops="c")
    with World(vehicle=vehicle, loops="c", params={"EKF2_MULTI_IMU": 1}) as world:
        hover(world)
        assert world.state.altitude_m > 3.0


@pytest.mark.parametrize("seed", [6, 9])
def test_healthy_sensors_are_not_exchanged(vehicle: str, seed: int) -> None:
    """Means of ratios with their signs, with a noise of their own in each filter, differed enough here."""
    with World(vehicle=vehicle, state="estimated", seed=seed) as world:
        world.wait_until_ready()
        fly_squares(world)
        assert selected(world) == 1
        assert not any("nertial sensor" in text for text in world.texts)
