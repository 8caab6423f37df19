"""Records of targets, and facts of comparisons, for tests of verdicts."""

from __future__ import annotations

from typing import Any

import numpy as np

from gcs_cli.pil.target_record import TargetRecord, record_of

IDENTITY = {
    "board": "a <board>",
    "compiler": "cc & co",
    "source_hash": "0123456789abcdef",
    "cost_unit": "instructions",
    "clock_hz": 0,
    "real_octets": 4,
    "char_bits": 8,
}


STATUS = {
    "time_boot_ms": 90_000,
    "steps": 2,
    "uart_overruns": 77,
    "safe_states": 0,
    "loop_overruns": 0,
    "stack_size": 4096,
    "stack_high_water": 876,
    "state": 0,
}
"""Before the flight: of the flights before."""


FACTS: dict[str, Any] = {
    "title": "<hop>: MIL & PIL",
    "about": "vehicle x · target emulated",
    "meaning": "What it shows.",
    "conditions": {"seed": 1, "plan": "a<b.plan"},
}


def record(steps: int = 9, told: bool = True, statuses: tuple[int, ...] = (), **counted: int) -> TargetRecord:
    """``counted`` in the flight; ``statuses`` of the first steps, 0 of the others."""
    costs = np.array([[700.0 * (row % 5 == 0), 650.0, 430.0, 1200.0 + row] for row in range(steps)])
    link = {"operations": steps, "resent": 5, "late": 2}
    trips = {"min": 1e-4, "mean": 2e-4, "median": 2e-4, "p99": 3e-4, "max": 4e-4}
    after = {name: (value + counted.get(name, 0)) % 2**32 for name, value in STATUS.items()}
    content = {"identity": IDENTITY, "link": link, "round_trip_s": trips, "status_at_start": STATUS}
    flags = np.array([*statuses, *[0] * steps][:steps])
    return record_of({**content, "status": after if told else None, "ending": None}, costs, flags)
