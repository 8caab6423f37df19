"""Mutation run over core, codec and application.

``python -m tests.mutation [--mutants N] [--seed S] [--jobs J] [--only PART]``

Prints the score, and every survivor: a fault that the fast tests do not see, or no fault at all.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from tests.mutation import judge
from tests.mutation.judge import INVALID, SURVIVED, TESTS, UNTRIED, Verdict
from tests.mutation.mutants import Mutant, mutants

GENERATED = ("fs_param_table.c", "fs_messages.c", "fs_messages.h")
MOST_OF_A_GENERATED_FILE = 100
"""Its lines are alike, and `make generated` compares all of it with its source anyway."""
ELSEWHERE = ("fs_constants.h",)
"""Only the application uses these values of enumerations; `make generated` compares them with the XML."""


def chosen(sources: Path, only: str, number: int, seed: int) -> list[Mutant]:
    """Return mutants of all files by chance, so many of them when ``number`` is not 0."""
    rng, found = random.Random(seed), []
    for part in TESTS:
        for path in sorted((sources / part).glob("*.[ch]")):
            of_file = list(mutants(path.name, path.read_text())) if path.name not in ELSEWHERE else []
            if path.name in GENERATED:
                of_file = rng.sample(of_file, min(len(of_file), MOST_OF_A_GENERATED_FILE))
            found += [m for m in of_file if only in f"{part}/{path.name}"]
    rng.shuffle(found)
    return found[:number] if number else found


def judged(sample: list[Mutant], jobs: int, minutes: float, sources: Path, objects: Path) -> list[Verdict]:
    """Try mutants, ``jobs`` at a time, until all are tried or the time is over."""
    waiting, running, verdicts = list(sample), {}, []
    end_s = time.monotonic() + 60.0 * minutes
    while running or (waiting and time.monotonic() < end_s):
        if waiting and len(running) < jobs and time.monotonic() < end_s:
            mutant, work = waiting.pop(), Path(tempfile.mkdtemp(prefix="mutant-"))
            running[judge.start(mutant, work, sources, objects)] = (mutant, work)
            continue
        child, status = os.wait()
        mutant, work = running.pop(child)
        shutil.rmtree(work)
        verdicts.append(Verdict(mutant, judge.fate_of(status)))
        if verdicts[-1].fate in {SURVIVED, UNTRIED}:
            print(f"[{len(verdicts)}/{len(sample)}] {verdicts[-1].fate}  {mutant}", flush=True)
    return verdicts


def report(verdicts: list[Verdict]) -> None:
    """Print a line for each file and one for all."""
    print(f"\n{'file':32}{'mutants':>9}{'killed':>9}{'survived':>10}{'score':>8}")
    rows = [
        (name, [v for v in verdicts if v.mutant.file == name])
        for name in sorted({v.mutant.file for v in verdicts})
    ]
    for name, of_file in [*rows, ("all", verdicts)]:
        counted = [v for v in of_file if v.fate != INVALID]
        survived = sum(v.fate == SURVIVED for v in counted)
        if counted:
            score = 100.0 * (len(counted) - survived) / len(counted)
            print(f"{name:32}{len(counted):9}{len(counted) - survived:9}{survived:10}{score:7.1f}%")
    fates = Counter(v.fate for v in verdicts)
    print(", ".join(f"{number} {fate}" for fate, number in fates.most_common()))


def main() -> int:
    """Run; exit code 1 when less than ``--least`` percent were killed."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__)
    parser.add_argument("--mutants", type=int, default=0, help="so many of them, drawn by chance; 0: all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--minutes", type=float, default=24.0 * 60.0, help="begin no more of them after this time"
    )
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--only", default="", help="part of a file's name, core/fs_mixer.c for instance")
    parser.add_argument("--least", type=float, default=0.0, help="percent that must be killed")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="mutation-") as folder:
        sources, objects = Path(folder) / "firmware", Path(folder) / "objects"
        objects.mkdir()
        judge.snapshot(sources)
        sample = chosen(sources, given.only, given.mutants, given.seed)
        print(f"{len(sample)} mutants", flush=True)
        judge.warm_up({judge.part_of(mutant) for mutant in sample}, sources, objects)
        verdicts = judged(sample, given.jobs, given.minutes, sources, objects)
    report(verdicts)
    counted = [v for v in verdicts if v.fate != INVALID]
    killed = sum(v.fate != SURVIVED for v in counted)
    untried = any(v.fate == UNTRIED for v in verdicts)
    return int(untried or 100.0 * killed < given.least * len(counted))


if __name__ == "__main__":
    sys.exit(main())
