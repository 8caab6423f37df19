"""Export a log as MCAP with JSON messages: every topic, and Foxglove's types for pose, place and texts.

Schemas of Foxglove: https://docs.foxglove.dev/docs/sdk/schemas (foxglove.FrameTransform, .LocationFix, .SceneUpdate,
.Log).
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from flightstack.core.atomic_file import replacing
from flightstack.core.contract import FloatArray
from flightstack.core.enums import Severity
from gcs_cli.charts.decimate import spaced
from gcs_cli.errors import library
from gcs_cli.logs.motion import Motion, Samples, latest, motion_of
from gcs_cli.logs.recording import AnyArray, Recording, Topic
from gcs_cli.logs.scene import BODY, PATH_POINTS, WORLD, enu_positions, enu_quaternions

Json: TypeAlias = dict[str, Any]
_ELEMENT = re.compile(r"(.+)\[(\d+)\]")
_KINDS = {"b": "boolean", "i": "integer", "u": "integer", "f": "number"}
_FOXGLOVE_LEVELS = {Severity.WARNING: 3, Severity.ERROR: 4}
_encode = json.JSONEncoder(allow_nan=False).encode
_SORTED = 10_000
"""Messages whose places are held as lists at a time."""
_INFO, _FATAL, _DEBUG = 2, 5, 1
_ORANGE = {"r": 1.0, "g": 0.6, "b": 0.1, "a": 1.0}


class Channel(NamedTuple):
    """Messages of one schema: times of shape (n,) in the log's time; ``row`` makes the message of a row."""

    topic: str
    schema: str
    properties: Json
    time_us: AnyArray
    row: Callable[[int], Json]


def export_mcap(recording: Recording, path: Path) -> int:
    """Write the log; return the number of messages. Raise CliError or OSError."""
    writer_module = library("mcap.writer")
    channels = [*topic_channels(recording), *foxglove_channels(recording)]
    with replacing(path) as temporary, temporary.open("wb") as file:
        writer = writer_module.Writer(file)
        writer.start(profile="", library="flightstack")
        numbers = [_register(writer, channel) for channel in channels]
        for sequence, (index, row) in enumerate(in_order(channels)):
            channel = channels[index]
            at_ns = max(0, recording.unix_ns(channel.time_us[row]))
            data = _encode(channel.row(row)).encode()
            writer.add_message(numbers[index], at_ns, data, at_ns, sequence)
        writer.add_metadata("flight", {name: str(value) for name, value in recording.facts.items()})
        writer.add_metadata("parameters", {name: repr(value) for name, value in recording.parameters.items()})
        writer.finish()
    return sum(len(channel.time_us) for channel in channels)


def _register(writer: Any, channel: Channel) -> int:
    schema = {"title": channel.schema, "type": "object", "properties": channel.properties}
    schema_id = writer.register_schema(channel.schema, "jsonschema", json.dumps(schema).encode())
    number: int = writer.register_channel(channel.topic, "json", schema_id)
    return number


def in_order(channels: Sequence[Channel]) -> Iterator[tuple[int, int]]:
    """Yield channel and row of all messages by time; messages of one time in the order of their channels."""
    counts = [len(channel.time_us) for channel in channels]
    owners = np.repeat(np.arange(len(channels)), counts)
    rows = np.concatenate([np.arange(count) for count in counts])
    order = np.argsort(np.concatenate([channel.time_us for channel in channels]), kind="stable")
    for start in range(0, len(order), _SORTED):
        part = order[start : start + _SORTED]
        yield from zip(owners[part].tolist(), rows[part].tolist(), strict=True)


def topic_channels(recording: Recording) -> Iterator[Channel]:
    """Yield a channel for each topic; the elements of an array are a list again, and NaN is null."""
    for topic in recording.topics:
        yield _topic_channel(topic)


def _topic_channel(topic: Topic) -> Channel:
    single: dict[str, list[Any]] = {}
    arrays: dict[str, list[list[Any]]] = {}
    properties: Json = {"timestamp": {"type": "integer"}}
    for name, columns in grouped_fields(topic).items():
        kind = {"type": _KINDS.get(columns[0].dtype.kind, "string")}
        if name in topic.fields:
            single[name], properties[name] = _jsonable(columns[0]), kind
        else:
            arrays[name] = [_jsonable(column) for column in columns]
            properties[name] = {"type": "array", "items": kind}

    def row(index: int) -> Json:
        return {
            "timestamp": int(topic.time_us[index]),
            **{name: column[index] for name, column in single.items()},
            **{name: [column[index] for column in columns] for name, columns in arrays.items()},
        }

    return Channel(topic.name, topic.kind or topic.name, properties, topic.time_us, row)


def grouped_fields(topic: Topic) -> dict[str, list[AnyArray]]:
    """Return the columns of each field: one, or those of an array's elements in order."""
    groups: dict[str, list[AnyArray]] = {}
    for name, values in topic.fields.items():
        element = _ELEMENT.fullmatch(name)
        groups.setdefault(element[1] if element else name, []).append(values)
    return groups


