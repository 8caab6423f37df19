"""Flights of ``gcs campaign`` at 500 Hz with warm kernels: processor time of one, and how many a minute 2 workers fly.

Alone: ``python -m benchmarks --only campaigns``. The flights are the first ones of ``campaign_truth.toml`` and
``campaign_sensors.toml``. The workers' flights include all that grows with their number: the process boundary, row and
journal; not the start of the workers, the table and the report.
"""

from __future__ import annotations

import io
import itertools
import math
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from rich.console import Console

from benchmarks.measure import Figure, figure
from benchmarks.peer_error import PeerError
from gcs_cli.campaign.definition import Campaign, load_campaign
from gcs_cli.campaign.display import make_display
from gcs_cli.campaign.flyer import WANTED, Flyer, case_of
from gcs_cli.campaign.journal import Journal, open_journal, record_of
from gcs_cli.campaign.options import CampaignOptions
from gcs_cli.campaign.plan import PlannedFlight, plan_flights
from gcs_cli.scenarios.flying import fly_case
from gcs_cli.scenarios.pool import Pool

WORKERS = 2
_DURATION = "duration_s"
"""The metric that is the simulated time from arming to disarming."""


class Kind(NamedTuple):
    """A campaign, and how many of its flights are timed at once."""

    name: str
    file: Path
    flights: int


class Flown(NamedTuple):
    """Speeds of a campaign's flights."""

    factor: Figure
    """Simulated time for the processor time of one flight alone, × real time."""
    flights_a_minute: Figure
    """Flights of 60 s in a minute of wall time, by ``WORKERS`` workers."""


_FOLDER = Path(__file__).parent
TRUTH = Kind("truth", _FOLDER / "campaign_truth.toml", 20)
SENSORS = Kind("sensors and estimator", _FOLDER / "campaign_sensors.toml", 4)
KINDS = (TRUTH, SENSORS)


class Flights:
    """The flights of a campaign, one after the other in this process, as a worker flies them."""

    def __init__(self, kind: Kind) -> None:
        self.campaign = load_campaign(kind.file)
        self.planned = plan_flights(self.campaign)
        self.options = CampaignOptions(kind.file)
        self._numbers = itertools.cycle(range(len(self.planned)))

    def fly(self) -> float:
        """Fly the next one; return its real-time factor by processor time."""
        case = case_of(self.campaign, self.planned[next(self._numbers)], self.options)
        began_s = time.process_time()
        result = fly_case(case, WANTED)
        spent_s = time.process_time() - began_s
        if not result.passed:
            raise PeerError(f"{case.label}: {result.failures[0]}")
        return result.duration_s / spent_s


class Workers:
    """Worker processes of a campaign, which stay."""

    def __init__(self, pool: Pool) -> None:
        self._pool = pool

    def fly(self, flights: Flights, count: int) -> float:
        """Fly the first ``count`` flights, with a journal of their own; return simulated time by wall time.

        That is as well how many flights of 60 s they fly in a minute.
        """
        planned, options = flights.planned[:count], flights.options
        with _new_journal(flights.campaign, planned) as journal:
            display = make_display(Console(file=io.StringIO()), count, ())
            flyer = Flyer(self._pool, flights.campaign, journal, display, options)
            began_s = time.perf_counter()
            flyer.fly(planned)
            wall_s = time.perf_counter() - began_s
            display.close()
            return math.fsum(row["metrics"][_DURATION] for row in journal.rows.values()) / wall_s


@contextmanager
def _new_journal(campaign: Campaign, planned: Sequence[PlannedFlight]) -> Iterator[Journal]:
    record = record_of("plan", campaign.path, campaign.files(flight.inputs for flight in planned), planned)
    with tempfile.TemporaryDirectory() as folder, open_journal(Path(folder), record) as journal:
        yield journal


def campaigns(rounds: int, share: float) -> dict[str, Flown]:
    """Fly each campaign in every round; the workers fly this share of ``Kind.flights``."""
    factors: dict[str, list[float]] = {kind.name: [] for kind in KINDS}
    rates: dict[str, list[float]] = {kind.name: [] for kind in KINDS}
    with Pool(WORKERS) as pool:
        workers, flown = Workers(pool), {kind: Flights(kind) for kind in KINDS}
        for number in range(rounds + 1):
            for kind, flights in flown.items():
                factor = flights.fly()
                rate = workers.fly(flights, max(WORKERS, round(share * kind.flights) if number else WORKERS))
                if number:  # the first round loads the kernels
                    factors[kind.name].append(factor)
                    rates[kind.name].append(rate)
    return {kind.name: Flown(figure(factors[kind.name]), figure(rates[kind.name])) for kind in KINDS}
