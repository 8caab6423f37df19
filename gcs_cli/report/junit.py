"""JUnit XML, as CI servers read it from pytest. Pure."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple
from xml.etree import ElementTree

_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


class JunitCase(NamedTuple):
    """One test case; ``failure`` is None if it passed."""

    attributes: Mapping[str, str]
    properties: Mapping[str, str] = {}
    """Properties with a value; empty ones are left out."""
    failure: str | None = None
    """Message of the failure."""
    details: str = ""


def junit_document(name: str, suite_name: str, cases: Sequence[JunitCase], wall_s: float) -> bytes:
    """Return the file with one suite."""
    failures = sum(case.failure is not None for case in cases)
    counts = {"tests": str(len(cases)), "failures": str(failures), "errors": "0", "skipped": "0"}
    root = ElementTree.Element("testsuites", {"name": _text(name), **counts, "time": f"{wall_s:.3f}"})
    suite = ElementTree.SubElement(
        root, "testsuite", {"name": _text(suite_name), **counts, "time": f"{wall_s:.3f}"}
    )
    for case in cases:
        _add(suite, case)
    ElementTree.indent(root)
    content: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return content + b"\n"


def _add(suite: ElementTree.Element, case: JunitCase) -> None:
    test = ElementTree.SubElement(
        suite, "testcase", {key: _text(value) for key, value in case.attributes.items()}
    )
    properties = ElementTree.SubElement(test, "properties")
    for name, value in case.properties.items():
        if value:
            ElementTree.SubElement(properties, "property", {"name": name, "value": _text(value)})
    if case.failure is not None:
        failure = ElementTree.SubElement(test, "failure", {"message": _text(case.failure)})
        failure.text = _text(case.details)


def _text(value: str) -> str:
    """Replace characters that XML cannot hold."""
    return _NOT_XML.sub("?", value)
