"""Upload, download and comparison of plans, and the lines that these commands print."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from flightstack.plan import MissionItem, MissionType, Plan
from flightstack.process.console import complain
from gcs_cli.errors import FAILED, INTERRUPTED, CliError, VehicleLostError
from gcs_cli.link import calls
from gcs_cli.link.connection import Connection
from gcs_cli.output import Output
from gcs_cli.plans.compare import Difference, differences
from gcs_cli.plans.formats.files import save_any
from gcs_cli.plans.names import any_command_name
from gcs_cli.plans.table import item_facts
from gcs_cli.transfers.plan_parts import PlanPart, Uploads, plan_parts
from gcs_cli.transfers.vehicle_plans import download_plan


def complete_upload(connection: Connection, uploads: Uploads, file: Path | str) -> None:
    """Run an upload to its end; if it ends early, raise CliError with the plans that the vehicle holds."""

    def name() -> str:
        return f"upload of the {uploads.name} of {file}"

    try:
        connection.complete(uploads, name)
    except VehicleLostError as error:
        raise CliError(f"{error}; {uploads.state}") from None
    except KeyboardInterrupt:
        raise CliError(f"{name()}: interrupted; {uploads.state}", INTERRUPTED) from None
    except OSError as error:
        raise CliError(f"{name()}: {error.strerror or error}; {uploads.state}") from None


def compare_with_vehicle(
    connection: Connection, parts: Sequence[PlanPart]
) -> list[tuple[PlanPart, list[Difference]]]:
    """Read the vehicle's plan back; return each part with its differences. Raise CliError."""
    stored = download_plan(connection, with_home=False, kinds=tuple(part.kind for part in parts))
    held = {part.kind: part.items for part in plan_parts(stored)}
    tolerance = calls.storage_tolerance(connection.session)
    return [(part, list(differences(part.items, held[part.kind], tolerance))) for part in parts]


def say_restoring() -> None:
    """Print to stderr that the vehicle gets its former plans again, which takes a while."""
    complain("gcs: restoring the vehicle's former plans")


def say_uploaded(output: Output, parts: Sequence[PlanPart], uploads: Uploads) -> None:
    """Print the uploaded parts, and those that the vehicle keeps."""
    for part in parts:
        count = len(part.items)
        output.say("uploaded", f"{part.name} of {count} items uploaded", part=part.name, items=count)
    for part in uploads.kept:
        count = len(part.items)
        output.say("kept", f"the vehicle keeps its {part.name} of {count} items", part=part.name, items=count)


def say_downloaded(output: Output, plan: Plan, file: Path | None, kinds: tuple[MissionType, ...]) -> None:
    """Write a downloaded plan to ``file``, or print its items; the mission counts also if it is empty."""
    lost = "" if file is None else save_any(file, plan)
    for part in plan_parts(plan):
        if part.kind not in kinds:
            continue
        if file is None:
            for seq, item in enumerate(part.items):
                output.say("item", item_line(seq, item), part=part.name, **item_facts(seq, item))
        if part.items or part.kind == kinds[0]:
            count = len(part.items)
            output.say(
                "downloaded",
                f"{part.name} of {count} items downloaded" + (f" to {file}" if file else ""),
                part=part.name,
                items=count,
                file=None if file is None else str(file),
            )
    if file is not None:
        say_lost(output, lost, file)


def say_lost(output: Output, lost: str, file: Path) -> None:
    """Print what the format of ``file`` does not hold, if anything."""
    if lost:
        output.say("lost", f"lost in {file}: {lost}", file=str(file), lost=lost)


def say_verified(output: Output, compared: Sequence[tuple[PlanPart, list[Difference]]], file: Path) -> None:
    """Print the differences between the parts of a file and the vehicle's.

    Raise CliError if there are any, other than of values that the vehicle cannot hold.
    """
    count = 0
    for part, found in compared:
        wrong = [difference for difference in found if not difference.cannot_be_held]
        count += len(wrong)
        for difference in found:
            output.say(
                "cannot_be_held" if difference.cannot_be_held else "difference",
                f"{part.name}: {difference.sentence}",
                part=part.name,
                seq=difference.seq,
                field=difference.field,
                expected=_plain(difference.wanted),
                found=_plain(difference.found),
            )
        if not wrong:
            output.say(
                "equal",
                f"{part.name} of {len(part.items)} items: {equality(found)}",
                part=part.name,
                items=len(part.items),
                cannot_be_held=len(found),
            )
    if count:
        many = "1 difference" if count == 1 else f"{count} differences"
        raise CliError(f"{file}: {many} from the plan on the vehicle", FAILED)


def equality(found: Sequence[Difference]) -> str:
    """Return that a part is equal, or equal but for ``found``: the values that the vehicle cannot hold."""
    if not found:
        return "equal"
    values = "1 value" if len(found) == 1 else f"{len(found)} values"
    return f"equal except for {values} that the vehicle cannot hold"


def _plain(value: object) -> object:
    return any_command_name(value.command) if isinstance(value, MissionItem) else value


def item_line(seq: int, item: MissionItem) -> str:
    """Format one item on one line."""
    position = ""
    if item.position_deg is not None:
        latitude, longitude = item.position_deg
        position = f"{latitude:.7f} {longitude:.7f} {item.z:g} m"
    params = " ".join(f"{value:g}" for value in item.params)
    return f"{seq:4d}  {any_command_name(item.command):<22} {position:<34} [{params}]".rstrip()
