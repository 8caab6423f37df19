"""``gcs mission new|check|show|convert``: plans in files."""

from __future__ import annotations

import shutil
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from flightstack.core.atomic_file import check_new, write_text_atomically
from flightstack.core.errors import ConfigError
from flightstack.core.geodesy import GeoPoint
from flightstack.params.config import DEFAULT_HOME, parse_home
from flightstack.plan import DEFAULT_LIMITS, Plan
from flightstack.process.command_line import IN_OUTPUT, expand_options, make_app
from gcs_cli.errors import FAILED, USAGE, CliError
from gcs_cli.output import Output
from gcs_cli.plans import patterns
from gcs_cli.plans.areas import area_rings, line_of
from gcs_cli.plans.check import Problem, limits_of, plan_problems
from gcs_cli.plans.drawing import draw, places_of
from gcs_cli.plans.formats.files import DEFAULT_ALTITUDE_M, SUFFIXES, check_suffix, load_any, save_any
from gcs_cli.plans.itinerary import home_of_items, itinerary
from gcs_cli.plans.page import plan_page
from gcs_cli.plans.survey import survey
from gcs_cli.plans.table import item_facts, itinerary_facts, mission_table, places_table, totals
from gcs_cli.settings import JsonOption, LinkOptions, OverwriteOption, output_of
from gcs_cli.transfers.plan_files import OPTIONAL_PLAN, AnyPlanArgument
from gcs_cli.transfers.plan_parts import plan_parts
from gcs_cli.transfers.vehicle_plans import download_plan, limit_parameters
from gcs_cli.vehicle_link import connect_vehicle

app = make_app(add_completion=False)

_DRAWING_ROWS = 20
_WIDE = 150  # columns of a table in a pipe or file
AltitudeOption = Annotated[
    float,
    typer.Option(
        "--altitude",
        metavar="METRES",
        min=0.1,
        max=10_000.0,
        help="Altitude above home of points without one.",
    ),
]
VehicleOption = Annotated[
    bool, typer.Option("--vehicle", help="Use the plan, geofence and parameters of the vehicle.")
]


class Pattern(StrEnum):
    """Values of PATTERN."""

    SQUARE = "square"
    CIRCLE = "circle"
    LEMNISCATE = "lemniscate"
    CORRIDOR = "corridor"
    SURVEY = "survey"


class Ending(StrEnum):
    """Values of ``--end``."""

    RETURN = "return"
    LAND = "land"
    NONE = "none"


