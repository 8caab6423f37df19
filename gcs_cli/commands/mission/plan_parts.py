"""Commands on the vehicle's plan, or one part of it, which ``gcs mission``, ``fence`` and ``rally`` share."""

from __future__ import annotations

from dataclasses import replace
from inspect import cleandoc
from pathlib import Path
from typing import Annotated

import typer

from flightstack.core.atomic_file import check_new
from flightstack.plan import PLAN_NAMES, MissionType, Plan
from flightstack.process.command_line import expand_options, make_app
from gcs_cli.commands.confirmation import YesOption, confirm_if_armed
from gcs_cli.errors import INTERRUPTED, USAGE, CliError
from gcs_cli.fly.processes import Interruption
from gcs_cli.link import calls
from gcs_cli.plans.formats.files import check_suffix, load_any
from gcs_cli.plans.itinerary import home_of_items, itinerary
from gcs_cli.plans.table import item_facts, places_table
from gcs_cli.settings import LinkOptions, OverwriteOption, output_of
from gcs_cli.tables import table_console
from gcs_cli.transfers.plan_files import OPTIONAL_PLAN, AnyPlanArgument
from gcs_cli.transfers.plan_parts import Uploads, parts_to_send, plan_parts
from gcs_cli.transfers.plan_transfers import (
    compare_with_vehicle,
    complete_upload,
    say_downloaded,
    say_restoring,
    say_uploaded,
    say_verified,
)
from gcs_cli.transfers.vehicle_plans import KINDS, download_plan
from gcs_cli.vehicle_link import connect_vehicle

_COLUMNS, _ROWS = 79, 20
_ASKS = "If the vehicle is armed, asks first on a terminal; elsewhere it needs --yes."


def _part_app(kind: MissionType) -> typer.Typer:
    """Return the commands for one part of the plan."""
    app = make_app(add_completion=False)
    name = PLAN_NAMES[kind]
    add_upload(app, kind, f"Replace the vehicle's {name} by that of a file; its mission stays.")
    add_download(app, (kind,), f"Download the vehicle's {name}.")
    _add_show(app, kind, f"Show the {name} of a file or of the vehicle.")
    add_verify(app, kind, f"Compare the vehicle's {name} with that of a file; exit with 1 if they differ.")
    _add_clear(app, kind, f"Remove the vehicle's {name}.")
    return app


def add_upload(app: typer.Typer, kind: MissionType | None, text: str) -> None:
    """Add ``upload`` of a part, or of the mission and the other parts that a file has."""

    @app.command(help=f"{cleandoc(text)}\n\n{_ASKS}")
    @expand_options
    def upload(
        context: typer.Context, link: LinkOptions, file: AnyPlanArgument, yes: YesOption = False
    ) -> None:
        plan = _plan_of(file, kind)
        parts = parts_to_send(plan, kind)
        with connect_vehicle(context, link) as connection:
            names = " and ".join(part.name for part in parts)
            confirm_if_armed(connection, f"its {names} will be replaced", yes)
            with Interruption() as interruption:
                uploads = Uploads(
                    connection.session,
                    plan,
                    restores=True,
                    interrupted=lambda: interruption.reason,
                    only=kind,
                    on_restore=say_restoring,
                )
                try:
                    complete_upload(connection, uploads, file)
                except CliError as error:
                    if interruption.reason:
                        raise CliError(str(error), INTERRUPTED) from None
                    raise
        say_uploaded(output_of(context, link), parts, uploads)


def add_download(app: typer.Typer, kinds: tuple[MissionType, ...], text: str) -> None:
    """Add ``download`` of some parts."""

    @app.command(help=text)
    @expand_options
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
            plan = download_plan(connection, with_home=file is not None, kinds=kinds)
        say_downloaded(output_of(context, link), plan, file, kinds)


def add_verify(app: typer.Typer, kind: MissionType | None, text: str) -> None:
    """Add ``verify`` of a part, or of the mission and the other parts that a file has."""

    @app.command(help=text)
    @expand_options
    def verify(context: typer.Context, link: LinkOptions, file: AnyPlanArgument) -> None:
        plan = _plan_of(file, kind)
        with connect_vehicle(context, link) as connection:
            found = compare_with_vehicle(connection, parts_to_send(plan, kind))
        say_verified(output_of(context, link), found, file)


def clear_part(
    context: typer.Context, link: LinkOptions, kind: MissionType, name: str, part: str, yes: bool
) -> None:
    """Remove a part of the vehicle's plan, or all; ``part`` is its name for programs."""
    with connect_vehicle(context, link) as connection:
        confirm_if_armed(connection, f"its {name} will be removed", yes)
        connection.complete(calls.clear(connection.session, kind), f"clearing the {name}")
    output_of(context, link).say("cleared", f"{name} cleared", part=part)


def _add_clear(app: typer.Typer, kind: MissionType, text: str) -> None:
    name = PLAN_NAMES[kind]

    @app.command(help=f"{text}\n\n{_ASKS}")
    @expand_options
    def clear(context: typer.Context, link: LinkOptions, yes: YesOption = False) -> None:
        clear_part(context, link, kind, name, name, yes)


def _add_show(app: typer.Typer, kind: MissionType, text: str) -> None:
    @app.command(help=text)
    @expand_options
    def show(
        context: typer.Context, link: LinkOptions, file: Annotated[Path | None, OPTIONAL_PLAN] = None
    ) -> None:
        if file is None:
            with connect_vehicle(context, link) as connection:
                plan = download_plan(connection, with_home=True, kinds=(kind,))
        else:
            plan = _only(load_any(file), kind)
        part = plan_parts(plan)[KINDS.index(kind)]
        output = output_of(context, link)
        for seq, item in enumerate(part.items if output.as_json else ()):
            output.say("item", "", part=part.name, **item_facts(seq, item))
        if output.as_json or not part.items:
            output.say("plan", f"no {part.name}", part=part.name, items=len(part.items))
            return
        home = home_of_items(part.items, plan.home)
        from gcs_cli.plans.drawing import draw, places_of

        console = table_console()
        console.print(places_table(part.items))
        console.print(draw(places_of(plan, itinerary((), home), home), _COLUMNS, _ROWS).text())


def _plan_of(file: Path, kind: MissionType | None) -> Plan:
    """Return the plan of a file, or one part of it; raise CliError (usage) if that is empty."""
    plan = load_any(file)
    if kind is None:
        return plan
    plan = _only(plan, kind)
    if not plan.fence and not plan.rally:
        raise CliError(f"{file}: has no {PLAN_NAMES[kind]}", USAGE)
    return plan


def _only(plan: Plan, kind: MissionType) -> Plan:
    """Return a plan with its geofence or its rally points alone."""
    return replace(
        plan,
        items=(),
        fence=plan.fence if kind == MissionType.FENCE else (),
        rally=plan.rally if kind == MissionType.RALLY else (),
        document={},
    )


fence_app = _part_app(MissionType.FENCE)
rally_app = _part_app(MissionType.RALLY)
