"""``gcs mission check|show|convert``: plans in files."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Annotated

import typer

from flightstack.core.atomic_file import check_new, write_text_atomically
from flightstack.core.errors import WriteError
from flightstack.core.geodesy import GeoPoint
from flightstack.plan import Plan
from flightstack.process.command_line import IN_OUTPUT, expand_options, make_app
from gcs_cli.errors import FAILED, USAGE, CliError
from gcs_cli.output import Output
from gcs_cli.plans.check import plan_problems
from gcs_cli.plans.formats.files import DEFAULT_ALTITUDE_M, SUFFIXES, check_suffix, load_any, save_any
from gcs_cli.plans.itinerary import home_of_items, itinerary
from gcs_cli.plans.table import item_facts, itinerary_facts, mission_table, places_table, totals
from gcs_cli.settings import JsonOption, LinkOptions, OverwriteOption, output_of
from gcs_cli.tables import table_console
from gcs_cli.transfers.plan_files import OPTIONAL_PLAN, AltitudeOption, AnyPlanArgument
from gcs_cli.transfers.plan_parts import plan_parts
from gcs_cli.transfers.plan_transfers import say_lost
from gcs_cli.transfers.vehicle_plans import download_plan, problems_on_vehicle
from gcs_cli.vehicle_link import connect_vehicle

app = make_app(add_completion=False)

_DRAWING_ROWS = 20
VehicleOption = Annotated[
    bool, typer.Option("--vehicle", help="Use the plan, geofence and parameters of the vehicle.")
]


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
    """Convert a plan, and name what the new format cannot hold."""
    check_suffix(out)
    check_new(out, overwrite)
    plan = load_any(source, altitude)
    lost = save_any(out, plan)
    output = output_of(context, as_json)
    counts = ", ".join(f"{part.name} of {len(part.items)} items" for part in plan_parts(plan) if part.items)
    output.say(
        "written", f"{counts or 'an empty plan'} written to {out}", file=str(out), items=len(plan.items)
    )
    say_lost(output, lost, out)


@app.command()
@expand_options
def check(
    context: typer.Context,
    link: LinkOptions,
    file: AnyPlanArgument,
    vehicle: VehicleOption = False,
) -> None:
    """Check a file as the vehicle does.

    Without a vehicle, or with one's geofence, home and parameters.

    Checks geofence, mission and rally points, and names all items that are refused. Exits with 2 if there are any;
    with 1 if they were checked for a vehicle.
    """
    plan, output = load_any(file), output_of(context, link)
    on_vehicle = _uses_vehicle(link, vehicle)
    if on_vehicle:
        with connect_vehicle(context, link) as connection:
            problems, unchecked = problems_on_vehicle(connection, plan)
            autopilot = connection.session.view.autopilot.name
        if unchecked:
            output.say("limited", unchecked, autopilot=autopilot)
    else:
        problems = list(plan_problems(plan, home_of_items(plan.items, plan.home)))
    for problem in problems if output.as_json or len(problems) > 1 else ():
        output.say("problem", f"{problem.part}: {problem.reason}", **problem._asdict())
    refused = {problem.part for problem in problems}
    for part in plan_parts(plan):
        if part.name not in refused and (output.as_json or not problems):
            output.say(
                "good", f"{part.name} of {len(part.items)} items: good", part=part.name, items=len(part.items)
            )
    if problems:
        first, count = problems[0], len(problems)
        sentence = f"{first.part}: {first.reason}" if count == 1 else f"has {count} problems"
        raise CliError(f"{file}: {sentence}", FAILED if on_vehicle else USAGE)


def _uses_vehicle(link: LinkOptions, vehicle: bool) -> bool:
    return vehicle or link.connect is not None or link.instance is not None


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
    """Show a plan: a table of its items, and a drawing."""
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
    from gcs_cli.plans.page import plan_page

    problems = [f"{problem.part}: {problem.reason}" for problem in plan_problems(plan, home)]
    page = plan_page(name, plan, itinerary(plan.items, home), home, problems)
    try:
        write_text_atomically(html, page)
    except OSError as error:
        raise WriteError(html, "", f"cannot be written: {error.strerror or error}") from error
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
    console = table_console()
    console.print(mission_table(plan.items, flight) if plan.items else "no mission")
    for part in plan_parts(plan)[1:]:
        if part.items:
            console.print(f"\n{part.name}", style="bold")
            console.print(places_table(part.items))
    if plan.items:
        console.print(f"\n{totals(flight)}\n", highlight=False)
    if plan.items or plan.fence or plan.rally:
        width = min(shutil.get_terminal_size((80, 24)).columns - 1, 100)
        from gcs_cli.plans.drawing import draw, places_of

        console.print(draw(places_of(plan, flight, home), width, _DRAWING_ROWS).text())
