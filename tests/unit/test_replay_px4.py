"""PX4's log as a vehicle."""

from __future__ import annotations

import numpy as np
import pytest

from flightstack.mavlink.dialect import mavlink
from gcs_cli.logs.recording import ULOG, Recording, Topic
from gcs_cli.replay.ulog_playback import UlogPlayback


@pytest.mark.parametrize(("reached", "is_complete"), [(-1, False), (5, False), (6, True)])
def test_takeoff_that_px4_calls_finished_is_no_complete_mission(reached: int, is_complete: bool) -> None:
    zeros = {name: np.array([0.0]) for name in ("x", "y", "z", "vx", "vy", "vz")}
    progress = {"seq_current": 0, "seq_total": 7, "seq_reached": reached, "finished": 1}
    topics = {
        "vehicle_local_position": zeros,
        "mission_result": {name: np.array([float(value)]) for name, value in progress.items()},
    }
    listed = tuple(Topic(name, np.array([0]), values) for name, values in topics.items())
    playback = UlogPlayback(Recording("log", ULOG, 0, 1, None, listed, info={"sys_name": "PX4"}))
    (current,) = (message for message in playback.state(0.0) if message.get_type() == "MISSION_CURRENT")
    assert (current.mission_state == mavlink.MISSION_STATE_COMPLETE) == is_complete
