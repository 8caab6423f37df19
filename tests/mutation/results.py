"""The file of results: a line of JSON for each mutant as soon as it is tried, so that a run that was ended goes on."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import NamedTuple

from tests.mutation.mutants import Mutant
from tests.mutation.trials import Verdict

ROOT = Path(__file__).resolve().parents[2]
_DEPENDS_ON = ("firmware", "tests/firmware", "tests/parity", "tests/support", "tests/mutation")


def path_for_present_tests() -> Path:
    """Return the file for firmware and tests as they are: after an edit, what was found and what survived is open."""
    content = hashlib.sha256()
    for folder in _DEPENDS_ON:
        for path in sorted((ROOT / folder).rglob("*.[chp]*")):
            if path.suffix in {".c", ".h", ".py"}:
                content.update(str(path.relative_to(ROOT)).encode() + path.read_bytes())
    return ROOT / "build" / f"mutation-{content.hexdigest()[:12]}.jsonl"


class Result(NamedTuple):
    """One line: ``mutant`` as text, what became of it, the test that found it, and CPU time [s]."""

    key: str
    file: str
    mutant: str
    fate: str
    test: str
    cpu_s: float


class Results:
    """Results of this and earlier runs; of several for one mutant the last one counts."""

    def __init__(self, path: Path) -> None:
        self._path = path
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
        text = path.read_text()
        if text and not text.endswith("\n"):  # a run was ended while it wrote
            text = text[: text.rfind("\n") + 1]
            path.write_text(text)
        self.found = {line["key"]: Result(**line) for line in map(json.loads, text.splitlines())}

    def of(self, mutant: Mutant) -> Result | None:
        """Return what is known of a mutant of this very text."""
        return self.found.get(mutant.key)

    def add(self, verdict: Verdict) -> None:
        """Write a verdict."""
        mutant = verdict.mutant
        result = Result(
            mutant.key, mutant.file, str(mutant), verdict.fate, verdict.test, round(verdict.cpu_s, 3)
        )
        self.found[result.key] = result
        with self._path.open("a") as file:
            file.write(json.dumps(result._asdict()) + "\n")
