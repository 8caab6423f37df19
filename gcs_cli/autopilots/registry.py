"""The autopilot of a vehicle, by the MAV_AUTOPILOT in its heartbeat; any other has standard commands only. Pure."""

from __future__ import annotations

import math

from flightstack.mavlink.dialect import mavlink
from gcs_cli.autopilots import common_commands
from gcs_cli.autopilots.ardupilot import ARDUPILOT
from gcs_cli.autopilots.autopilot import Autopilot, Phase, VehicleCommand
from gcs_cli.autopilots.px4 import PX4

_RELATIVE = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT


def _yaw(heading_deg: float) -> VehicleCommand:
    nan = math.nan
    return common_commands.reposition(_RELATIVE, nan, nan, nan, math.radians(heading_deg))


GENERIC = Autopilot(
    name="generic",
    title="this autopilot",
    mode_names=lambda _vehicle_type: {},
    selectable=lambda _vehicle_type, _mode: True,
    roles={},
    aliases={},
    select_mode=lambda mode: common_commands.custom_mode(float(mode)),
    takeoff_phases=(Phase.TAKEOFF, Phase.ARM),
    takeoff_frame=_RELATIVE,
    has_takeoff_altitude=False,
    goto_frame=_RELATIVE,
    goto_keeps_altitude=False,
    yaw=_yaw,
    yaw_phases=(),
    default_speed=-2.0,
    speed_modes=lambda _vehicle_type: (),
    start_phases=(Phase.ARM, Phase.START),
    stream_groups_hz=ARDUPILOT.stream_groups_hz,
    stream_messages_hz={},
    reports_estimator=False,
    lacks_messages=frozenset(),
    sends_modes_as_stream=False,
    refusal_prefixes=(),
    casts_parameters=False,
    mission_begins_with_home=False,
    replaces_plans_at_once=False,
    stores_items_exactly=False,
    is_silent_without_logs=False,
    sends_logs_armed=True,
)


_BY_NUMBER = {mavlink.MAV_AUTOPILOT_PX4: PX4, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA: ARDUPILOT}


def autopilot_of(number: int) -> Autopilot:
    """Return the facts about a MAV_AUTOPILOT."""
    return _BY_NUMBER.get(number, GENERIC)
