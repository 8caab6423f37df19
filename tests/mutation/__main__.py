"""Mutation run over core, codec and application.

``python -m tests.mutation [--mutants N] [--seed S] [--only PART] [--again FATE] [--results FILE]``

Mutants that the file of results knows are not tried again: a run that was ended goes on. Prints every survivor (a
fault that the fast tests do not see, or no fault at all) and the score.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections import Counter
from pathlib import Path

from tests.mutation.mutants import Mutant, mutants
from tests.mutation.results import Result, Results, path_for_present_tests
from tests.mutation.trials import (
    EQUAL,
    FIRMWARE,
    INVALID,
    KILLED,
    SURVIVED,
    TESTS,
    UNTRIED,
    Trials,
    with_tests,
)

ELSEWHERE = {"mavlink/fs_constants.h": "app"}
"""The application alone uses these values."""
TABLES = ("fs_param_table.c", "fs_messages.c", "fs_messages.h")
"""Generated, their lines alike: tried last."""
NO_FAULT, TESTED = {EQUAL, INVALID}, {KILLED, SURVIVED}


def all_mutants() -> dict[str, list[Mutant]]:
    """Return the mutants of each part's files."""
    found: dict[str, list[Mutant]] = {part: [] for part in TESTS}
    for part in TESTS:
        for path in sorted((FIRMWARE / part).glob("*.[ch]")):
            name = f"{part}/{path.name}"
            found[ELSEWHERE.get(name, part)] += mutants(name, path.read_text())
    return found


def chosen(only: str, number: int, seed: int) -> dict[tuple[bool, str], list[Mutant]]:
    """Return mutants of files whose name has ``only`` in it, sorted in by whether it is a table, and by part.

    ``number`` of them are drawn by chance, 0: all.
    """
    drawn = [
        (part, mutant) for part, found in all_mutants().items() for mutant in found if only in mutant.file
    ]
    random.Random(seed).shuffle(drawn)
    sorted_in: dict[tuple[bool, str], list[Mutant]] = {
        (last, part): [] for last in (False, True) for part in TESTS
    }
    for part, mutant in drawn[:number] if number else drawn:
        sorted_in[mutant.file.endswith(TABLES), part].append(mutant)
    return sorted_in


def run(part: str, waiting: list[Mutant], results: Results, end_s: float) -> None:
    """Try mutants of a part until all are tried or the time is over."""
    known = [(mutant, results.of(mutant)) for mutant in all_mutants()[part]]

    def try_all(trials: Trials) -> None:
        for mutant, result in known:
            if result is not None and result.fate in TESTED:
                trials.remember(mutant, result.test)
        for number, mutant in enumerate(waiting, start=1):
            if time.monotonic() > end_s:
                return
            results.add(verdict := trials.verdict_of(mutant))
            if verdict.fate in {SURVIVED, UNTRIED}:
                print(f"[{number}/{len(waiting)}] {verdict.fate}  {mutant}", flush=True)

    with_tests(part, try_all)


def report(results: list[Result]) -> None:
    """Print a line for each file and one for all."""
    print(f"\n{'file':36}{'mutants':>9}{'no fault':>10}{'found':>8}{'survived':>10}{'score':>8}{'CPU s':>8}")
    for name in [*sorted({result.file for result in results}), ""]:
        of_file = [result for result in results if name in {result.file, ""}]
        fates = Counter(result.fate for result in of_file)
        no_fault, survived = sum(fates[fate] for fate in NO_FAULT), fates[SURVIVED]
        found = len(of_file) - no_fault - survived
        score = 100.0 * found / max(1, found + survived)
        cpu_s = sum(result.cpu_s for result in of_file)
        print(
            f"{name or 'all':36}{len(of_file):9}{no_fault:10}{found:8}{survived:10}{score:7.1f}%{cpu_s:8.0f}"
        )
    print(", ".join(f"{number} {fate}" for fate, number in fates.most_common()))


def main() -> int:
    """Run; exit code 1 when less than ``--least`` percent were found."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__)
    parser.add_argument("--mutants", type=int, default=0, help="so many of them, drawn by chance; 0: all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--minutes", type=float, default=24.0 * 60.0, help="try no more of them after this time"
    )
    parser.add_argument("--only", default="", help="part of a file's name, core/fs_mixer.c for instance")
    parser.add_argument(
        "--again", default=UNTRIED, help="try mutants of this fate again: survived, for instance"
    )
    parser.add_argument(
        "--results", type=Path, help="file of results; default: one for the present sources and tests"
    )
    parser.add_argument("--least", type=float, default=0.0, help="percent that must be found")
    given = parser.parse_args()
    results, end_s = (
        Results(given.results or path_for_present_tests()),
        time.monotonic() + 60.0 * given.minutes,
    )
    sample = chosen(given.only, given.mutants, given.seed)
    for (is_table, part), mutants_of_part in sample.items():
        known = ((mutant, results.of(mutant)) for mutant in mutants_of_part)
        waiting = [mutant for mutant, result in known if result is None or result.fate == given.again]
        if waiting and time.monotonic() < end_s:
            print(f"{part}{', tables' if is_table else ''}: {len(waiting)} mutants to try", flush=True)
            run(part, waiting, results, end_s)
    tried = [result for found in sample.values() for m in found if (result := results.of(m)) is not None]
    report(tried)
    counted = [result for result in tried if result.fate not in NO_FAULT]
    killed = sum(result.fate != SURVIVED for result in counted)
    untried = any(result.fate == UNTRIED for result in tried)
    return int(untried or 100.0 * killed < given.least * len(counted))


if __name__ == "__main__":
    sys.exit(main())
