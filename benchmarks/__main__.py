"""Print the speeds of the project beside their floors: ``python -m benchmarks [--quick] [--json FILE]``."""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from benchmarks import (
    emulated,
    ground_load,
    one_process,
    plants,
    real_time,
    report,
    round_trip,
    startup,
    step_costs,
    three_processes,
    transfers,
    watching,
)
from benchmarks.measure import OtherLoad

SECTIONS = (
    "steps",
    "flights",
    "emulated",
    "multibody",
    "realtime",
    "load",
    "transfers",
    "start",
    "startup",
    "watch",
)

_LONG = ("watch",)
"""Sections that run only if selected."""


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few and short rounds: half a minute")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all figures to FILE too")
    parser.add_argument("--only", choices=SECTIONS, action="append", help="measure only this (repeatable)")
    return parser.parse_args()


def _measured(name: str, measure: Callable[[], Any]) -> Any:
    print(f"measuring {name} …", file=sys.stderr, flush=True)
    return measure()


def main() -> int:
    """Measure and print; return the exit code."""
    arguments = _arguments()
    wanted = arguments.only or [section for section in SECTIONS if section not in _LONG]
    quick = arguments.quick
    rounds, seconds = (2, 0.01) if quick else (7, 0.05)
    load = OtherLoad()
    results: dict[str, Any] = {}
    if "steps" in wanted:
        results["round_trips"] = _measured(
            "round trips", lambda: round_trip.round_trips(min(rounds, 5), 0.2 if quick else 0.5)
        )
        results["costs"] = _measured("the parts of a step", lambda: step_costs.costs(rounds, seconds))
    if "flights" in wanted:
        results["one_process"] = _measured(
            "flights in one process", lambda: one_process.flights(2 if quick else 7)
        )
        results["three_processes"] = _measured(
            "flights of three processes",
            lambda: three_processes.flights(three_processes.CASES, 2 if quick else 7),
        )
    if "emulated" in wanted:
        results["emulated"] = _measured(
            "flights with loops on an emulated processor", lambda: emulated.flights(1 if quick else 3)
        )
    if "multibody" in wanted:
        results["plants"] = _measured(
            "flights with each plant", lambda: plants.plants(2 if quick else 5, seconds)
        )
    if "realtime" in wanted:
        results["lateness"] = _measured(
            "lateness in real time", lambda: real_time.lateness(2.0 if quick else 10.0)
        )
    if "load" in wanted:
        results["load"] = _measured(
            "ground stations, noise and clients that never read",
            lambda: ground_load.loads(2.0 if quick else 5.0, 1 if quick else 3),
        )
    if "transfers" in wanted:
        results["transfers"] = _measured(
            "transfers of plans and parameters", lambda: transfers.transfers(2 if quick else 5)
        )
    if "start" in wanted:
        results["start"] = _measured(
            "the start of each process", lambda: three_processes.start_ups(1 if quick else 5)
        )
    if "startup" in wanted:
        results["startup"] = _measured("commands of gcs", lambda: startup.startup(3 if quick else 20))
    if "watch" in wanted:
        results["watch"] = _measured(
            "the screens of gcs watch", lambda: watching.watching(*((1, 3.0) if quick else (3, 10.0)))
        )
    machine = {
        "system": f"{platform.system()} {platform.machine()}",
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "used_by_others": round(load.share(), 3),
    }
    for text in report.texts(results, machine):
        print(text)
    if arguments.json is not None:
        plain = report.plain(results)
        arguments.json.write_text(json.dumps({"machine": machine, **plain}, indent=1) + "\n", "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
