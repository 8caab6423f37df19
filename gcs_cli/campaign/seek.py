"""``gcs campaign --seek worst``: fly a search, write its table and its report."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence

import numpy as np
from rich.console import Console

from flightstack.core.atomic_file import write_text_atomically
from flightstack.core.contract import FloatArray
from flightstack.core.errors import ConfigError, plain
from flightstack.testing.scenario import check_scenario
from gcs_cli.campaign.definition import Campaign
from gcs_cli.campaign.display import inputs_text, make_display
from gcs_cli.campaign.figures import map_figure
from gcs_cli.campaign.flyer import FlightPool, Flyer
from gcs_cli.campaign.journal import REPORT, Journal, open_journal, record_of
from gcs_cli.campaign.options import CampaignOptions, continuing, only_command
from gcs_cli.campaign.page import render_campaign
from gcs_cli.campaign.plan import PlannedFlight, flight_seed
from gcs_cli.campaign.rows import Row
from gcs_cli.campaign.search import Flown, Search, box_ends, fewest_flights, search
from gcs_cli.campaign.statistics import sensitivities
from gcs_cli.campaign.table import write_tables
from gcs_cli.charts.figure import Figure
from gcs_cli.errors import DONE, FAILED, INTERRUPTED, USAGE, CliError
from gcs_cli.run_directory import results_directory

_DEFAULT_FLIGHTS = 200


def run_search(pool: FlightPool, campaign: Campaign, options: CampaignOptions, console: Console) -> int:
    """Search and report; return 0 if nothing fails, else 1. Raise ConfigError, CliError."""
    nominal = nominal_point(campaign)
    for point in (nominal, *box_ends(nominal)):
        check_scenario(campaign.scenario(_inputs(campaign, point)))
    flights = options.flights or _DEFAULT_FLIGHTS
    if flights < (fewest := fewest_flights(nominal)):
        raise CliError(
            f"--flights: {flights} is too few for the inputs of {campaign.path}: give at least {fewest}",
            USAGE,
        )
    marker = PlannedFlight(flights, campaign.plan.seed, _inputs(campaign, nominal))
    record = record_of("seek", campaign.path, campaign.files([marker.inputs]), [marker])
    with (
        results_directory(options.folder),
        open_journal(options.folder, record, options.overwrite) as journal,
    ):
        display = make_display(console, flights, journal.rows.values())
        evaluation = _Evaluation(campaign, journal, Flyer(pool, campaign, journal, display, options))
        try:
            found = search(evaluation.fly, nominal, flights, campaign.plan.seed)
        except KeyboardInterrupt:
            over = f"{journal.count()} flights are over"
            raise CliError(f"interrupted: {over}; {continuing(options)} continues", INTERRUPTED) from None
        finally:
            display.close()
        journal.check_unchanged(record_of("seek", campaign.path, campaign.files([marker.inputs]), [marker]))
        rows = [journal.rows[each.number] for each in found.flown]
    sentences = list(_sentences(campaign, found, journal, options))
    write_tables(options.folder, rows, options.csv)
    figures = [] if (figure := _map(campaign, found, rows, journal)) is None else [figure]
    page = render_campaign(campaign, rows, options, figures, sentences)
    write_text_atomically(options.folder / REPORT, page)
    _print(found, sentences, options, console)
    return DONE if found.smallest is None else FAILED


def nominal_point(campaign: Campaign) -> FloatArray:
    """Return the point without variation; raise ConfigError for inputs that cannot be searched."""
    shares = []
    for name, distribution in campaign.vary.items():
        if distribution.is_choice:
            raise ConfigError(campaign.path, f"vary.{name}", "is a choice: --seek worst searches ranges")
        value = campaign.nominal(name)
        if value is None:
            raise ConfigError(
                campaign.path, f"vary.{name}.nominal", "is missing: --seek worst searches from there"
            )
        low, high = distribution.ends
        if not low <= value <= high:
            span = f"{plain(low)} to {plain(high)}"
            problem = f"{plain(value)}, from which --seek worst searches, is outside the range {span}"
            raise ConfigError(campaign.path, f"vary.{name}", f"{problem}: give another range, or nominal")
        shares.append(distribution.share_of(value))
    return np.array(shares)


class _Evaluation:
    """Flies points in the order of the search, whose flights are numbered from 1."""

    def __init__(self, campaign: Campaign, journal: Journal, flyer: Flyer) -> None:
        self._campaign, self._journal, self._flyer = campaign, journal, flyer
        self._seed = flight_seed(campaign.plan.seed, 1)  # equal for all: margins differ by the inputs alone
        self._next = 1

    def fly(self, points: Sequence[FloatArray]) -> list[Flown]:
        """Fly points; those of an earlier run of this search are in the journal."""
        numbers = range(self._next, self._next + len(points))
        self._next = numbers.stop
        flights = [
            PlannedFlight(number, self._seed, _inputs(self._campaign, point))
            for number, point in zip(numbers, points, strict=True)
        ]
        self._flyer.fly(flights)
        for flight in flights:
            if self._journal.rows[flight.number]["inputs"] != flight.inputs:
                problem = "is of another version of the search: give another --out, or --overwrite"
                raise CliError(f"flight {flight.number} {problem}", USAGE)
        rows = [self._journal.rows[number] for number in numbers]
        return [
            Flown(point, row["robustness"], row["passed"], row["flight"])
            for point, row in zip(points, rows, strict=True)
        ]


def _inputs(campaign: Campaign, point: FloatArray) -> dict[str, float | str | bool]:
    return {
        name: distribution.at(float(share))
        for (name, distribution), share in zip(campaign.vary.items(), point, strict=True)
    }


def _sentences(
    campaign: Campaign, found: Search, journal: Journal, options: CampaignOptions
) -> Iterator[str]:
    """Yield what the search found."""
    if not found.nominal.passed:
        reason = "; ".join(journal.rows[found.nominal.number]["failed"])
        yield f"the flight without variation fails already: {reason}"
        return
    for index, name in enumerate(campaign.vary):
        yield f"{name} alone: {_alone(name, found, index, journal)}"
    worst = journal.rows[found.worst.number]
    closest = f"{100.0 * worst['robustness']:.1f} % of its limit, {worst['closest'] or worst['outcome']}"
    yield f"least margin: {closest}, with {inputs_text(worst)} (flight {worst['flight']})"
    if found.smallest is None:
        seed = f"seed {worst['seed']}"
        yield f"no flight of {len(found.flown)} fails, all with {seed}: other gusts and noise may be worse"
        return
    row = journal.rows[found.smallest.number]
    size = f"{100.0 * found.size(found.smallest):.0f} % of the range"
    yield f"smallest variation that fails: {size}, with {inputs_text(row)}: {'; '.join(row['failed'])}"
    yield f"all flights have seed {row['seed']}: with other gusts and noise less may fail"
    yield f"repeat: {only_command(options, row['flight'])}"


def _alone(name: str, found: Search, index: int, journal: Journal) -> str:
    found_edges = [
        tuple(journal.rows[each.number]["inputs"][name] for each in (ray.passes, ray.fails))
        for ray in found.alone(index)
    ]
    above = [edge for edge in found_edges if edge[1] > edge[0]]
    below = [edge for edge in found_edges if edge[1] <= edge[0]]
    edges = []
    if above:  # of several searches the narrowest interval
        passes, fails = max(edge[0] for edge in above), min(edge[1] for edge in above)
        edges.append(f"fails from {fails:.4g}, passes at {passes:.4g}")
    if below:
        passes, fails = min(edge[0] for edge in below), max(edge[1] for edge in below)
        edges.append(f"fails down from {fails:.4g}, passes at {passes:.4g}")
    return "; ".join(edges) or "passes at both ends of its range"


def _map(campaign: Campaign, found: Search, rows: Sequence[Row], journal: Journal) -> Figure | None:
    """Return the boundary over the two inputs that matter most; None for a single input."""
    names = list(campaign.vary)
    if len(names) < 2:
        return None
    by_influence = [each.name for each in sensitivities(rows)]
    first, second = [*by_influence, *(name for name in names if name not in by_influence)][:2]
    shown = [names.index(first), names.index(second)]
    others = [index for index in range(len(names)) if index not in shown]
    edge = [
        ray.fails
        for ray in found.rays
        if np.array_equal(ray.fails.point[others], found.nominal.point[others])
    ]
    return map_figure(rows, first, second, [journal.rows[each.number] for each in edge])


def _print(found: Search, sentences: Sequence[str], options: CampaignOptions, console: Console) -> None:
    if options.as_json:
        smallest = found.smallest
        facts = {
            "flights": len(found.flown),
            "worst": found.worst.number,
            "smallest": None if smallest is None else smallest.number,
            "size": None if smallest is None else found.size(smallest),
            "found": list(sentences),
        }
        print(json.dumps({"event": "search", **facts}, allow_nan=False), flush=True)
        return
    for sentence in sentences:
        console.print(sentence, markup=False, highlight=False, soft_wrap=True)
    console.print(f"results: {options.folder}", markup=False, highlight=False, soft_wrap=True)
