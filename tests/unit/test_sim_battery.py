"""The simulator's battery: its equations against a closed form and solve_ivp, its file, its message."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from flightstack.core.errors import ConfigError
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from flightstack.params.battery import LIPO_CELL_V, Battery
from flightstack.params.vehicle import BUILT_IN, Vehicle, load_vehicle
from flightstack.simulator_link.battery_frame import encode_battery
from flightstack.simulator_link.hot_frames import ARMED_FLAG, ActuatorsFrame
from sim_bridge.plant.battery import BatteryOptions, BatteryState, battery_report
from sim_bridge.plant.plant import PlantOptions
from sim_bridge.simulator import Simulator

PAPER = load_vehicle("paper_quad")
HOVER = math.sqrt(PAPER.weight_n / 4.0 / PAPER.rotors[0].thrust_coefficient_n_s2)
ARMED, DISARMED = ARMED_FLAG, 0


def command(speed: float, flags: int = ARMED) -> ActuatorsFrame:
    frame = ActuatorsFrame()
    frame.rotor_speed_rad_s[:4] = speed
    frame.set_rotor_count(4)
    frame.seal(0, flags)
    return frame


def with_battery(battery: Battery | None) -> Vehicle:
    """The paper's vehicle without rotor lag: a constant command is a constant load."""
    return replace(PAPER, battery=battery).with_ideal_rotors()


def after(vehicle: Vehicle, seconds: float, speed: float = HOVER, **options: float) -> BatteryState:
    simulator = Simulator(
        vehicle,
        "rigid",
        PlantOptions(battery=BatteryOptions(**options)),
        interval_us=100_000,  # type: ignore[arg-type]
    )
    for _ in range(round(seconds * 10.0)):
        simulator.apply(command(speed))
    state = simulator.plant.battery
    assert state is not None
    return state


def shaft_power_w(speed: float) -> float:
    return sum(rotor.torque_coefficient_n_m_s2 * speed**3 for rotor in PAPER.rotors)


def test_without_resistance_and_slope_the_discharge_is_a_closed_form() -> None:
    """Constant voltage, constant power: the charge falls as P·t/(U·Q)."""
    battery = Battery(3, 1000.0, 0.0, (4.0, 4.0), efficiency=0.8, avionics_w=6.0)
    power = shaft_power_w(HOVER) / 0.8 + 6.0
    state = after(with_battery(battery), 60.0)
    assert state.voltage_v == pytest.approx(12.0, rel=1e-12)
    assert state.current_a == pytest.approx(power / 12.0, rel=1e-12)
    assert state.remaining == pytest.approx(1.0 - power / 12.0 * 60.0 / 3600.0, rel=1e-9)
    assert state.consumed_mah == pytest.approx(power / 12.0 * 60.0 / 3.6, rel=1e-9)
    assert state.energy_j == pytest.approx(power * 60.0, rel=1e-9)


def test_constant_load_follows_the_differential_equation() -> None:
    """dq/dt = −I(q)/Q with (E(q) − R·I)·I = P; measured difference 2e-6 (the step is explicit), limit 1e-5."""
    battery = Battery(3, 300.0, 0.15, LIPO_CELL_V, efficiency=0.7, avionics_w=4.0)
    power, points = shaft_power_w(HOVER) / 0.7 + 4.0, np.linspace(0.0, 1.0, len(LIPO_CELL_V))

    def current(charge: float) -> float:
        volt = 3.0 * float(np.interp(charge, points, LIPO_CELL_V))
        roots = np.roots([battery.resistance_ohm, -volt, power])
        return float(roots.real.min())

    def slope(_: float, q: np.ndarray) -> list[float]:
        return [-current(q[0]) / (300.0 * 3.6)]

    reference = solve_ivp(slope, (0.0, 150.0), [0.9], rtol=1e-10, atol=1e-12, max_step=0.5)
    state = after(with_battery(battery), 150.0, start=0.9)
    expected = float(reference.y[0, -1])
    assert 0.2 < expected < 0.6
    assert state.remaining == pytest.approx(expected, abs=1e-5)
    assert state.current_a == pytest.approx(current(expected), rel=1e-4)
    assert state.voltage_v * state.current_a == pytest.approx(power, rel=1e-9)


def test_overload_is_limited_to_the_largest_power() -> None:
    battery = Battery(3, 1000.0, 2.0, (4.0, 4.0))
    state = after(with_battery(battery), 0.1)
    assert state.current_a == pytest.approx(12.0 / 4.0)
    assert state.voltage_v == pytest.approx(6.0)


