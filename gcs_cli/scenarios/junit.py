"""The results of a run as JUnit XML, as CI servers read it from pytest. Pure."""

from __future__ import annotations

import re
from collections.abc import Sequence
from xml.etree import ElementTree

from gcs_cli.scenarios.result import Row, margin_text

_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def junit_xml(rows: Sequence[Row], wall_s: float) -> bytes:
    """Return the file: a test case for each flight, with its seed, closest margin and command as properties."""
    failures = sum(not row.result.passed for row in rows)
    counts = {"tests": str(len(rows)), "failures": str(failures), "errors": "0", "skipped": "0"}
    root = ElementTree.Element("testsuites", {"name": "gcs test", **counts, "time": f"{wall_s:.3f}"})
    suite = ElementTree.SubElement(
        root, "testsuite", {"name": "scenarios", **counts, "time": f"{wall_s:.3f}"}
    )
    for row in rows:
        _add(suite, row)
    ElementTree.indent(root)
    content: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return content + b"\n"


def _add(suite: ElementTree.Element, row: Row) -> None:
    case, result = row.case, row.result
    folder = ".".join(part for part in case.scenario.path.parent.parts if part not in ("/", ".", ".."))
    attributes = {
        "classname": _text(folder or "scenarios"),
        "name": _text(f"{case.scenario.name}[seed {case.seed}]"),
        "file": _text(str(case.scenario.path)),
        "time": f"{result.wall_s:.3f}",
    }
    test = ElementTree.SubElement(suite, "testcase", attributes)
    properties = ElementTree.SubElement(test, "properties")
    values = {
        "seed": str(case.seed),
        "margin": margin_text(result.closest),
        "command": case.command,
        "kept": row.kept or "",
    }
    for name, value in values.items():
        if value:
            ElementTree.SubElement(properties, "property", {"name": name, "value": _text(value)})
    if not result.passed:
        message = "; ".join(str(check).partition("\n")[0] for check in result.failures)
        failure = ElementTree.SubElement(test, "failure", {"message": _text(message)})
        details = "\n".join(str(check) for check in result.failures)
        failure.text = _text(f"{details}\nrepeat: {case.command}")


def _text(value: str) -> str:
    """Replace characters that XML cannot hold."""
    return _NOT_XML.sub("?", value)
