"""Print the speeds of the project beside their floors: ``python -m benchmarks [--quick] [--json FILE]``."""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks import (
    campaigns,
    emulated,
    ground_load,
    one_process,
    peers,
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


class Measurement(NamedTuple):
    """Figures under ``key``; ``quick`` and ``whole`` are the arguments of ``measure``."""

    section: str
    key: str
    name: str
    measure: Callable[..., Any]
    quick: tuple[Any, ...]
    whole: tuple[Any, ...]


def _flights(count: int) -> Any:
    return three_processes.flights(three_processes.CASES, count)


MEASUREMENTS = (
    Measurement("steps", "round_trips", "round trips", round_trip.round_trips, (2, 0.2), (5, 0.5)),
    Measurement("steps", "costs", "the parts of a step", step_costs.costs, (2, 0.01), (7, 0.05)),
    Measurement("flights", "one_process", "flights in one process", one_process.flights, (2,), (7,)),
    Measurement("flights", "three_processes", "flights of three processes", _flights, (2,), (7,)),
    Measurement("campaigns", "campaigns", "flights of campaigns", campaigns.campaigns, (2, 0.25), (4, 1.0)),
    Measurement(
        "emulated", "emulated", "flights with loops on an emulated processor", emulated.flights, (1,), (3,)
    ),
    Measurement("multibody", "plants", "flights with each plant", plants.plants, (2, 0.01), (5, 0.05)),
    Measurement("realtime", "lateness", "lateness in real time", real_time.lateness, (2.0,), (10.0,)),
    Measurement(
        "load",
        "load",
        "ground stations, noise and clients that never read",
        ground_load.loads,
        (2.0, 1),
        (5.0, 3),
    ),
    Measurement(
        "transfers", "transfers", "transfers of plans and parameters", transfers.transfers, (2,), (5,)
    ),
    Measurement("start", "start", "the start of each process", three_processes.start_ups, (1,), (5,)),
    Measurement("startup", "startup", "commands of gcs", startup.startup, (3,), (20,)),
    Measurement("watch", "watch", "the screens of gcs watch", watching.watching, (1, 3.0), (3, 10.0)),
)
SECTIONS = tuple(dict.fromkeys(each.section for each in MEASUREMENTS))
_LONG = ("watch",)
"""Sections that run only if selected."""


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few and short rounds: about a minute")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all figures to FILE too")
    parser.add_argument("--only", choices=SECTIONS, action="append", help="measure only this (repeatable)")
    parser.add_argument(
        "--against",
        type=peers.peers_of,
        metavar="NAME=PATH,…",
        help="fly in turns with the builds in checkouts of ardupilot and px4, and with the packages of rotorpy, "
        "pybullet_drones and jax, each by the Python that has it; only this without --only",
    )
    return parser.parse_args()


def main() -> int:
    """Measure and print; return the exit code."""
    arguments = _arguments()
    ordinary = [section for section in SECTIONS if section not in _LONG and not arguments.against]
    wanted = arguments.only or ordinary
    load = OtherLoad()
    results: dict[str, Any] = {}
    for each in MEASUREMENTS:
        if each.section in wanted:
            print(f"measuring {each.name} …", file=sys.stderr, flush=True)
            results[each.key] = each.measure(*(each.quick if arguments.quick else each.whole))
    if arguments.against:
        print("measuring flights in turns with other programs …", file=sys.stderr, flush=True)
        results["peers"] = peers.flights(arguments.against, 2 if arguments.quick else 7)
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
