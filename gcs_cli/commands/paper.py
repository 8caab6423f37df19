"""``gcs paper``: the paper, reproduced.

A module of its own, as each command: it is imported when it is used.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Annotated

import typer

from flightstack.process.command_line import make_app
from gcs_cli.errors import USAGE, CliError
from gcs_cli.output import show_page
from gcs_cli.settings import JsonOption, OpenOption, settings_of

app = make_app(add_completion=False)

_Out = Annotated[
    Path,
    typer.Option(
        "--out", "-o", metavar="DIR", help="Directory of the results; replaces those of a previous run."
    ),
]
_NoPil = Annotated[bool, typer.Option("--no-pil", help="Leave out the loops on a target.")]
_NoMultibody = Annotated[bool, typer.Option("--no-multibody", help="Leave out the multibody plant.")]
_Port = Annotated[
    str | None,
    typer.Option(
        metavar="TARGET",
        help="Run the loops on a board: serial:DEVICE[:BAUD].  [default: an emulated Cortex-M4F]",
        show_default=False,
    ),
]
_Jobs = Annotated[
    int | None,
    typer.Option(min=1, max=64, metavar="N", help="Flights at once.  [default: one for each processor]"),
]


@app.command()
def paper(
    context: typer.Context,
    out: _Out = Path("runs/paper"),
    no_pil: _NoPil = False,
    no_multibody: _NoMultibody = False,
    port: _Port = None,
    jobs: _Jobs = None,
    open_report: OpenOption = False,
    as_json: JsonOption = False,
) -> None:
    """Fly every experiment of the paper and report the results.

    A few minutes: report.html has verdicts, figures and tables, figures/ the figures as PDF and SVG, results.json the
    numbers, the same in each run.
    """
    # a second thread of BLAS waits actively between the small matrices here; read at the first import of NumPy
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from gcs_cli.experiments.paper.printed import print_results
    from gcs_cli.experiments.paper.run import HTML_NAME, PaperOptions, run
    from gcs_cli.fly.fly_display import FlyConsole
    from gcs_cli.pil.targets import checked_target

    if settings_of(context).link.connect is not None:
        raise CliError("paper flies vehicles of its own: leave --connect out", USAGE)
    if port is not None and no_pil:
        raise CliError("--port and --no-pil exclude each other", USAGE)
    options = PaperOptions(out, not no_pil, not no_multibody, jobs=jobs)
    if port is not None:
        checked_target(port, flag="--port")
        options = options._replace(target=port)
    console = FlyConsole(stderr=as_json, highlight=False)
    results = run(options, console)
    if as_json:
        print(json.dumps({**results, "directory": str(out)}, allow_nan=False), flush=True)
    else:
        print_results(console, results, out)
    if open_report:
        show_page(out / HTML_NAME)
