"""Fly randomly chosen scenarios beside a busy process per core, and compare each log with that of a quiet run.

python -m tools.repeat_scenarios --flights 5000 tests/scenarios/files missions
"""

from __future__ import annotations

import argparse
import hashlib
import multiprocessing
import os
import sys
import time
from pathlib import Path
from random import Random
from typing import NamedTuple

from flightstack.testing import is_scenario, load_scenario, run_scenario
from tools.beside_load import busy


class Flown(NamedTuple):
    """One flight: its scenario, whether it met its expectations, and the SHA-256 of its log."""

    path: Path
    passed: bool
    sha256: str


def fly(path: Path) -> Flown:
    """Fly the first seed of a scenario."""
    verdict = run_scenario(load_scenario(path))
    return Flown(path, verdict.passed, hashlib.sha256(verdict.flight.log.content).hexdigest())


def main() -> int:
    """Fly, and print the number of flights that failed or differ; return 1 if there is one."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("paths", type=Path, nargs="+")
    parser.add_argument("--flights", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--without", default="long", help="folder that is left out")
    given = parser.parse_args()
    found = sorted(path for folder in given.paths for path in folder.rglob("*.toml") if is_scenario(path))
    paths = [path for path in found if given.without not in path.parts]
    cores = os.cpu_count() or 1
    with multiprocessing.get_context("spawn").Pool(cores) as pool:
        quiet = {flown.path: flown for flown in pool.imap_unordered(fly, paths)}
        chosen = Random(given.seed).choices(paths, k=given.flights)
        began_s, bad = time.monotonic(), 0
        with busy():
            for flown in pool.imap_unordered(fly, chosen):
                if not flown.passed or flown != quiet[flown.path]:
                    bad += 1
                    print(f"{flown.path}: passed {flown.passed}, {flown.sha256[:12]}", flush=True)
    print(
        f"{given.flights} flights of {len(paths)} scenarios beside {cores} busy processes: {bad} failed or differ "
        f"({time.monotonic() - began_s:.0f} s, seed {given.seed})"
    )
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
