"""The content of results.json, without wall-clock times and host names. Pure.

The same command on the same machine writes the same bytes. Another processor or other versions of the numerical
libraries may change the last digits of the flights, and more where a loop amplifies rounding. The linear analysis is
rounded to ten digits.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from flightstack import __version__
from gcs_cli.experiments.paper.findings import comparisons, plants
from gcs_cli.experiments.paper.findings.claims import claims
from gcs_cli.experiments.paper.findings.printed_values import CORRECTIONS, Entry, table_1, table_2, table_3
from gcs_cli.experiments.paper.flights.cases import CONDITIONS, CONTENDERS
from gcs_cli.experiments.paper.flights.experiments import Flown
from gcs_cli.experiments.paper.flights.trajectory import load_trajectory

FORMAT = 1


def results_of(flown: Flown, left_out: Mapping[str, str]) -> dict[str, Any]:
    """Return the results of the flights; ``linear``, ``onset`` and ``pil`` are added later.

    ``left_out`` has the reason for each missing part, by its name.
    """
    names = sorted({entry["trajectory"] for entry in flown.entries.values()})
    return {
        "format": FORMAT,
        "version": __version__,
        "vehicle": _table(table_1()),
        "gains": {"table_2": _table(table_2()), "table_3": _table(table_3())},
        "corrections": [correction._asdict() for correction in CORRECTIONS],
        "contenders": {contender.name: contender._asdict() for contender in CONTENDERS},
        "conditions": {condition.name: condition.label for condition in CONDITIONS},
        "trajectories": {name: _about(name) for name in names},
        "cases": flown.entries,
        "comparisons": {"claims": claims(flown.entries, {}), "xy": comparisons.xy(flown.entries)},
        "plants": plants.comparisons(flown.recordings),
        "plants_elsewhere": plants.other_trajectories(flown.recordings),
        "linear": {},
        "onset": [],
        "pil": {},
        "left_out": dict(left_out),
    }


def _table(entries: list[Entry]) -> dict[str, Any]:
    return {entry.symbol: {**entry._asdict(), "corrected": entry.corrected} for entry in entries}


def _about(name: str) -> dict[str, Any]:
    trajectory = load_trajectory(name)
    return {
        "description": trajectory.description,
        "kind": trajectory.kind,
        "duration_s": trajectory.duration_s,
        "moves": [move._asdict() for move in trajectory.moves],
    }


def text_of(results: Mapping[str, Any]) -> str:
    """Return results.json as text: floats in full, keys in the order of the results; raise ValueError for NaN."""
    return json.dumps(results, indent=1, allow_nan=False, ensure_ascii=False) + "\n"
