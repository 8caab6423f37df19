"""Every line and every branch of the filter in C is run by the streams that are compared with Python."""

from __future__ import annotations

import gzip
import json
import re
import shutil
from pathlib import Path

from flightstack.firmware.c_filter import filter_sources
from tests.firmware.core_support import CORE, EXACT, run_tool
from tests.firmware.filter_machines import INCLUDES, C, stream_of
from tests.support.filter_flights import STREAMS
from tests.support.tools import missing

NEVER = {
    "for (int32_t count = 0; count < 9; count++) {": "the last source ends the step",
    "for (int32_t count = 0; count < 256; count++) {": "a step, and all steps that wait, have fewer parts",
    "for (int32_t count_2 = 0; count_2 < 8; count_2++) {": "the Earth's field has fewer stages",
    "if (flags->landed == 1 || flags->has_gnss == 0) {": "a velocity comes with a position",
}
"""Branches that no stream can take, and the reasons."""


def test_every_line_and_branch_of_the_filter_is_run(tmp_path: Path) -> None:
    if not (shutil.which("gcc") and shutil.which("gcov")):
        missing("needs gcc and gcov")
    sources = [*filter_sources(), C / "filter_steps.c", C / "filter_host.c"]
    flags = [*EXACT, "-O0", "--coverage", "-fno-math-errno", *INCLUDES]
    for source in sources:
        run_tool(["gcc", *flags, "-c", source, "-o", tmp_path / f"{source.stem}.o"], cwd=tmp_path)
    program = tmp_path / "filter"
    run_tool(["gcc", "--coverage", *sorted(tmp_path.glob("*.o")), "-o", program])
    stream = tmp_path / "stream"
    for events in STREAMS.values():
        stream.write_bytes(stream_of(events()))
        run_tool([program, stream, tmp_path / "hashes"])
    objects = [tmp_path / f"{source.stem}.gcda" for source in sources]
    run_tool(["gcov", "--json-format", "--branch-probabilities", *objects], cwd=tmp_path)
    missed = [place for report in tmp_path.glob("*.gcov.json.gz") for place in never_run(report)]
    known = [
        place for place in missed if " branch " in place and re.sub(r"^\S+ branch \d+: ", "", place) in NEVER
    ]
    assert missed == known, "\n".join(sorted(set(missed) - set(known)))
    assert {re.sub(r"^\S+ branch \d+: ", "", place) for place in known} == set(NEVER)


def never_run(report: Path) -> list[str]:
    """Return the places of lines and branches of the estimator's own files that were never run."""
    found = []
    for file in json.loads(gzip.decompress(report.read_bytes()))["files"]:
        path = Path(file["file"])
        if path.parent != CORE / "estimation":
            continue
        for line in file["lines"]:
            counts = {"": line["count"]} | {
                f" branch {i}": b["count"] for i, b in enumerate(line["branches"])
            }
            text = path.read_text().splitlines()[line["line_number"] - 1].strip()
            found += [
                f"{path.name}:{line['line_number']}{what}: {text}" for what, n in counts.items() if n == 0
            ]
    return found
