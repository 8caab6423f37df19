"""The table [sensors] of a vehicle file: grades, numbers, and one sentence for each error."""

from __future__ import annotations

from pathlib import Path

import pytest

from flightstack.core.errors import ConfigError
from flightstack.params.sensors import GRADES, OPTIONAL, TABLES, default_sensors
from flightstack.params.vehicle import BUILT_IN, Vehicle, built_in_vehicles, load_vehicle
from sim_bridge.sensors.layout import SENSORS

X_QUAD = (BUILT_IN / "x_quad.toml").read_text(encoding="utf-8")
REQUIRED = {name for name in TABLES if name not in OPTIONAL}


def load_text(folder: Path, sensors: str) -> Vehicle:
    path = folder / "my.toml"
    head, body = X_QUAD.replace('[sensors]\ngrade = "consumer"\n', "").split("[body]")
    path.write_text(f"{head}{sensors}\n[body]{body}", encoding="utf-8")
    return load_vehicle(str(path))


def test_built_in_vehicles_have_sensors_of_the_consumer_grade() -> None:
    for name in built_in_vehicles():
        sensors = load_vehicle(name).sensors
        assert sensors.grade == "consumer"
        assert set(sensors.numbers) == REQUIRED


def test_each_number_of_a_sensor_has_its_source() -> None:
    """A data sheet, the source of another autopilot or simulator, or "class value"."""
    choices = ("count", "position_frd_m")
    items = [item for table in TABLES.values() for item in table if item.key not in choices]
    assert [item.key for item in items if not item.source] == []


def test_grades_differ_in_their_numbers(tmp_path: Path) -> None:
    consumer, ideal, none = (load_text(tmp_path, f'[sensors]\ngrade = "{grade}"').sensors for grade in GRADES)
    assert consumer == default_sensors()
    assert ideal.numbers["imu"]["gyro_noise_deg_s_sqrt_hz"] == 0.0
    assert ideal.numbers["gnss"]["latency_s"] == 0.0
    assert (none.numbers, none.imu_count) == ({}, 0)


def test_numbers_of_the_file_replace_those_of_the_grade(tmp_path: Path) -> None:
    text = '[sensors]\ngrade = "ideal"\nmag = false\nflow = true\n[sensors.imu]\ncount = 2\n[sensors.range]\nmax_m = 8'
    sensors = load_text(tmp_path, text).sensors
    assert set(sensors.numbers) == REQUIRED - {"mag"} | {"range", "flow"}
    assert sensors.imu_count == 2
    assert sensors.numbers["range"]["max_m"] == 8.0
    assert sensors.numbers["range"]["noise_m"] == 0.0


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ('[sensors]\ngrade = "best"', "sensors.grade: 'best' is not one of consumer, ideal, none"),
        ("[sensors.gnss]\nrate_hz = 100", "sensors.gnss.rate_hz: 100 is outside the allowed range 0.5 to 50"),
        ("[sensors.imu]\ncount = 4", "sensors.imu.count: 4 is outside the allowed range 1 to 3"),
        ("[sensors.imu]\ncount = 1.5", "sensors.imu.count: 1.5 is not a whole number"),
        ("[sensors.imu]\nposition_frd_m = [0, 0]", "sensors.imu.position_frd_m: must be a list of 3 numbers"),
        (
            "[sensors.mag]\nnoise = 0.1",
            "sensors.mag.noise: is not a known key; known are current_gauss_a, hard_iron_gauss, noise_gauss, "
            "range_gauss, rate_hz, resolution_gauss, soft_iron",
        ),
        ("[sensors.sonar]\nrate_hz = 5", "sensors.sonar: is not a known key"),
        ('[sensors]\ngrade = "none"\nmag = true', "sensors.mag: is not a known key; known are grade"),
        ("[sensors.range]\nmin_m = 5\nmax_m = 4", "sensors.range.min_m: 5 is not below max_m, 4"),
        (
            "[sensors]\nimu = false",
            'sensors.imu: cannot be false: a vehicle without sensors has grade = "none"',
        ),
        ("[sensors]\nbaro = 3", "sensors.baro: must be a table"),
        ("sensors = 3", "sensors: must be a table"),
    ],
)
def test_bad_sensor_table_names_key_value_and_range(tmp_path: Path, text: str, problem: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_text(tmp_path, text)
    assert str(caught.value) == f"{tmp_path / 'my.toml'}: {problem}"


def test_every_number_has_a_default_in_its_range_and_a_field() -> None:
    for name, items in TABLES.items():
        for item in items:
            for default in (item.consumer, item.ideal):
                values = default if isinstance(default, tuple) else (default,)
                assert all(item.low <= value <= item.high for value in values), (name, item.key)
            assert item.key.replace("_deg", "_rad") in SENSORS[name].names
