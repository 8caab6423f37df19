"""The checks of a comparison as JUnit XML. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gcs_cli.report.junit import JunitCase, junit_document


def pil_junit(result: Mapping[str, Any], command: str, wall_s: float) -> bytes:
    """Return the file: a test case for each check of ``pil.json``, with measured value and limit as properties."""
    cases = [_case(check, f"{command}.{result['title']}") for check in result["checks"]]
    return junit_document(f"gcs {command.replace('.', ' ')}", result["title"], cases, wall_s)


def _case(check: Mapping[str, Any], classname: str) -> JunitCase:
    unit = f" {check['unit']}" if check["unit"] else ""
    measured = "not a number" if check["measured"] is None else f"{check['measured']:.6g}{unit}"
    limit = f"{check['limit']:g}{unit}"
    attributes = {"classname": classname, "name": check["name"], "time": "0.000"}
    properties = {"measured": measured, "limit": limit, "where": check["about"]}
    if check["passed"]:
        return JunitCase(attributes, properties)
    return JunitCase(attributes, properties, f"measured {measured}, limit {limit}", check["about"])
