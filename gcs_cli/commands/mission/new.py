"""``gcs mission new``: missions of a pattern."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from flightstack.core.atomic_file import check_new
from flightstack.core.contract import FloatArray
from flightstack.core.geodesy import GeoPoint
from flightstack.params.config import DEFAULT_HOME, parse_home
from flightstack.plan import Plan
from flightstack.process.command_line import expand_options, make_app
from gcs_cli.errors import USAGE, CliError
from gcs_cli.plans import patterns
from gcs_cli.plans.areas import area_rings, line_of
from gcs_cli.plans.formats.files import DEFAULT_ALTITUDE_M, SUFFIXES, check_suffix, load_any, save_any
from gcs_cli.plans.itinerary import itinerary
from gcs_cli.plans.survey import survey
from gcs_cli.plans.table import itinerary_facts, totals
from gcs_cli.settings import JsonOption, OverwriteOption, output_of
from gcs_cli.transfers.plan_files import AltitudeOption
from gcs_cli.transfers.plan_transfers import say_lost

app = make_app(add_completion=False)


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


@dataclass(frozen=True)
class ShapeOptions:
    """The shape of a pattern."""

    size: Annotated[
        float,
        typer.Option(
            metavar="METRES",
            min=0.1,
            max=100_000.0,
            help="Side, diameter, or width of the lemniscate or corridor.",
        ),
    ] = 20.0
    spacing: Annotated[
        float,
        typer.Option(metavar="METRES", min=0.1, max=100_000.0, help="Largest distance between lines."),
    ] = 10.0
    angle: Annotated[
        float,
        typer.Option(metavar="DEGREES", min=-360.0, max=360.0, help="Direction of survey lines, from north."),
    ] = 0.0
    points: Annotated[
        int, typer.Option(metavar="N", min=3, max=1000, help="Waypoints of a circle or lemniscate.")
    ] = 24


@dataclass(frozen=True)
class RouteOptions:
    """Options of all patterns."""

    laps: Annotated[int, typer.Option(metavar="N", min=1, max=10_000, help="Repetitions of the pattern.")] = 1
    altitude: AltitudeOption = DEFAULT_ALTITUDE_M
    speed: Annotated[
        float | None,
        typer.Option(
            metavar="M/S",
            min=0.1,
            max=100.0,
            help="Ground speed.  [default: the vehicle's]",
            show_default=False,
        ),
    ] = None
    home: Annotated[
        str | None,
        typer.Option(
            metavar="LAT,LON,ALT",
            help="Place of the takeoff.  [default: that of AREA, else that of the simulator]",
            show_default=False,
        ),
    ] = None
    end: Annotated[Ending, typer.Option("--end", help="End of the mission.")] = Ending.RETURN


_Area = Annotated[
    Path | None,
    typer.Argument(
        metavar="[AREA]",
        help="Area of a survey (a polygon or a geofence) or line of a corridor: a file of any plan format.",
        show_default=False,
    ),
]
_Out = Annotated[
    Path | None,
    typer.Option(
        "--out",
        metavar="FILE",
        help=f"File to write: {', '.join(SUFFIXES)}.  [default: PATTERN.plan]",
        show_default=False,
    ),
]


@app.command()
@expand_options
def new(
    context: typer.Context,
    pattern: Annotated[Pattern, typer.Argument(metavar="PATTERN", help=f"{', '.join(Pattern)}.")],
    shape: ShapeOptions,
    route: RouteOptions,
    area: _Area = None,
    out: _Out = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Write a mission of a pattern.

    A square begins at home and extends north and east; a circle and a lemniscate have their centre there. The lines of
    a survey end at the border of AREA, which is not the geofence of the plan.
    """
    out = Path(f"{pattern.value}.plan") if out is None else out
    check_suffix(out)
    check_new(out, overwrite)
    if (area is None) == (pattern in (Pattern.CORRIDOR, Pattern.SURVEY)):
        need = "needs the file of an AREA" if area is None else "takes no AREA"
        raise CliError(f"mission new {pattern}: it {need}", USAGE)
    given = Plan(()) if area is None else load_any(area, route.altitude)
    home = _home_of_area(given) if route.home is None else parse_home(route.home)
    places = _places(pattern, shape, given, area, home)
    flown = patterns.Route(route.altitude, route.speed, laps=route.laps, ending=route.end.value)
    fence = () if pattern == Pattern.SURVEY else given.fence  # its own lines would leave it
    plan = Plan(patterns.pattern_items(places, home, home, flown), home, fence=fence)
    output = output_of(context, as_json)
    lost = save_any(out, plan)
    flight = itinerary(plan.items, home)
    output.say(
        "written",
        f"mission of {len(plan.items)} items written to {out}: {totals(flight)}",
        file=str(out),
        items=len(plan.items),
        **itinerary_facts(flight),
    )
    say_lost(output, lost, out)


def _places(
    pattern: Pattern, shape: ShapeOptions, given: Plan, area: Path | None, home: GeoPoint
) -> FloatArray:
    """Return the places of a pattern north and east of ``home`` [m]; raise CliError (usage) for a bad area."""
    if pattern == Pattern.SURVEY:
        rings = [patterns.local_m(ring, home) for ring in area_rings(given, area)]
        try:
            return survey(rings, shape.spacing, shape.angle)
        except ValueError as error:
            raise CliError(f"{area}: {error}", USAGE) from None
    if pattern == Pattern.CORRIDOR:
        return patterns.corridor(patterns.local_m(line_of(given, area), home), shape.size, shape.spacing)
    if pattern == Pattern.SQUARE:
        return patterns.square(shape.size)
    make = patterns.circle if pattern == Pattern.CIRCLE else patterns.lemniscate
    return make(shape.size, shape.points)


def _home_of_area(plan: Plan) -> GeoPoint:
    """Return the home of an area's file, else its first point at sea level, else the simulator's home."""
    if plan.home is not None:
        return plan.home
    first = next((each for each in (*plan.items, *plan.fence) if each.position_deg is not None), None)
    if first is None or first.position_deg is None:
        return DEFAULT_HOME
    return GeoPoint(*first.position_deg, 0.0)
