"""``gcs fence`` and ``gcs rally``: upload, download, show, verify and clear one part of the vehicle's plan."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from flightstack.core.atomic_file import check_new
from flightstack.plan import PLAN_NAMES, MissionType, Plan
from flightstack.process.command_line import expand_options, make_app
from gcs_cli.errors import USAGE, CliError
from gcs_cli.fly.processes import Interruption
from gcs_cli.link import calls
from gcs_cli.plans.formats.files import check_suffix, load_any
from gcs_cli.plans.itinerary import home_of_items, itinerary
from gcs_cli.plans.table import item_facts, places_table
from gcs_cli.settings import LinkOptions, OverwriteOption, output_of
from gcs_cli.tables import table_console
from gcs_cli.transfers.plan_files import OPTIONAL_PLAN, AnyPlanArgument
from gcs_cli.transfers.plan_parts import PlanPart, Uploads, plan_parts
from gcs_cli.transfers.plan_transfers import complete_upload, say_downloaded, say_uploaded, say_verified
from gcs_cli.transfers.vehicle_plans import download_plan
from gcs_cli.vehicle_link import connect_vehicle

_COLUMNS, _ROWS = 79, 20


def make_part_app(kind: MissionType) -> typer.Typer:
    """Return the commands for one part of the plan."""
    app = make_app(add_completion=False)
    name = PLAN_NAMES[kind]

    def upload(context: typer.Context, link: LinkOptions, file: AnyPlanArgument) -> None:
        part = _part_of(file, kind)
        with connect_vehicle(context, link) as connection, Interruption() as interruption:
            uploads = Uploads(
                connection.session,
                part.plan,
                restores=True,
                interrupted=lambda: interruption.reason,
                only=kind,
            )
            complete_upload(connection, uploads, file)
        say_uploaded(output_of(context, link), [part.part], uploads)

    def download(
        context: typer.Context,
        link: LinkOptions,
        file: Annotated[
            Path | None,
            typer.Argument(help="File to write; without it, the items are printed.", show_default=False),
        ] = None,
        overwrite: OverwriteOption = False,
    ) -> None:
        if file is not None:
            check_suffix(file)
            check_new(file, overwrite)
        with connect_vehicle(context, link) as connection:
            plan = download_plan(connection, with_home=file is not None, kinds=(kind,))
        say_downloaded(output_of(context, link), plan, file, (kind,))

    def show(
        context: typer.Context, link: LinkOptions, file: Annotated[Path | None, OPTIONAL_PLAN] = None
    ) -> None:
        if file is None:
            with connect_vehicle(context, link) as connection:
                plan = download_plan(connection, with_home=True, kinds=(kind,))
        else:
            plan = _only(load_any(file), kind)
        part = next(part for part in plan_parts(plan) if part.kind == kind)
        output = output_of(context, link)
        for seq, item in enumerate(part.items if output.as_json else ()):
            output.say("item", "", part=part.name, **item_facts(seq, item))
        if output.as_json or not part.items:
            output.say("plan", f"no {name}", part=part.name, items=len(part.items))
            return
        home = home_of_items(part.items, plan.home)
        from gcs_cli.plans.drawing import draw, places_of  # noqa: PLC0415  # NumPy

        console = table_console()
        console.print(places_table(part.items))
        console.print(draw(places_of(plan, itinerary((), home), home), _COLUMNS, _ROWS).text())

    def verify(context: typer.Context, link: LinkOptions, file: AnyPlanArgument) -> None:
        part = _part_of(file, kind)
        with connect_vehicle(context, link) as connection:
            stored = download_plan(connection, with_home=False, kinds=(kind,))
            tolerance = calls.storage_tolerance(connection.session)
        say_verified(output_of(context, link), [part.part], stored, tolerance, file)

    def clear(context: typer.Context, link: LinkOptions) -> None:
        with connect_vehicle(context, link) as connection:
            connection.complete(calls.clear(connection.session, kind), f"clearing the {name}")
        output_of(context, link).say("cleared", f"{name} cleared", part=name)

    for command, text in (
        (upload, f"Replace the vehicle's {name} by that of a file; its mission stays."),
        (download, f"Download the vehicle's {name}."),
        (show, f"Show the {name} of a file or of the vehicle."),
        (verify, f"Compare the vehicle's {name} with that of a file; exit with 1 if they differ."),
        (clear, f"Remove the vehicle's {name}."),
    ):
        app.command(command.__name__, help=text)(expand_options(command))
    return app


class _FilePart:
    """The part of a file, and the plan that holds nothing else."""

    def __init__(self, plan: Plan, part: PlanPart) -> None:
        self.plan, self.part = plan, part


def _part_of(file: Path, kind: MissionType) -> _FilePart:
    """Return one part of a file; raise CliError (usage) if it is empty."""
    plan = _only(load_any(file), kind)
    part = next(part for part in plan_parts(plan) if part.kind == kind)
    if not part.items:
        raise CliError(f"{file}: has no {part.name}", USAGE)
    return _FilePart(plan, part)


def _only(plan: Plan, kind: MissionType) -> Plan:
    """Return a plan with one of its parts."""
    return replace(
        plan,
        items=(),
        fence=plan.fence if kind == MissionType.FENCE else (),
        rally=plan.rally if kind == MissionType.RALLY else (),
        document={},
    )
