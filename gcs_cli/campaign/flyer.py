"""Fly planned flights in worker processes, and write each row to the journal as soon as its flight is over."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Generator, Sequence
from typing import Protocol

from flightstack.core.errors import ConfigError
from flightstack.testing.scenario import check_scenario
from gcs_cli.campaign.definition import Campaign
from gcs_cli.campaign.display import Display
from gcs_cli.campaign.journal import Journal
from gcs_cli.campaign.options import CampaignOptions, continuing, only_command
from gcs_cli.campaign.plan import PlannedFlight
from gcs_cli.campaign.rows import row_of
from gcs_cli.errors import NO_ANSWER, CliError
from gcs_cli.scenarios.pool import Cases, Finished, Message, Notice, Started
from gcs_cli.scenarios.result import Wanted
from gcs_cli.scenarios.selection import Case

_RATES = ("inner_hz", "outer_hz")
WANTED = Wanted(metrics=True)
"""What each flight of a campaign returns besides the verdict."""


class LostWorkerError(CliError):
    """A process ended that flew a flight."""


class SchedulerLostError(CliError):
    """The scheduler of a cluster was lost: no more cases can be flown."""


class FlightPool(Protocol):
    """Workers that fly cases: of this machine or of a cluster."""

    def fly(self, cases: Cases, wanted: Wanted) -> Generator[Message, None, None]:
        """Fly the cases and yield their events; end all flights if the iterator is closed."""


class _Cases:
    """The cases of flights, each made when it is flown: a campaign may have a million."""

    def __init__(
        self, campaign: Campaign, flights: Sequence[PlannedFlight], options: CampaignOptions
    ) -> None:
        self._campaign, self._flights, self._options = campaign, flights, options

    def __len__(self) -> int:
        return len(self._flights)

    def __getitem__(self, index: int) -> Case:
        return case_of(self._campaign, self._flights[index], self._options)


class Flyer:
    """Flies what the journal does not have yet."""

    def __init__(
        self,
        pool: FlightPool,
        campaign: Campaign,
        journal: Journal,
        display: Display,
        options: CampaignOptions,
    ) -> None:
        self._pool, self._campaign, self._journal = pool, campaign, journal
        self._display, self._options = display, options
        self._has_noted = False

    def fly(self, flights: Sequence[PlannedFlight]) -> None:
        """Fly all of ``flights`` that are not over; raise LostWorkerError after the others, ConfigError, OSError."""
        missing = [flight for flight in flights if flight.number not in self._journal.rows]
        cases = _Cases(self._campaign, missing, self._options)
        try:
            lost = self._fly(missing, cases)
        except SchedulerLostError as error:
            over = f"{len(self._journal.rows)} flights are over"
            remedy = f"{continuing(self._options)} continues, also without --scheduler"
            raise SchedulerLostError(f"{error}: {over}; {remedy}", NO_ANSWER) from None
        for number, reason in lost:
            raise LostWorkerError(f"flight {number}: {reason}; {continuing(self._options)} flies it again")

    def _fly(self, missing: Sequence[PlannedFlight], cases: Cases) -> list[tuple[int, str]]:
        """Return number and reason of each flight that was lost."""
        lost: list[tuple[int, str]] = []
        with contextlib.closing(self._pool.fly(cases, WANTED)) as messages:
            for message in messages:
                if isinstance(message, Started):
                    self._display.begin(missing[message.case].number)
                elif isinstance(message, Finished) and message.result is None:
                    lost.append((missing[message.case].number, message.reason))
                    self._display.lose(*lost[-1])
                elif isinstance(message, Finished):
                    self._add(missing[message.case], message)
                elif isinstance(message, Notice):
                    self._note(message)
                else:
                    self._display.tick()
        return lost

    def _add(self, flight: PlannedFlight, finished: Finished) -> None:
        assert finished.result is not None
        row = row_of(flight, finished.result)
        self._journal.add(row)
        if self._options.as_json:
            print(json.dumps({"event": "flight", **row}, allow_nan=False), flush=True)
        self._display.add(row)

    def _note(self, notice: Notice) -> None:
        """Show a line, of those that each worker has the first one."""
        if notice.is_common and self._has_noted:
            return
        self._has_noted |= notice.is_common
        self._display.note(notice.line)


def case_of(campaign: Campaign, flight: PlannedFlight, options: CampaignOptions) -> Case:
    """Return what a worker flies; raise ConfigError for inputs out of their range."""
    scenario = campaign.scenario(flight.inputs)
    return Case(scenario, flight.seed, f"flight-{flight.number}", only_command(options, flight.number))


def check_flights(campaign: Campaign, flights: Sequence[PlannedFlight]) -> None:
    """Check all combinations of choices and rates, and the extremes of each other input.

    A number between two that are allowed is allowed, but for rates, of which one must divide the other; that of a grid
    may be no whole number. Raise ConfigError: a wrong file ends before anything flies.
    """
    vary = campaign.vary
    together = [name for name, distribution in vary.items() if distribution.is_choice or name in _RATES]
    combinations = {tuple(flight.inputs[name] for name in together): flight for flight in flights}
    checked = {flight.number: flight for flight in combinations.values()}
    read: dict[int, PlannedFlight] = {}
    for name in (name for name in vary if name not in together):
        ends = (select(flights, key=lambda flight: flight.inputs[name]) for select in (min, max))
        checked |= {flight.number: flight for flight in ends}
        if vary[name].steps is not None:
            each = {flight.inputs[name]: flight for flight in flights}.values()
            read |= {flight.number: flight for flight in each}
    for number, flight in sorted((read | checked).items()):
        try:
            scenario = campaign.scenario(flight.inputs)
            if number in checked:
                check_scenario(scenario)
        except ConfigError as error:
            if _refused(campaign) == str(error):
                raise  # without inputs too
            inputs = ", ".join(
                f"{name} {value:g}" if isinstance(value, float) else f"{name} {value}"
                for name, value in flight.inputs.items()
            )
            problem = str(error).removeprefix(f"{campaign.path}: ")
            raise ConfigError(campaign.path, f"vary, flight {number} ({inputs})", problem) from None


def _refused(campaign: Campaign) -> str:
    """Return the reason why the scenario cannot be flown without inputs, or nothing."""
    try:
        check_scenario(campaign.scenario({}))
    except ConfigError as error:
        return str(error)
    return ""
