"""``gcs estimate``: the estimator on the sensors of a log."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from flightstack.core.errors import ConfigError
from flightstack.params.estimator import ESTIMATOR_SPECS
from flightstack.params.store import read_assignment
from flightstack.process.command_line import make_app
from gcs_cli.errors import USAGE, CliError
from gcs_cli.estimate.log_samples import DECLINATION
from gcs_cli.estimate.result import Result, estimate_log, quantities, render, rows_of
from gcs_cli.logs.reader import log_file, read_log, warn_if_damaged
from gcs_cli.output import show_page
from gcs_cli.run_directory import write_page
from gcs_cli.settings import JsonOption, OpenOption, OverwriteOption, check_page, output_of

app = make_app(add_completion=False)

_Log = Annotated[
    Path, typer.Argument(metavar="LOG", help="A ULog, also compressed (.ulg.xz).", show_default=False)
]
_Page = Annotated[
    Path | None,
    typer.Option(
        "--out", "-o", metavar="FILE", help="Write the report page to this file.", show_default=False
    ),
]
_Params = Annotated[
    list[str] | None,
    typer.Option(
        "--param", metavar="NAME=VALUE", help="Set a parameter of the filter (EKF2_…).", show_default=False
    ),
]


@app.command()
def estimate(
    context: typer.Context,
    log: _Log,
    out: _Page = None,
    param: _Params = None,
    overwrite: OverwriteOption = False,
    open_page: OpenOption = False,
    as_json: JsonOption = False,
) -> None:
    """Estimate attitude, velocity, position from a log.

    Compares the result with the log's own estimate, and with truth where the log has it. Parameters are those of the
    vehicle's estimator. A log of PX4 gives the delays of its sensors, EKF2_MAG_DECL and EKF2_REQ_EPH, _EPV, _SACC and
    _NSATS; a log of this flight stack gives all.
    """
    page = out if out is not None or not open_page else log_file(log).with_suffix(".html")
    if page is not None:
        check_page(page)
    given = _given(param or ())
    recording = read_log(log)
    warn_if_damaged(recording, recording.source)
    result = estimate_log(recording, given)
    failure = None if page is None else write_page(page, render(result, recording), overwrite)
    output, file = output_of(context, as_json), None if page is None or failure else str(page)
    facts = {"log": str(log), "damaged": recording.damaged, "file": file, **result.summary}
    output.say("estimate", "\n".join(_lines(result)), **facts)
    if failure is not None:
        raise failure
    if page is None:
        return
    if not output.as_json:
        print(f"report written to {page}", flush=True)
    if open_page:
        show_page(page)


def _given(assignments: Sequence[str]) -> dict[str, float]:
    """Return the parameters of ``--param``; raise CliError (usage) for one that the estimator does not have."""
    found = {}
    for text in assignments:
        try:
            name, value = read_assignment(text)
        except ConfigError as error:
            raise CliError(str(error), USAGE) from None
        spec = ESTIMATOR_SPECS.get(name)
        if spec is None and name != DECLINATION:
            names = [*ESTIMATOR_SPECS, DECLINATION]
            near = difflib.get_close_matches(name, names, n=1)
            hint = f"did you mean {near[0]}?" if near else f"it has {', '.join(names)}"
            raise CliError(f"--param {name}: the estimator has no such parameter; {hint}", USAGE)
        accepted = value if spec is None else spec.accepted(value)
        if isinstance(accepted, str):
            raise CliError(f"--param {name}: {accepted}", USAGE)
        found[name] = accepted
    return found


def _lines(result: Result) -> list[str]:
    """Return the figures as lines: quantity, then root mean square (largest) of each comparison."""
    summary = result.summary
    rows = list(rows_of(summary))
    span = summary["in_air_s"]
    when = "in all of the log" if span is None else f"in the air ({span:.1f} s)"
    lines = (
        [f"difference {when}, root mean square (largest)"]
        if rows
        else ["the log has no estimate and no truth"]
    )
    if rows:
        lines.append(" " * 20 + "".join(f"{name:>26}" for name, _ in rows))
    for number, quantity in enumerate(quantities() if rows else ()):
        lines.append(f"{quantity:20}" + "".join(f"{cells[number]:>26}" for _, cells in rows))
    return lines
