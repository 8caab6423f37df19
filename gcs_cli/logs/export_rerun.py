"""Export a log as a Rerun recording (.rrd): every number over time, pose, path, map and texts."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from flightstack.core.atomic_file import replacing
from flightstack.core.enums import Severity
from gcs_cli.charts.decimate import spaced
from gcs_cli.errors import library
from gcs_cli.logs.motion import latest, motion_of
from gcs_cli.logs.recording import AnyArray, Recording
from gcs_cli.logs.scene import PATH_POINTS, enu_positions, enu_quaternions

TIMELINE = "time"
"""Time since the start of the log."""
_LEVELS = ("CRITICAL", "CRITICAL", "CRITICAL", "ERROR", "WARN", "INFO", "INFO", "DEBUG")


def export_rerun(recording: Recording, path: Path) -> int:
    """Write the log; return the number of entities. Raise CliError or OSError."""
    rr = library("rerun")
    with replacing(path) as temporary:
        # the same id each time: the same log gives the same recording
        stream = rr.RecordingStream("flightstack", recording_id=Path(recording.source).name)
        stream.save(str(temporary))
        count = _write(rr, stream, recording)
        try:
            stream.flush()
        except RuntimeError as error:  # a full disk; the library tells no reason
            raise OSError(0, f"cannot be written: {error}") from error
        stream.disconnect()
    return count


def _write(rr: Any, stream: Any, recording: Recording) -> int:
    def times(time_us: AnyArray) -> list[Any]:
        return [rr.TimeColumn(TIMELINE, duration=(time_us - recording.start_us).astype("timedelta64[us]"))]

    count = 0
    for topic in recording.topics:
        index = times(topic.time_us)
        for name, values in topic.fields.items():
            if values.dtype.kind in "biuf":
                scalars = rr.Scalars.columns(scalars=values.astype(np.float64))
                stream.send_columns(entity_path(topic.name, name), indexes=index, columns=scalars)
                count += 1
    if recording.texts:
        texts = rr.TextLog.columns(
            text=[text.text for text in recording.texts],
            level=[_LEVELS[Severity(text.severity)] for text in recording.texts],
        )
        index = times(np.array([text.time_us for text in recording.texts]))
        stream.send_columns("texts", indexes=index, columns=texts)
        count += 1
    return count + _write_motion(rr, stream, recording, times)


def entity_path(topic: str, field: str) -> str:
    """Return the entity of a field: an element of an array is a child of its own."""
    return "/".join((topic, *re.sub(r"\[(\d+)\]", r".\1", field).split(".")))


def _write_motion(rr: Any, stream: Any, recording: Recording, times: Any) -> int:
    """Write pose and path in ``world``, east, north, up, and the places on the map; return the number of entities."""
    motion, count = motion_of(recording), 0
    if not motion.attitude.is_empty:
        time_us = motion.attitude.time_us
        places = np.nan_to_num(enu_positions(latest(motion.position, time_us)))
        turns = enu_quaternions(motion.attitude.values)[:, [1, 2, 3, 0]]
        stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        stream.log("world/vehicle/body", rr.Boxes3D(half_sizes=[[0.2, 0.2, 0.05]]), static=True)
        columns = rr.Transform3D.columns(translation=places, quaternion=turns)
        stream.send_columns("world/vehicle", indexes=times(time_us), columns=columns)
        count += 2
    if len(motion.position.time_us) > 1:
        path = enu_positions(motion.position.values)[spaced(len(motion.position.time_us), PATH_POINTS)]
        stream.log("world/path", rr.LineStrips3D([path]), static=True)
        count += 1
    if not motion.geodetic.is_empty:
        columns = rr.GeoPoints.columns(positions=motion.geodetic.values[:, :2])
        stream.send_columns("map/vehicle", indexes=times(motion.geodetic.time_us), columns=columns)
        count += 1
    return count
