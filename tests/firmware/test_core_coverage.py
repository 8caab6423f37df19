"""Every line and every branch of the core is run by the workout, whose results other tests compare."""

from __future__ import annotations

import gzip
import json
import shutil
from pathlib import Path

from tests.firmware.core_support import CORE, DRIVER, EXACT, run_tool, sources
from tests.firmware.core_works import assert_equal, made_here, of_real, work_out
from tests.support.tools import missing


def test_every_line_and_branch_of_the_core_is_run(tmp_path: Path) -> None:
    if not (shutil.which("gcc") and shutil.which("gcov")):
        missing("needs gcc and gcov")
    missed: dict[str, bool] = {}
    for real in ("float", "double"):
        folder = tmp_path / real
        folder.mkdir()
        flags = [*EXACT, "-O0", "--coverage", "-fPIC", "-fno-math-errno", *of_real(real), f"-I{CORE}"]
        for source in [*sources(), DRIVER]:
            run_tool(["gcc", *flags, "-c", source, "-o", folder / f"{source.stem}.o"], cwd=folder)
        library = folder / "core.so"
        run_tool(["gcc", "--coverage", "-shared", *sorted(folder.glob("*.o")), "-lm", "-o", library])
        assert_equal(work_out(real, library, folder / "out.npz"), made_here(real))
        objects = [folder / f"{source.stem}.gcda" for source in sources()]
        run_tool(["gcov", "--json-format", "--branch-probabilities", *objects], cwd=folder)
        for report in folder.glob("*.gcov.json.gz"):
            note(json.loads(gzip.decompress(report.read_bytes())), missed, real)
    assert len({place.split(":")[1] for place in missed}) >= len(sources())
    never = sorted(place for place, was_missed in missed.items() if was_missed)
    assert not never, "\n".join(never)


def note(report: dict, missed: dict[str, bool], real: str) -> None:  # type: ignore[type-arg]
    """Note for each line and branch of the core whether it was never run; inline functions stand in several files."""
    for file in report["files"]:
        path = Path(file["file"])
        if path.parent != CORE:
            continue
        for line in file["lines"]:
            counts = {"": line["count"]}
            # a branch that the compiler made for an exception is none of C's
            counts |= {f" branch {i}": b["count"] for i, b in enumerate(line["branches"]) if not b["throw"]}
            for what, count in counts.items():
                place = f"{real}:{path.name}:{line['line_number']}{what}"
                missed[place] = missed.get(place, True) and count == 0
