"""The results of a run as JUnit XML. Pure."""

from __future__ import annotations

from collections.abc import Sequence

from gcs_cli.report.junit import JunitCase, junit_document
from gcs_cli.scenarios.result import Row, margin_text


def junit_xml(rows: Sequence[Row], wall_s: float) -> bytes:
    """Return the file: a test case for each flight, with its seed, closest margin and command as properties."""
    return junit_document("gcs test", "scenarios", [_case(row) for row in rows], wall_s)


def _case(row: Row) -> JunitCase:
    case, result = row.case, row.result
    folder = ".".join(part for part in case.scenario.path.parent.parts if part not in ("/", ".", ".."))
    attributes = {
        "classname": folder or "scenarios",
        "name": f"{case.scenario.name}[seed {case.seed}]",
        "file": str(case.scenario.path),
        "time": f"{result.wall_s:.3f}",
    }
    properties = {
        "seed": str(case.seed),
        "margin": margin_text(result.closest),
        "command": case.command,
        "kept": row.kept or "",
    }
    if result.passed:
        return JunitCase(attributes, properties)
    message = "; ".join(str(check).partition("\n")[0] for check in result.failures)
    details = "\n".join(str(check) for check in result.failures)
    return JunitCase(attributes, properties, message, f"{details}\nrepeat: {case.command}")
