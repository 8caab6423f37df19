"""Vehicles with six and eight rotors: what the stack announces of them, on the wire and in the log."""

from __future__ import annotations

from io import BytesIO

import pytest
from pyulog import ULog

from flightstack.flight_log.flight_log import FlightLog
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from flightstack.params.config import DEFAULT_HOME
from flightstack.simulator_link.endpoint import SimulatorEndpoint
from tests.support.rotor_sets import ring

TYPES = [(4, mavlink.MAV_TYPE_QUADROTOR), (6, mavlink.MAV_TYPE_HEXAROTOR), (8, mavlink.MAV_TYPE_OCTOROTOR)]


class KeptFile(BytesIO):
    """A file whose content outlives it."""

    content = b""

    def close(self) -> None:
        self.content = self.getvalue()
        super().close()


@pytest.mark.parametrize(("rotors", "system_type"), TYPES)
def test_the_simulator_link_announces_the_type(rotors: int, system_type: int) -> None:
    link = SimulatorEndpoint(ring(rotors), DEFAULT_HOME, lockstep=True)
    (beat,) = Link(2, 1).decode(link.heartbeat(armed=False))
    assert beat.type == system_type


@pytest.mark.parametrize(("rotors", "system_type"), TYPES)
def test_the_log_holds_the_type(rotors: int, system_type: int) -> None:
    file = KeptFile()
    log = FlightLog(file, rotors)
    log.start(0, {}, {}, DEFAULT_HOME)
    log.event("vehicle_status", 1000, nav_state=4)
    log.close()
    status = ULog(BytesIO(file.content)).get_dataset("vehicle_status").data
    assert status["system_type"].tolist() == [system_type]