@pytest.mark.parametrize("interval_us", [1000, 2000, 100_000])
def test_discharge_does_not_depend_on_how_the_steps_are_batched(interval_us: int) -> None:
    simulator = Simulator(PAPER, interval_us=interval_us)
    for _ in range(2_000_000 // interval_us):
        simulator.apply(command(230.0))
    ends = simulator.plant.battery
    reference = Simulator(PAPER, interval_us=10_000)
    for _ in range(200):
        reference.apply(command(230.0))
    assert ends == reference.plant.battery


def test_drain_and_capacity_shorten_the_flight_and_leave_the_current() -> None:
    vehicle = with_battery(Battery(3, 1000.0, 0.0, (4.0, 4.0)))
    plain, drained, small = (
        after(vehicle, 10.0), after(vehicle, 10.0, drain=5.0), after(vehicle, 10.0, capacity_mah=200.0)
    )  # fmt: skip
    assert plain.current_a == drained.current_a == small.current_a
    assert 1.0 - drained.remaining == pytest.approx(5.0 * (1.0 - plain.remaining), rel=1e-9)
    assert drained.remaining == pytest.approx(small.remaining, abs=1e-12)
    assert drained.consumed_mah == plain.consumed_mah


def test_an_empty_battery_stops_the_rotors() -> None:
    simulator = Simulator(PAPER, options=PlantOptions(battery=BatteryOptions(0.001, drain=10.0)))
    seen = []
    for _ in range(2500):
        simulator.apply(command(200.0))
        state = simulator.plant.battery
        assert state is not None
        seen.append((state.remaining, float(simulator.frame.rotor_speed_rad_s[0])))
    first_empty = next(i for i, (charge, _) in enumerate(seen) if charge == 0.0)
    assert 0 < first_empty < 2000
    assert seen[first_empty][1] == pytest.approx(200.0)
    assert seen[-1][1] < 1e-6
    assert state.current_a == 0.0


def test_the_flight_is_the_same_with_and_without_a_battery() -> None:
    ends = []
    for battery in (BatteryOptions(), None):
        simulator = Simulator(PAPER, options=PlantOptions(battery=battery))
        for _ in range(300):
            simulator.apply(command(230.0))
        ends.append(simulator.frame.state.tobytes())
    assert ends[0] == ends[1]


def decoded(data: bytes | memoryview) -> list:
    return list(Link(1, 1).decode(bytes(data)))


def test_the_message_comes_twice_a_second_just_before_its_state() -> None:
    simulator = Simulator(PAPER, interval_us=4000)
    times = []
    for _ in range(501):
        messages = decoded(simulator.outgoing())
        assert messages[-1].get_type() == "FS_PLANT_STATE"
        if len(messages) > 1:
            assert [m.get_type() for m in messages] == ["BATTERY_STATUS", "FS_PLANT_STATE"]
            times.append(messages[-1].time_us)
        simulator.apply(command(0.0, DISARMED))
    assert times == list(range(0, 2_000_001, 500_000))


@pytest.mark.parametrize("cells", [1, 3, 10, 12, 14])
def test_the_message_has_standard_units_and_cells(cells: int) -> None:
    report = battery_report(BatteryState(3.7 * cells, 12.345, 0.426, 321.4, 9876.0), cells)
    (m,) = decoded(encode_battery(report, 0, 1, 200))
    voltages = [v for v in m.voltages if v != 0xFFFF] + [v for v in m.voltages_ext if v]
    assert voltages == [3700] * cells
    assert (m.current_battery, m.battery_remaining, m.current_consumed, m.energy_consumed) == (
        1234,
        43,
        321,
        99,
    )
    assert (m.id, m.type) == (0, mavlink.MAV_BATTERY_TYPE_LIPO)


def test_a_vehicle_without_a_battery_sends_none() -> None:
    simulator = Simulator(replace(PAPER, battery=None))
    assert simulator.plant.battery is None
    assert [m.get_type() for m in decoded(simulator.outgoing())] == ["FS_PLANT_STATE"]


def test_built_in_batteries_hover_for_a_usual_time() -> None:
    """Twenty to forty minutes, computed from the energy of the model."""
    for name in ("paper_quad", "x_quad"):
        vehicle = load_vehicle(name)
        assert vehicle.battery is not None
        rotor = vehicle.rotors[0]
        speed = math.sqrt(vehicle.weight_n / len(vehicle.rotors) / rotor.thrust_coefficient_n_s2)
        power = len(vehicle.rotors) * rotor.torque_coefficient_n_m_s2 * speed**3 / vehicle.battery.efficiency
        energy = vehicle.battery.capacity_mah * 3.6 * vehicle.battery.cells * float(np.mean(LIPO_CELL_V))
        assert 20.0 < energy / (power + vehicle.battery.avionics_w) / 60.0 < 40.0


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ("cells = 3", "capacity_mah"),
        ("cells = 2.5\ncapacity_mah = 1000.0", "not a whole number"),
        ("cells = 15\ncapacity_mah = 1000.0", "1 to 14"),
        ("cells = 3\ncapacity_mah = 1000.0\ncell_voltage_v = [4.2, 3.3]", "must not decrease"),
        ("cells = 3\ncapacity_mah = 1000.0\ncell_voltage_v = [4.2]", "2 to 32 numbers"),
        ("cells = 3\ncapacity_mah = 1000.0\nefficiency = 0.0", "0.05 to 1"),
        ("cells = 3\ncapacity_mah = 1000.0\nvolts = 12.0", "not a known key"),
    ],
)
def test_a_bad_battery_in_the_file_is_named(tmp_path: Path, lines: str, said: str) -> None:
    text = (BUILT_IN / "paper_quad.toml").read_text(encoding="utf-8")
    begin = text.index("[battery]")
    end = text.index("# Seen from above")
    path = tmp_path / "vehicle.toml"
    path.write_text(f"{text[:begin]}[battery]\n{lines}\n\n{text[end:]}", encoding="utf-8")
    with pytest.raises(ConfigError, match=said):
        load_vehicle(str(path))