@app.command()
def new(
    context: typer.Context,
    pattern: Annotated[Pattern, typer.Argument(metavar="PATTERN", help=f"{', '.join(Pattern)}.")],
    out: Annotated[
        Path,
        typer.Option(
            "--out", metavar="FILE", help=f"File to write: {', '.join(SUFFIXES)}.", show_default=False
        ),
    ],
    area: Annotated[
        Path | None,
        typer.Argument(
            metavar="[AREA]",
            help="Area of a survey (a polygon or a geofence) or line of a corridor: a file of any plan format.",
            show_default=False,
        ),
    ] = None,
    size: Annotated[
        float,
        typer.Option(
            metavar="METRES", min=0.1, help="Side, diameter, or width of the lemniscate or corridor."
        ),
    ] = 20.0,
    spacing: Annotated[
        float, typer.Option(metavar="METRES", min=0.1, help="Largest distance between lines.")
    ] = 10.0,
    angle: Annotated[
        float, typer.Option(metavar="DEGREES", help="Direction of survey lines, from north.")
    ] = 0.0,
    points: Annotated[
        int, typer.Option(metavar="N", min=3, max=1000, help="Waypoints of a circle or lemniscate.")
    ] = 24,
    laps: Annotated[
        int, typer.Option(metavar="N", min=1, max=10_000, help="Repetitions of the pattern.")
    ] = 1,
    altitude: AltitudeOption = DEFAULT_ALTITUDE_M,
    speed: Annotated[
        float | None,
        typer.Option(
            metavar="M/S",
            min=0.1,
            max=100.0,
            help="Ground speed.  [default: the vehicle's]",
            show_default=False,
        ),
    ] = None,
    home: Annotated[
        str | None,
        typer.Option(
            metavar="LAT,LON,ALT",
            help="Place of the takeoff.  [default: that of AREA, else that of the simulator]",
            show_default=False,
        ),
    ] = None,
    end: Annotated[Ending, typer.Option("--end", help="How the mission ends.")] = Ending.RETURN,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Write a mission of a pattern.

    A square begins at home and extends north and east; a circle and a lemniscate have their centre there.
    """
    check_suffix(out)
    check_new(out, overwrite)
    if (area is None) == (pattern in (Pattern.CORRIDOR, Pattern.SURVEY)):
        need = "needs the file of an AREA" if area is None else "takes no AREA"
        raise CliError(f"mission new {pattern}: it {need}", USAGE)
    given = Plan(()) if area is None else load_any(area, altitude)
    base = parse_home(home) if home is not None else _home_of_area(given)
    route = patterns.Route(altitude, speed, laps=laps, ending=end.value)
    if pattern == Pattern.SURVEY:
        rings = [patterns.local_m(ring, base) for ring in area_rings(given, area)]
        try:
            places = survey(rings, spacing, angle)
        except ValueError as error:
            raise CliError(f"{area}: {error}", USAGE) from None
    elif pattern == Pattern.CORRIDOR:
        places = patterns.corridor(patterns.local_m(line_of(given, area), base), size, spacing)
    elif pattern == Pattern.SQUARE:
        places = patterns.square(size)
    elif pattern == Pattern.CIRCLE:
        places = patterns.circle(size, points)
    else:
        places = patterns.lemniscate(size, points)
    plan = Plan(patterns.pattern_items(places, base, base, route), base, fence=given.fence)
    output = output_of(context, as_json)
    lost = save_any(out, plan)
    flight = itinerary(plan.items, base)
    output.say(
        "written",
        f"mission of {len(plan.items)} items written to {out}: {totals(flight)}",
        file=str(out),
        items=len(plan.items),
        **itinerary_facts(flight),
    )
    _say_lost(output, lost, out)


def _home_of_area(plan: Plan) -> GeoPoint:
    """Return the home of an area's file, else its first point at sea level, else the simulator's home."""
    if plan.home is not None:
        return plan.home
    first = next((each for each in (*plan.items, *plan.fence) if each.position_deg is not None), None)
    if first is None or first.position_deg is None:
        return DEFAULT_HOME
    return GeoPoint(*first.position_deg, 0.0)


def _say_lost(output: Output, lost: str, out: Path) -> None:
    if lost:
        output.say("lost", f"lost in {out}: {lost}", file=str(out), lost=lost)


@app.command()
def convert(
    context: typer.Context,
    source: AnyPlanArgument,
    out: Annotated[
        Path, typer.Argument(metavar="OUT", help=f"File to write: {', '.join(SUFFIXES)}.", show_default=False)
    ],
    altitude: AltitudeOption = DEFAULT_ALTITUDE_M,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Convert a plan to the format of another file, and name what that format cannot hold."""
    check_suffix(out)
    check_new(out, overwrite)
    plan = load_any(source, altitude)
    lost = save_any(out, plan)
    output = output_of(context, as_json)
    counts = ", ".join(f"{part.name} of {len(part.items)} items" for part in plan_parts(plan) if part.items)
    output.say(
        "written", f"{counts or 'an empty plan'} written to {out}", file=str(out), items=len(plan.items)
    )
    _say_lost(output, lost, out)


@app.command()
@expand_options
def check(
    context: typer.Context,
    link: LinkOptions,
    file: AnyPlanArgument,
    vehicle: VehicleOption = False,
) -> None:
    """Check a file as the vehicle does: without a vehicle, or with one's geofence, home and parameters.

    Checks geofence, mission and rally points, and names all items that are refused.
    """
    plan, output = load_any(file), output_of(context, link)
    if _uses_vehicle(link, vehicle):
        problems = _problems_of_vehicle(context, link, plan, output)
    else:
        problems = list(plan_problems(plan, home_of_items(plan.items, plan.home)))
    for problem in problems if output.as_json or len(problems) > 1 else ():
        output.say("problem", f"{problem.part}: {problem.reason}", **problem._asdict())
    refused = {problem.part for problem in problems}
    for part in plan_parts(plan):
        if part.name not in refused:
            output.say(
                "good", f"{part.name} of {len(part.items)} items: good", part=part.name, items=len(part.items)
            )
    if problems:
        first, more = problems[0], len(problems) - 1
        raise CliError(
            f"{file}: {first.part}: {first.reason}" + (f" (and {more} more)" if more else ""), FAILED
        )


def _uses_vehicle(link: LinkOptions, vehicle: bool) -> bool:
    return vehicle or link.connect is not None or link.instance is not None


def _problems_of_vehicle(
    context: typer.Context, link: LinkOptions, plan: Plan, output: Output
) -> list[Problem]:
    """Return the problems of ``plan`` with home, limits and geofence of the vehicle."""
    with connect_vehicle(context, link) as connection:
        stored = download_plan(connection, with_home=True)
        autopilot = connection.session.view.autopilot
        is_foreign = not autopilot.stores_items_exactly
        limits = DEFAULT_LIMITS if is_foreign else limits_of(limit_parameters(connection))
    if is_foreign:
        output.say(
            "limited",
            f"only the geofence is checked: the commands of {autopilot.title} are not known",
            autopilot=autopilot.name,
        )
    home = home_of_items(plan.items, stored.home or plan.home)
    return list(plan_problems(plan, home, limits, stored.fence, is_foreign=is_foreign))


@app.command()
@expand_options
def show(
    context: typer.Context,
    link: LinkOptions,
    file: Annotated[
        Path | None,
        OPTIONAL_PLAN,
    ] = None,
    vehicle: VehicleOption = False,
    html: Annotated[
        Path | None,
        typer.Option(
            "--html", metavar="FILE", help="Write a page with charts.", show_default=False, **IN_OUTPUT
        ),
    ] = None,
    altitude: AltitudeOption = DEFAULT_ALTITUDE_M,
    overwrite: OverwriteOption = False,
) -> None:
    """Show a plan: its items with distances, headings and times, and a drawing."""
    if html is not None:
        check_new(html, overwrite)
    if file is None:
        with connect_vehicle(context, link) as connection:
            plan, name = download_plan(connection, with_home=True), "plan of the vehicle"
    elif _uses_vehicle(link, vehicle):
        raise CliError("mission show: give a file or --vehicle, not both", USAGE)
    else:
        plan, name = load_any(file, altitude), file.name
    home = home_of_items((*plan.items, *plan.fence, *plan.rally), plan.home)
    if html is None:
        _print_plan(plan, home, output_of(context, link))
        return
    problems = [f"{problem.part}: {problem.reason}" for problem in plan_problems(plan, home)]
    page = plan_page(name, plan, itinerary(plan.items, home), home, problems)
    try:
        write_text_atomically(html, page)
    except OSError as error:
        raise ConfigError(html, "", f"cannot be written: {error.strerror or error}") from error
    output_of(context, link).say("written", f"page written to {html}", file=str(html))


def _print_plan(plan: Plan, home: GeoPoint, output: Output) -> None:
    flight = itinerary(plan.items, home)
    if output.as_json:
        stops = {stop.seq: stop for stop in flight.stops}
        for part in plan_parts(plan):
            for seq, item in enumerate(part.items):
                stop = stops.get(seq) if part.items is plan.items else None
                output.say("item", "", part=part.name, **item_facts(seq, item, stop))
        output.say("plan", "", items=len(plan.items), **itinerary_facts(flight))
        return
    console = Console()
    if not console.is_terminal:
        console = Console(width=_WIDE)
    console.print(mission_table(plan.items, flight) if plan.items else "no mission")
    for part in plan_parts(plan)[1:]:
        if part.items:
            console.print(f"\n{part.name}", style="bold")
            console.print(places_table(part.items))
    if plan.items:
        console.print(f"\n{totals(flight)}\n", highlight=False)
    if plan.items or plan.fence or plan.rally:
        width = min(shutil.get_terminal_size((80, 24)).columns - 1, 100)
        console.print(draw(places_of(plan, flight, home), width, _DRAWING_ROWS).text())
