"""Flights in one process, in turns with those of another checkout: python -m benchmarks.against DIRECTORY [ROUNDS]

Each checkout flies in a process of its own, which stays. The ratio is that of the processor times of two flights made
one after the other, so that other load on the machine counts little.
"""

from __future__ import annotations

import argparse
import math
import os
import subprocess
import sys
import time
from pathlib import Path

from benchmarks.measure import Figure, figure, short
from benchmarks.one_process import VARIANTS, Variant, flying
from benchmarks.table import table

ROUNDS = 30
_HERE = Path(__file__).resolve().parents[1]


def flown(variant: Variant) -> float:
    """Return the real-time factor of a flight, in processor time."""
    world = flying(variant.log, variant.station, *variant[3:])  # older checkouts fly on the true state alone
    began_s, simulated_s = time.process_time(), world.time_s
    world.run_until("not armed")
    return (world.time_s - simulated_s) / (time.process_time() - began_s)


def serve() -> None:
    """Fly the variant whose name each line of standard input has; answer with its factor, NaN for an unknown one."""
    by_name = {variant.name: variant for variant in VARIANTS}
    for line in sys.stdin:
        variant = by_name.get(line.strip())
        print(math.nan if variant is None else flown(variant), flush=True)


class Checkout:
    """A process that flies the code of a directory, with the flights of this file."""

    def __init__(self, directory: Path) -> None:
        program = f"import runpy, sys; sys.argv[1:] = ['--serve']; runpy.run_path({__file__!r}, run_name='__main__')"
        self._process = subprocess.Popen(
            [sys.executable, "-c", program],
            cwd=directory,
            env={**os.environ, "PYTHONPATH": str(directory)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def fly(self, variant: Variant) -> float:
        """Fly once; return the real-time factor."""
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin is not None
        assert stdout is not None
        print(variant.name, file=stdin, flush=True)
        return float(stdout.readline())

    def close(self) -> None:
        """End the process."""
        self._process.communicate()


def compared(other: Path, rounds: int) -> dict[str, tuple[Figure, Figure, Figure]]:
    """Return the factors of both checkouts, and their ratio, of each variant."""
    ours, theirs = Checkout(_HERE), Checkout(other)
    results = {}
    try:
        for variant in VARIANTS:
            seen: list[tuple[float, float]] = []
            for number in range(rounds + 1):
                first, second = (ours, theirs) if number % 2 else (theirs, ours)
                pair = {first: first.fly(variant), second: second.fly(variant)}
                seen.append((pair[ours], pair[theirs]))
            del seen[0]  # it loads the kernels
            ratios = figure(mine / other for mine, other in seen)
            results[variant.name] = figure(mine for mine, _ in seen), figure(it for _, it in seen), ratios
    finally:
        ours.close()
        theirs.close()
    return results


def main() -> None:
    """Compare with the checkout that the command line names."""
    if sys.argv[1:] == ["--serve"]:
        serve()
        return
    parser = argparse.ArgumentParser(prog="python -m benchmarks.against", description=__doc__)
    parser.add_argument("directory", type=Path, help="another checkout, with flightstack/testing/world.py")
    parser.add_argument(
        "rounds", nargs="?", type=int, default=ROUNDS, help="flights of each (default %(default)s)"
    )
    given = parser.parse_args()
    other, rounds = given.directory.resolve(), given.rounds
    if not (other / "flightstack" / "testing" / "world.py").is_file():
        parser.error(f"{other} is no checkout that can be compared: flightstack/testing/world.py is missing")
    rows = [
        (name, ours.text(), theirs.text(), short(ratio.median))
        for name, (ours, theirs, ratio) in compared(other, rounds).items()
    ]
    head = ("one process, 500 Hz, × processor time", "here", "there", "median ratio")
    print(table(f"AGAINST {other}", head, rows))


if __name__ == "__main__":
    main()