def _jsonable(column: AnyArray) -> list[Any]:
    values = column.tolist()
    if column.dtype.kind != "f" or bool(np.isfinite(column).all()):
        return values  # type: ignore[no-any-return]
    return [value if math.isfinite(value) else None for value in values]


def foxglove_channels(recording: Recording) -> Iterator[Channel]:
    """Yield pose, path, place and texts in Foxglove's types, of what the log has."""
    motion = motion_of(recording)
    if not motion.attitude.is_empty:
        yield _transforms(recording, motion)
    if len(motion.position.time_us) > 1:
        yield _path(recording, motion.position)
    if not motion.geodetic.is_empty:
        yield _locations(recording, motion.geodetic)
    if recording.texts:
        yield _texts(recording)


def _transforms(recording: Recording, motion: Motion) -> Channel:
    time_us = motion.attitude.time_us
    places = np.nan_to_num(enu_positions(latest(motion.position, time_us)))
    turns = enu_quaternions(motion.attitude.values)

    def row(index: int) -> Json:
        w, x, y, z = turns[index].tolist()
        return {
            "timestamp": _time(recording, time_us[index]),
            "parent_frame_id": WORLD,
            "child_frame_id": BODY,
            "translation": _vector(places[index]),
            "rotation": {"x": x, "y": y, "z": z, "w": w},
        }

    return _channel("/tf", "foxglove.FrameTransform", time_us, row)


def _locations(recording: Recording, geodetic: Samples) -> Channel:
    def row(index: int) -> Json:
        latitude, longitude, altitude = geodetic.values[index].tolist()
        return {
            "timestamp": _time(recording, geodetic.time_us[index]),
            "frame_id": WORLD,
            "latitude": latitude,
            "longitude": longitude,
            "altitude": altitude,
            "position_covariance": [0.0] * 9,
            "position_covariance_type": 0,
        }

    return _channel("/location", "foxglove.LocationFix", geodetic.time_us, row)


def _texts(recording: Recording) -> Channel:
    def row(index: int) -> Json:
        text = recording.texts[index]
        return {
            "timestamp": _time(recording, text.time_us),
            "level": _foxglove_level(text.severity),
            "message": text.text,
            "name": "vehicle",
            "file": "",
            "line": 0,
        }

    time_us = np.array([text.time_us for text in recording.texts], dtype=np.int64)
    return _channel("/texts", "foxglove.Log", time_us, row)


def _path(recording: Recording, position: Samples) -> Channel:
    """Return the whole path as one scene, at the first position."""
    first_us = int(position.time_us[0])
    points = enu_positions(position.values)[spaced(len(position.time_us), PATH_POINTS)]
    line = {
        "type": 0,  # LINE_STRIP
        "pose": {"position": _vector(np.zeros(3)), "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}},
        "thickness": 2.0,
        "scale_invariant": True,
        "points": [_vector(point) for point in points],
        "color": _ORANGE,
        "colors": [],
        "indices": [],
    }
    empty: Json = {
        name: []
        for name in ("arrows", "cubes", "spheres", "cylinders", "triangles", "texts", "models", "metadata")
    }
    entity = {
        "timestamp": _time(recording, first_us),
        "frame_id": WORLD,
        "id": "path",
        "lifetime": {"sec": 0, "nsec": 0},
        "frame_locked": False,
        "lines": [line],
        **empty,
    }
    scene: Json = {"deletions": [], "entities": [entity]}
    return _channel("/path", "foxglove.SceneUpdate", np.array([first_us]), lambda _: scene)


def _channel(topic: str, schema: str, time_us: AnyArray, row: Callable[[int], Json]) -> Channel:
    return Channel(topic, schema, {name: _described(value) for name, value in row(0).items()}, time_us, row)


def _described(value: Any) -> Json:
    """Return the JSON schema of an example."""
    if isinstance(value, dict):
        return {"type": "object", "properties": {name: _described(each) for name, each in value.items()}}
    if isinstance(value, list):
        return {"type": "array", "items": _described(value[0]) if value else {"type": "object"}}
    names = {bool: "boolean", int: "integer", str: "string"}
    return {"type": names.get(type(value), "number")}


def _time(recording: Recording, time_us: int | np.int64) -> Json:
    seconds, nanoseconds = divmod(max(0, recording.unix_ns(time_us)), 1_000_000_000)
    return {"sec": seconds, "nsec": nanoseconds}


def _vector(place: FloatArray) -> Json:
    x, y, z = place.tolist()
    return {"x": x, "y": y, "z": z}


def _foxglove_level(severity: int) -> int:
    if severity < Severity.ERROR:
        return _FATAL
    return _FOXGLOVE_LEVELS.get(Severity(severity), _DEBUG if severity == Severity.DEBUG else _INFO)
