"""Contents of a log: facts for programs, lines for people. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Any, NamedTuple

from flightstack.core.enums import Severity
from gcs_cli.logs.recording import Recording
from gcs_cli.vehicle.param_info import number_text

_NAMES = {"sys_name": "system", "ver_sw": "software", "ver_hw": "hardware"}


class Line(NamedTuple):
    """One fact: the event and its values for programs, and a sentence."""

    event: str
    sentence: str
    facts: dict[str, Any]


def info_lines(recording: Recording) -> Iterator[Line]:
    """Yield the log's facts: one about the log, then topics, dropouts, changed parameters and texts."""
    yield _about(recording)
    width = max(len(topic.name) for topic in recording.topics)
    for topic in recording.topics:
        rate = "" if topic.rate_hz is None else f"{topic.rate_hz:9.1f} Hz"
        sentence = f"  {topic.name:<{width}}  {topic.count:7d}  {len(topic.fields):3d} fields{rate}"
        facts = {
            "name": topic.name,
            "count": topic.count,
            "rate_hz": topic.rate_hz,
            "fields": list(topic.fields),
        }
        yield Line("topic", sentence, facts)
    for dropout in recording.dropouts:
        at_s = recording.since_start_s(dropout.time_us)
        sentence = f"dropout at {at_s:.3f} s of {dropout.duration_s:.3f} s"
        yield Line("dropout", sentence, {"time_s": at_s, "duration_s": dropout.duration_s})
    for change in recording.changes:
        at_s = recording.since_start_s(change.time_us)
        sentence = f"parameter {change.name} = {number_text(change.value)} at {at_s:.3f} s"
        yield Line("parameter", sentence, {"time_s": at_s, "name": change.name, "value": change.value})
    for text in recording.texts:
        at_s = recording.since_start_s(text.time_us)
        severity = Severity(text.severity).name.lower()
        sentence = f"{at_s:9.3f} s  {severity:<9}  {text.text}"
        yield Line("text", sentence, {"time_s": at_s, "severity": text.severity, "text": text.text})


def _about(recording: Recording) -> Line:
    facts: dict[str, Any] = {
        "file": recording.source,
        "format": recording.form,
        "duration_s": recording.duration_s,
        "start_utc": start_utc(recording),
        "system_id": recording.vehicle[0],
        "topics": len(recording.topics),
        "samples": sum(topic.count for topic in recording.topics),
        "parameters": len(recording.parameters),
        "parameters_changed": len(recording.changes),
        "dropouts": len(recording.dropouts),
        "dropouts_s": sum(dropout.duration_s for dropout in recording.dropouts),
        "texts": len(recording.texts),
        "unknown_messages": recording.unknown,
        "damaged": recording.damaged,
        "vehicle": vehicle_facts(recording),
    }
    rows = [
        ("log", f"{recording.form}, {recording.duration_s:.1f} s, {facts['samples']} samples in "
                f"{facts['topics']} topics" + (", damaged or truncated" if recording.damaged else "")),
        ("started", facts["start_utc"] or "unknown time"),
        *((_NAMES.get(name, name.replace("_", " ")), str(value)) for name, value in facts["vehicle"].items()),
        ("parameters", f"{len(recording.parameters)}, {len(recording.changes)} changed during the log"),
        ("dropouts", f"{facts['dropouts']}, {facts['dropouts_s']:.3f} s in all"),
    ]  # fmt: skip
    if recording.unknown:
        rows.append(("unknown", f"{recording.unknown} messages that the dialect does not have"))
    return Line("log", "\n".join(f"{name:<13} {value}" for name, value in rows), facts)


def start_utc(recording: Recording) -> str | None:
    """Return the date of the log's start in UTC; None if it is unknown."""
    if recording.epoch_us is None:
        return None
    try:
        moment = datetime.fromtimestamp((recording.epoch_us + recording.start_us) * 1e-6, UTC)
    except (OverflowError, ValueError, OSError):
        return None
    return moment.isoformat(timespec="milliseconds")


def vehicle_facts(recording: Recording) -> dict[str, Any]:
    """Return what the log says about vehicle and software."""
    names = ("sys_name", "vehicle", "vehicle_type", "autopilot", "ver_hw", "ver_sw", "controller", "loops")
    facts = {name: recording.info[name] for name in names if name in recording.info}
    release = recording.info.get("ver_sw_release")
    if isinstance(release, int):
        facts["version"] = ".".join(str(release >> shift & 255) for shift in (24, 16, 8))
    return facts
