"""The plan on a command line: a path, or the name of an example plan of the installation."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flightstack.core.errors import did_you_mean
from gcs_cli.errors import USAGE, CliError

DEFAULT_PLAN = "square"


def examples_folder() -> Path:
    """Return the folder of the example plans and scenarios: in the installed package, else in the source tree."""
    here = Path(__file__).resolve().parents[1]
    packaged = here / "missions"
    return packaged if packaged.is_dir() else here.parent / "missions"


def example_plans() -> dict[str, Path]:
    """Return the example plans by name."""
    found = sorted(examples_folder().glob("*"))
    return {path.stem: path for path in found if path.suffix in (".plan", ".waypoints")}


def plan_file(given: str | Path) -> Path:
    """Return the file of a plan; a name without folder and suffix is an example. Raise CliError (usage)."""
    text = str(given)
    examples = example_plans()
    if not text or set(text) & {"/", "\\", "."}:
        path = Path(text)
        if path.stem in examples and not path.exists():
            raise CliError(f"{text}: there is no such file; the example plan is named {path.stem}", USAGE)
        return path
    if text not in examples:
        is_file = Path(text).is_file()
        hint = f"; to use the file give ./{text}" if is_file else did_you_mean(text, examples)
        problem = f"there is no example plan of that name; there are {', '.join(examples)}"
        raise CliError(f"{text}: {problem}{hint}", USAGE)
    return examples[text]


def _complete(incomplete: str) -> list[str]:
    return [name for name in example_plans() if name.startswith(incomplete)]


PLAN_ARGUMENT = typer.Argument(
    metavar="PLAN",
    parser=plan_file,
    autocompletion=_complete,
    help=f"A .plan or .waypoints file, or the name of an example: {', '.join(example_plans())}.",
)
ANY_PLAN_ARGUMENT = typer.Argument(
    metavar="PLAN",
    parser=plan_file,
    autocompletion=_complete,
    help="A .plan, .waypoints, .kml, .gpx or .geojson file, or the name of an example: "
    f"{', '.join(example_plans())}.",
)
OPTIONAL_PLAN = typer.Argument(
    metavar="[PLAN]",
    parser=plan_file,
    autocompletion=_complete,
    help="A file as of `gcs mission upload`, or the name of an example; without it, the vehicle's plan.",
    show_default=False,
)
PlanArgument = Annotated[Path, PLAN_ARGUMENT]
AnyPlanArgument = Annotated[Path, ANY_PLAN_ARGUMENT]
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
