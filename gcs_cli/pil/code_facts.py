"""Facts about the code of a target: lines that ran, and the stack of its functions."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from flightstack.core.errors import ConfigError
from flightstack.firmware.law_tree import controller_named, firmware_for
from flightstack.firmware.toolchain.coverage import FileCoverage, line_coverage
from flightstack.firmware.toolchain.stack_usage import stack_usage
from gcs_cli.pil.target_record import TargetRecord

_COUNTED = ("core/",)
"""Folders in the total: the loops. Application and protocol are listed, but a replay need not reach all of them."""


def code_facts(record: TargetRecord | None, controller: str) -> dict[str, Any]:
    """Return ``coverage`` and ``stack_usage`` of the firmware with this controller, each None if unknown."""
    if record is None:
        return {"coverage": None, "stack_usage": None}
    return {"coverage": _coverage(record), "stack_usage": _stack_usage(controller)}


def _coverage(record: TargetRecord) -> dict[str, Any] | None:
    if not record.trace:
        return None
    files = line_coverage(Path(record.trace["image"]), record.trace["executed"])
    return None if files is None else coverage_json(files)


def coverage_json(files: Mapping[str, FileCoverage]) -> dict[str, Any]:
    """Return the object for ``pil.json``."""
    counted = [found for name, found in files.items() if name.startswith(_COUNTED)]
    lines, executed = sum(found.lines for found in counted), sum(found.executed for found in counted)
    return {
        "lines": lines,
        "executed": executed,
        "percent": round(100.0 * executed / lines, 2) if lines else None,
        "files": {name: {**found._asdict(), "missed": list(found.missed)} for name, found in files.items()},
    }


def _stack_usage(controller: str) -> dict[str, Any] | None:
    try:
        with firmware_for(controller_named(controller)):
            usage = stack_usage()
    except ConfigError:
        return None
    return None if usage is None else {**usage._asdict(), "path": list(usage.path)}
