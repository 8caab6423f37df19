"""A simulator of the paper's vehicle with faults."""

from __future__ import annotations

from flightstack.core.geodesy import GeoPoint
from flightstack.params.vehicle import load_vehicle
from flightstack.simulator_link.hot_frames import ARMED_FLAG, ActuatorsFrame
from sim_bridge.plant.faults.schedule import parse_fault
from sim_bridge.simulator import Simulator

PAPER = load_vehicle("paper_quad")
HOME = GeoPoint(47.397742, 8.545594, 488.0)
LAG_SPEED = 214.0


def command(speed: float = LAG_SPEED, flags: int = ARMED_FLAG, time_us: int = 0) -> ActuatorsFrame:
    frame = ActuatorsFrame()
    frame.rotor_speed_rad_s[:4] = speed
    frame.set_rotor_count(4)
    frame.seal(time_us, flags)
    return frame


def flown(*specs: str, seconds: float = 0.4, speed: float = LAG_SPEED) -> Simulator:
    simulator = Simulator(PAPER)
    simulator.inject(*(parse_fault(spec, 4) for spec in specs))
    fly(simulator, seconds, speed)
    return simulator


def fly(simulator: Simulator, seconds: float, speed: float = LAG_SPEED, flags: int = ARMED_FLAG) -> None:
    for _ in range(round(seconds * 500.0)):
        simulator.apply(command(speed, flags))


def speeds(simulator: Simulator) -> list[float]:
    return simulator.frame.rotor_speed_rad_s[:4].tolist()
