"""The autopilot of a vehicle, by the MAV_AUTOPILOT in its heartbeat. Pure."""

from __future__ import annotations

from flightstack.mavlink.dialect import mavlink
from gcs_cli.autopilots.ardupilot import ARDUPILOT
from gcs_cli.autopilots.autopilot import Autopilot
from gcs_cli.autopilots.generic import GENERIC
from gcs_cli.autopilots.px4 import PX4

_BY_NUMBER = {mavlink.MAV_AUTOPILOT_PX4: PX4, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA: ARDUPILOT}


def autopilot_of(number: int) -> Autopilot:
    """Return the facts about a MAV_AUTOPILOT."""
    return _BY_NUMBER.get(number, GENERIC)
