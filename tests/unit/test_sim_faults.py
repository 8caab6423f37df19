"""Faults of the simulator: effect and schedule, and those that cannot act."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from flightstack.core.contract import Vector3
from flightstack.mavlink.link import Link
from sim_bridge.errors import UsageProblemError
from sim_bridge.plant.disturbance import Disturbance
from sim_bridge.plant.faults.schedule import Kind, parse_fault
from sim_bridge.plant.plant import PlantOptions
from sim_bridge.simulator import Simulator
from tests.support.faulty_simulator import LAG_SPEED, PAPER, command, flown, fly, speeds

# ---------------------------------------------------------------------- rotors


def test_a_rotor_without_power_runs_down_with_its_lag() -> None:
    simulator = flown("rotor:2:off@0.2", seconds=0.2)
    assert speeds(simulator) == pytest.approx([LAG_SPEED] * 4, rel=1e-6)
    fly(simulator, 0.01)
    expected = LAG_SPEED * math.exp(-0.01 / PAPER.rotors[0].lag_s)
    assert speeds(simulator)[1] == pytest.approx(expected, rel=1e-6)
    assert speeds(simulator)[0] == pytest.approx(LAG_SPEED, rel=1e-6)


def test_rotor_recovers_at_the_end_of_a_fault() -> None:
    simulator = flown("rotor:2:off@0.1-0.2", seconds=0.2)
    assert speeds(simulator)[1] < 1e-3
    assert simulator.faults == ()
    fly(simulator, 0.2)
    assert speeds(simulator)[1] == pytest.approx(LAG_SPEED, rel=1e-6)


def test_a_weak_rotor_gives_its_share_of_the_thrust() -> None:
    """The vertical acceleration is that of 3.7 rotors: exactly, with the body still level."""
    simulator = Simulator(PAPER)
    fly(simulator, 0.3, 230.0)
    whole = simulator.plant.acceleration_ned_m_s2().z
    simulator.inject(parse_fault("rotor:3:weak=0.7", 4))
    weak = simulator.plant.acceleration_ned_m_s2().z
    assert (9.81 - weak) / (9.81 - whole) == pytest.approx(3.7 / 4.0, rel=1e-6)
    assert speeds(simulator)[2] == pytest.approx(230.0, rel=1e-6)


def test_a_stuck_rotor_turns_at_its_speed_while_armed() -> None:
    simulator = flown("rotor:1:stuck=150")
    assert speeds(simulator)[0] == pytest.approx(150.0, rel=1e-6)
    fly(simulator, 0.2, math.nan)
    assert speeds(simulator)[0] == pytest.approx(150.0, rel=1e-6)
    fly(simulator, 0.2, flags=0)
    assert max(speeds(simulator)) < 1e-3


def test_last_of_two_faults_of_a_rotor_wins() -> None:
    simulator = flown("rotor:1:stuck=150", "rotor:1:off@0.2-0.3", seconds=0.28)
    assert speeds(simulator)[0] < 1.0
    fly(simulator, 0.2)
    assert speeds(simulator)[0] == pytest.approx(150.0, rel=1e-6)
    simulator.clear_faults()
    fly(simulator, 0.2)
    assert speeds(simulator)[0] == pytest.approx(LAG_SPEED, rel=1e-6)


@pytest.mark.parametrize("delay", [0.05, 0.0133])
def test_delayed_rotor_follows_its_command_after_the_dead_time(delay: float) -> None:
    """A step of the command: the first-order lag begins after the dead time, in whole steps of 1 ms."""
    simulator = flown(seconds=0.3)
    simulator.inject(parse_fault(f"rotor 2 delayed {delay}", 4))
    steps = math.ceil(delay * 1e3)
    for tick in range(1, 50):
        simulator.apply(command(250.0))
        since_s = max(0.0, 2e-3 * tick - steps * 1e-3)
        late = 250.0 + (LAG_SPEED - 250.0) * math.exp(-since_s / PAPER.rotors[0].lag_s)
        prompt = 250.0 + (LAG_SPEED - 250.0) * math.exp(-2e-3 * tick / PAPER.rotors[0].lag_s)
        assert speeds(simulator)[:2] == pytest.approx([prompt, late], rel=1e-6)


def test_delayed_rotor_obeys_at_once_after_the_fault_and_when_disarmed() -> None:
    simulator = flown("rotor 2 delayed 0.5 @0.1-0.2", seconds=0.1)
    fly(simulator, 0.1, 250.0)
    assert speeds(simulator)[1] == pytest.approx(LAG_SPEED, rel=1e-6)
    fly(simulator, 0.1, 250.0)
    assert speeds(simulator)[1] == pytest.approx(250.0, rel=1e-6)
    simulator.inject(parse_fault("rotor 2 delayed 0.5", 4))
    fly(simulator, 0.2, flags=0)
    assert max(speeds(simulator)) < 1e-3


def test_invalid_delayed_command_is_replaced_by_the_last_good_one() -> None:
    simulator = flown("rotor 2 delayed 0.05", seconds=0.3)
    simulator.apply(command(math.nan))
    before = simulator.plant.bad_commands
    fly(simulator, 0.1)
    assert speeds(simulator)[1] == pytest.approx(LAG_SPEED, rel=1e-6)
    assert simulator.plant.bad_commands == before + 2  # the late one, in both steps of its exchange


# ---------------------------------------------------------------------- state


def states(simulator: Simulator, count: int, speed: float = 260.0) -> list:
    found = []
    for _ in range(count):
        found.extend(
            m for m in Link(1, 1).decode(bytes(simulator.outgoing())) if m.get_type() == "FS_PLANT_STATE"
        )
        simulator.apply(command(speed))
    return found


def test_frozen_state_has_new_timestamps() -> None:
    simulator, twin = flown("state:freeze@0.5-0.6", seconds=0.48), flown(seconds=0.48)
    seen, truth = states(simulator, 100), states(twin, 100)
    assert [m.time_us for m in seen] == [m.time_us for m in truth]
    same = [m.position_ned_m == t.position_ned_m for m, t in zip(seen, truth, strict=True)]
    assert same == [True] * 11 + [False] * 49 + [True] * 40  # the first frozen state is the true one
    assert len({tuple(m.position_ned_m) for m in seen[10:60]}) == 1
    assert simulator.frame.state.tobytes() == twin.frame.state.tobytes()


def test_nan_fault_sends_nan_states() -> None:
    simulator = flown("state:nan@0.5-0.6", seconds=0.48)
    numbers = [
        [*m.position_ned_m, *m.velocity_ned_m_s, *m.q, *m.rates_frd_rad_s] for m in states(simulator, 100)
    ]
    finite = [bool(np.isfinite(row).any()) for row in numbers]
    assert finite == [True] * 10 + [False] * 50 + [True] * 40
    assert np.isfinite(simulator.frame.state).all()


def test_a_dropped_state_is_not_sent_and_the_battery_is() -> None:
    simulator = flown("state:drop@0.5-0.6", seconds=0.48)
    kinds = []
    for _ in range(100):
        kinds += [m.get_type() for m in Link(1, 1).decode(bytes(simulator.outgoing()))]
        simulator.apply(command(260.0))
    assert kinds.count("FS_PLANT_STATE") == 50
    assert kinds.count("BATTERY_STATUS") == 2  # the first one was due, then at 0.5 s


def test_the_battery_is_set_at_its_time_and_drains_from_there() -> None:
    simulator = flown("battery:level=0.1@0.25", seconds=0.248)
    before = simulator.plant.battery
    fly(simulator, 0.002)
    at = simulator.plant.battery
    fly(simulator, 0.5)
    end = simulator.plant.battery
    assert before is not None
    assert at is not None
    assert end is not None
    assert before.remaining > 0.99
    assert at.remaining == 0.1
    assert end.remaining == pytest.approx(0.1 - end.current_a * 0.5 / (2.2 * 3600.0), abs=1e-6)
    assert simulator.faults == ()


def test_faults_are_the_same_in_every_run() -> None:
    specs = (
        "rotor:2:weak=0.7@0.1-0.3",
        "state:freeze@0.2-0.25",
        "battery:level=0.5@0.3",
        "state:nan@0.3-0.31",
    )
    runs = []
    for _ in range(2):
        simulator = flown(*specs, seconds=0.0)
        data = b""
        for _ in range(250):
            data += bytes(simulator.outgoing())
            simulator.apply(command(225.0))
        runs.append(data)
    assert runs[0] == runs[1]


def test_late_state_is_the_earlier_one_with_a_new_time() -> None:
    simulator, twin = flown("state late 0.05 @0.5-0.7", seconds=0.48), flown(seconds=0.48)
    seen, truth = states(simulator, 150), states(twin, 150)
    assert [m.time_us for m in seen] == [m.time_us for m in truth]
    for index, (late, true) in enumerate(zip(seen, truth, strict=True)):
        held = max(10, index - 25) if 10 <= index < 110 else index
        assert late.position_ned_m == truth[held].position_ned_m
        assert late.rotor_speed_rad_s == truth[held].rotor_speed_rad_s
        assert true.position_ned_m != truth[index - 1].position_ned_m


def test_stalled_clock_repeats_its_time_and_resumes_from_it() -> None:
    simulator, twin = flown("clock stalled @0.5-0.6", seconds=0.48), flown(seconds=0.48)
    seen, truth = states(simulator, 100), states(twin, 100)
    times = [m.time_us for m in seen]
    assert times[:10] == [m.time_us for m in truth[:10]]
    assert times[10:61] == [500_000] * 51  # the clock runs again from the exchange at 0.6 s
    assert times[60:] == list(range(500_000, 580_000, 2000))
    assert [m.position_ned_m for m in seen] == [m.position_ned_m for m in truth]


def test_clock_jumps_once_and_not_below_zero() -> None:
    simulator = flown("clock jump 0.5 @0.5", "clock jump -0.2 @0.51", "clock jump -99 @0.52", seconds=0.48)
    times = [m.time_us for m in states(simulator, 25)]
    assert times[:10] == list(range(480_000, 500_000, 2000))
    assert times[10:15] == list(range(1_000_000, 1_010_000, 2000))
    assert times[15:20] == list(range(810_000, 820_000, 2000))
    assert times[20:] == list(range(0, 10_000, 2000))
    assert simulator.faults == ()


def test_weak_pack_sags_by_its_extra_resistance() -> None:
    """The closed form of the load line P = (E − R·I)·I, before, during and after."""
    battery, simulator = PAPER.battery, flown("battery sag 0.2 @0.3-0.4", seconds=0.3)
    assert battery is not None
    for seconds, extra in ((0.002, 0.2), (0.098, 0.2), (0.1, 0.0)):
        fly(simulator, seconds)
        state = simulator.plant.battery
        assert state is not None
        power = sum(r.torque_coefficient_n_m_s2 * LAG_SPEED**3 for r in PAPER.rotors) / battery.efficiency
        power += battery.avionics_w
        place = state.remaining * (len(battery.cell_voltage_v) - 1)
        volt = battery.cells * float(
            np.interp(place, range(len(battery.cell_voltage_v)), battery.cell_voltage_v)
        )
        resistance = battery.resistance_ohm + extra
        current = (volt - math.sqrt(volt * volt - 4.0 * resistance * power)) / (2.0 * resistance)
        assert state.current_a == pytest.approx(current, rel=1e-5)  # measured: 3e-7
        assert state.voltage_v == pytest.approx(volt - resistance * current, rel=1e-5)


def test_dead_cell_takes_its_voltage_from_the_pack() -> None:
    assert PAPER.battery is not None
    cells, found = PAPER.battery.cells, []
    for spec in ((), ("battery cell dead",)):
        state = flown(*spec, seconds=0.1, speed=0.0).plant.battery
        assert state is not None
        found.append(state.voltage_v + state.current_a * PAPER.battery.resistance_ohm)
    assert found[1] / found[0] == pytest.approx((cells - 1) / cells, rel=1e-6)


# ---------------------------------------------------------------------- schedule


def mass(simulator: Simulator) -> float:
    return float(simulator.plant.memory[0]["mass"])  # type: ignore[attr-defined]


def test_payload_is_cut_at_its_time_whatever_the_order() -> None:
    simulator = flown(
        "payload cut @0.2", "payload 0.3 at 0,0,0.1 @0.1", "payload 0.1 at 0,0,0 @0.3", seconds=0.0
    )
    found = []
    for _ in range(4):
        found.append(mass(simulator) - PAPER.mass_kg)
        fly(simulator, 0.1)
    assert found == pytest.approx([0.0, 0.3, 0.0, 0.1])
    simulator.inject(parse_fault("payload cut", 4))
    assert mass(simulator) == PAPER.mass_kg
    assert simulator.faults == ()


def test_ground_effect_ends_by_its_own_words() -> None:
    simulator = flown("ground effect on", seconds=0.1)
    assert len(simulator.faults) == 1
    simulator.inject(parse_fault("ground effect off", 4))
    assert simulator.faults == ()


def test_clear_ends_what_has_begun_and_keeps_what_has_not() -> None:
    simulator = flown("rotor 1 dead", "payload 0.2 at 0,0,0", "state frozen @0.5", "clear @0.2", seconds=0.18)
    assert len(simulator.faults) == 4
    fly(simulator, 0.02)
    assert [fault.kind for fault in simulator.faults] == [Kind.STATE_FREEZE]
    fly(simulator, 0.2)
    assert speeds(simulator)[0] == pytest.approx(LAG_SPEED, rel=1e-6)
    assert mass(simulator) == PAPER.mass_kg


def test_one_part_is_cleared() -> None:
    simulator = flown("rotor 1 dead", "rotor 2 dead", "payload 0.2 at 0,0,0", "clock stalled", seconds=0.1)
    simulator.clear_faults(part="payload")
    assert mass(simulator) == PAPER.mass_kg
    simulator.clear_faults(rotor=0)
    simulator.clear_faults(part="clock")
    assert [fault.rotor for fault in simulator.faults] == [1]
    assert simulator.stamp_us == 0  # the clock resumes from where it stopped
    simulator.clear_faults()
    assert simulator.faults == ()


@pytest.mark.parametrize("plant", ["rigid", "multibody"])
def test_all_faults_give_the_same_bytes_in_each_run(plant: str) -> None:
    specs = (
        "rotor 2 delayed 0.013 @0.02-0.2", "payload 0.2 at 0.05,0,0.05 @0.05", "payload cut @0.15",
        "centre of gravity 0.01,0,0 @0.1", "wind step 3,0,0 @0.05", "gust 1 @0.07-0.2", "wind shear 0.2",
        "ground effect on", "battery sag 0.1 @0.1", "battery cell dead @0.12", "state late 0.02 @0.1-0.15",
        "clock stalled @0.2-0.22", "clock jump 0.1 @0.25", "clear @0.27",
    )  # fmt: skip
    runs = []
    for _ in range(2):
        simulator = Simulator(PAPER.with_drag("rigid"), plant, PlantOptions(seed=3))
        simulator.inject(*(parse_fault(spec, 4) for spec in specs))
        data = b""
        for _ in range(147):
            data += bytes(simulator.outgoing())
            simulator.apply(command(225.0))
        runs.append(data)
    assert runs[0] == runs[1]


# ---------------------------------------------------------------------- faults that cannot act


@pytest.mark.parametrize(
    ("plant", "spec", "said"),
    [
        ("rigid", "wind step 5,0,0", "the vehicle paper_quad has no drag; add --drag"),
        ("rigid", "gust 1", "has no drag"), ("paper", "wind step 1,0,0", "the paper's model has no drag"),
        ("paper", "payload 0.1 at 0,0,0", "the paper's model has its centre of gravity in the origin"),
        ("paper", "centre of gravity 0.1,0,0", "use --plant rigid or multibody"),
        ("paper", "ground effect on", "the paper's model has no ground effect"),
        ("rigid", "payload cut", "there is no payload to cut"),
    ],
)  # fmt: skip
def test_fault_that_cannot_act_is_refused(plant: str, spec: str, said: str) -> None:
    simulator = Simulator(PAPER, plant)
    with pytest.raises(UsageProblemError, match=said):
        simulator.inject(parse_fault(spec, 4))
    assert simulator.faults == ()


def test_battery_faults_need_a_battery() -> None:
    assert PAPER.battery is not None
    without, one = replace(PAPER, battery=None), replace(PAPER, battery=replace(PAPER.battery, cells=1))
    for spec in ("battery level 0.5", "battery sag 1", "battery cell dead"):
        with pytest.raises(UsageProblemError, match=r"has no \[battery\]"):
            Simulator(without).inject(parse_fault(spec, 4))
    with pytest.raises(UsageProblemError, match="has one cell"):
        Simulator(one).inject(parse_fault("battery cell dead", 4))


def test_wind_shear_needs_a_mean_wind() -> None:
    vehicle, shear = PAPER.with_drag("rigid"), parse_fault("wind shear 0.14", 4)
    with pytest.raises(UsageProblemError, match="no mean wind"):
        Simulator(vehicle).inject(shear)
    Simulator(vehicle).inject(shear, parse_fault("wind step 3,0,0 @5", 4))
    Simulator(vehicle, options=PlantOptions(Disturbance(Vector3(3.0, 0.0, 0.0)))).inject(shear)


def test_event_with_an_end_is_refused() -> None:
    """Callers that set times themselves, as ``for_s`` of a scenario does."""
    with pytest.raises(UsageProblemError, match="fault battery level SHARE: it acts at one time"):
        Simulator(PAPER).inject(parse_fault("battery level 0.5", 4)._replace(end_us=1_000_000))


def test_ground_effect_needs_ground() -> None:
    with pytest.raises(UsageProblemError, match="there is no ground"):
        Simulator(PAPER, options=PlantOptions(ground=False)).inject(parse_fault("ground effect on", 4))


@pytest.mark.parametrize(
    "spec", ["rotor 1 delayed 0.02", "battery sag 0.1", "state late 0.02", "clock jump 1"]
)
def test_paper_plant_has_the_faults_that_have_a_meaning(spec: str) -> None:
    plain, faulty = Simulator(PAPER, "paper"), Simulator(PAPER, "paper")
    faulty.inject(parse_fault(f"{spec} @0.01", 4))
    rows: list[list[bytes]] = [[], []]
    for tick in range(50):
        for simulator, row in zip((plain, faulty), rows, strict=True):
            row.append(bytes(simulator.outgoing()))
            simulator.apply(command(250.0 + tick))
    battery = [s.plant.battery for s in (plain, faulty)]
    assert rows[0] != rows[1] or battery[0] != battery[1]
