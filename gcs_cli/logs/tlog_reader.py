"""A tlog of any vehicle as a ``Recording``: each message of each sender is a topic. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, TypeAlias

import numpy as np

from flightstack.core.errors import ConfigError
from flightstack.mavlink.dialect import ardupilot_dialect, mavlink
from flightstack.mavlink.link import Link, Message
from flightstack.mavlink.param_values import HASH_NAME, REAL32, integer_of
from gcs_cli.autopilots.registry import autopilot_of
from gcs_cli.link.tlog import Record, decode_records, encode_record
from gcs_cli.logs.recording import TLOG, AnyArray, LogText, Recording, Topic

_Key: TypeAlias = tuple[int, int, str]
"""System, component and message."""
_Messages: TypeAlias = dict[_Key, list[tuple[int, Message]]]
"""The messages of each sender and kind, with their times [us]."""
_LATEST_US = 1 << 53
"""In the year 2255."""
_NOT_AUTOPILOTS = (mavlink.MAV_AUTOPILOT_INVALID,)


def read_tlog(content: bytes, source: str) -> Recording:
    """Read the bytes of a tlog, complete or truncated; raise ConfigError, which names ``source``."""
    records = dated_records(content)
    messages, unknown = _decoded(records)
    if unknown and _has_ardupilot(messages):
        ardupilot_dialect()
        messages, unknown = _decoded(records)
    if not messages:
        raise ConfigError(source, "", "is neither a ULog nor a tlog with MAVLink messages")
    vehicle = vehicle_in(messages)
    own = {kind: samples for (*sender, kind), samples in messages.items() if tuple(sender) == vehicle}
    times = [time_us for samples in messages.values() for time_us in (samples[0][0], samples[-1][0])]
    return Recording(
        source=source,
        form=TLOG,
        start_us=min(times),
        end_us=max(times),
        epoch_us=0,
        topics=tuple(_topics(messages, vehicle)),
        texts=tuple(
            LogText(time_us, message.severity, message.text) for time_us, message in own.get("STATUSTEXT", ())
        ),
        info=_info(own),
        parameters={
            message.param_id: _value(message, own)
            for _, message in own.get("PARAM_VALUE", ())
            if message.param_id != HASH_NAME
        },
        damaged=_size_of(records) < len(content),
        unknown=unknown,
        vehicle=vehicle,
    )


def _decoded(records: Sequence[Record]) -> tuple[_Messages, int]:
    """Return the messages with their times, and the number of frames that the dialect does not have."""
    link = Link(0, 0)
    messages: _Messages = {}
    for record in records:
        for message in link.decode(record.frame):
            key = (message.get_srcSystem(), message.get_srcComponent(), message.get_type())
            messages.setdefault(key, []).append((record.time_us, message))
    return messages, link.bad


def _has_ardupilot(messages: _Messages) -> bool:
    beats = (samples[0][1] for (*_, kind), samples in messages.items() if kind == "HEARTBEAT")
    return any(beat.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA for beat in beats)


def dated_records(content: bytes) -> list[Record]:
    """Return the records of a tlog whose time is possible: damage can make any number of it."""
    return [record for record in decode_records(content) if record.time_us < _LATEST_US]


def vehicle_in(messages: _Messages) -> tuple[int, int]:
    """Return system and component of the first autopilot, else of the first sender."""
    beats = [
        (samples[0][0], system, component)
        for (system, component, kind), samples in messages.items()
        if kind == "HEARTBEAT" and samples[0][1].autopilot not in _NOT_AUTOPILOTS
    ]
    if beats:
        return min(beats)[1:]
    system, component, _ = next(iter(messages))
    return system, component


def _topics(messages: _Messages, vehicle: tuple[int, int]) -> Iterator[Topic]:
    for (system, component, kind), samples in sorted(
        messages.items(), key=lambda item: (item[0][2], item[0])
    ):
        yield Topic(
            name=kind if (system, component) == vehicle else f"{kind}_{system}_{component}",
            time_us=np.array([time_us for time_us, _ in samples], dtype=np.int64),
            fields=dict(_fields([message for _, message in samples])),
            kind=kind,
        )


def _fields(samples: Sequence[Message]) -> Iterator[tuple[str, AnyArray]]:
    for name in samples[0].get_fieldnames():
        values = [getattr(message, name) for message in samples]
        if isinstance(values[0], list | tuple):
            for index in range(len(values[0])):
                yield f"{name}[{index}]", np.array([value[index] for value in values])
        else:
            yield name, np.array(values)


def _info(own: dict[str, list[tuple[int, Message]]]) -> dict[str, Any]:
    beats = own.get("HEARTBEAT")
    if not beats:
        return {}
    info: dict[str, Any] = {
        "autopilot": _word("MAV_AUTOPILOT", beats[0][1].autopilot),
        "vehicle_type": _word("MAV_TYPE", beats[0][1].type),
    }
    for _, message in own.get("AUTOPILOT_VERSION", ())[-1:]:
        info["ver_sw_release"] = message.flight_sw_version
    return info


def _word(enum: str, value: int) -> str:
    entry = mavlink.enums[enum].get(value)
    return str(value) if entry is None else entry.name.removeprefix(f"{enum}_").lower()


def _value(message: Message, own: dict[str, list[tuple[int, Message]]]) -> int | float:
    """Return a parameter's value: that of an integer is in the bits of the float, or cast, by autopilot."""
    if message.param_type == REAL32:
        return float(message.param_value)
    casts = any(autopilot_of(beat.autopilot).casts_parameters for _, beat in own.get("HEARTBEAT", ())[:1])
    return round(message.param_value) if casts else integer_of(message.param_value)


def _size_of(records: Sequence[Record]) -> int:
    return sum(len(encode_record(record.time_us, record.frame)) for record in records)
