"""A ULog of any vehicle as a ``Recording``. Pure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np

from flightstack.core.errors import ConfigError
from gcs_cli.logs.recording import ULOG, Dropout, LogText, ParameterChange, Recording, Topic
from gcs_cli.logs.ulog_parser import NO_DATA, parse_ulog

_GPS_TOPICS = ("vehicle_gps_position", "sensor_gps")
_LOWEST_LEVEL = 7


def read_ulog(content: bytes, source: str) -> Recording:
    """Read the bytes of a ULog file, complete or truncated; raise ConfigError, which names ``source``."""
    log, damaged = parse_ulog(content, source)
    topics = tuple(_topics(log))
    if not topics:
        raise ConfigError(source, "", NO_DATA)
    return Recording(
        source=source,
        form=ULOG,
        start_us=int(log.start_timestamp),
        end_us=max(int(log.start_timestamp), int(log.last_timestamp)),
        epoch_us=_epoch_us(topics),
        topics=topics,
        texts=tuple(sorted(_texts(log))),
        info={**_binary_information(log), **log.msg_info_dict},
        parameters=dict(log.initial_parameters),
        changes=tuple(
            ParameterChange(int(time_us), name, float(value))
            for time_us, name, value in log.changed_parameters
        ),
        dropouts=tuple(Dropout(int(item.timestamp), item.duration * 1e-3) for item in log.dropouts),
        damaged=damaged,
        vehicle=_vehicle(log.initial_parameters),
    )


def _binary_information(log: Any) -> dict[str, bytes]:
    """Return the multi-information messages that hold bytes, the first of each key with its continuations."""
    found = {key: values[0] for key, values in log.msg_info_multiple_dict.items()}
    return {
        key: b"".join(parts) for key, parts in found.items() if all(isinstance(part, bytes) for part in parts)
    }


def _topics(log: Any) -> Iterator[Topic]:
    names = Counter(item.name for item in log.data_list)
    for item in sorted(log.data_list, key=lambda item: (item.name, item.multi_id)):
        if not len(item.data.get("timestamp", ())):  # damaged definitions may lack it
            continue
        several = names[item.name] > 1 and item.multi_id > 0
        yield Topic(
            name=f"{item.name}_{item.multi_id}" if several else item.name,
            time_us=item.data["timestamp"].astype(np.int64),
            fields={name: values for name, values in item.data.items() if name != "timestamp"},
            kind=item.name,
        )


def _texts(log: Any) -> Iterator[LogText]:
    tagged = (entry for entries in log.logged_messages_tagged.values() for entry in entries)
    for entry in (*log.logged_messages, *tagged):
        level = entry.log_level - ord("0")
        yield LogText(int(entry.timestamp), min(max(level, 0), _LOWEST_LEVEL), entry.message)


def _epoch_us(topics: tuple[Topic, ...]) -> int | None:
    """Return the time of the vehicle's start, which its satellite receiver tells; None without one."""
    for topic in topics:
        utc_us = topic.fields.get("time_utc_usec")
        if topic.kind in _GPS_TOPICS and utc_us is not None:
            known = np.flatnonzero(utc_us > 0)
            if len(known):
                return int(utc_us[known[0]]) - int(topic.time_us[known[0]])
    return None


def _vehicle(parameters: dict[str, Any]) -> tuple[int, int]:
    system, component = (int(parameters.get(name, 1)) for name in ("MAV_SYS_ID", "MAV_COMP_ID"))
    return system if 0 < system < 256 else 1, component if 0 < component < 256 else 1
