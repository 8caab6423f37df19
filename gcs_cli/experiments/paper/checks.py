"""What can be wrong with a run of ``gcs paper`` is said before anything flies, or any directory is made."""

from __future__ import annotations

from collections.abc import Sequence

from flightstack.params.gains_file import open_gains
from flightstack.params.vehicle import load_vehicle
from gcs_cli.errors import USAGE, CliError
from gcs_cli.experiments.paper import pil_section
from gcs_cli.experiments.paper.trajectory import load_trajectory
from gcs_cli.experiments.paper.types import Case


def check(cases: Sequence[Case], target: str | None) -> None:
    """Read every file that the cases name, and look for the target, None for none; raise CliError, ConfigError.

    The emulated target needs tools that not everybody has: without them its section is left out, and says why.
    """
    for name in sorted({case.trajectory for case in cases}):
        load_trajectory(name)
    for name in sorted({case.gains for case in cases}):
        open_gains(name)
    for name in sorted({case.vehicle for case in cases}):
        load_vehicle(name)
    if target is not None and target != pil_section.EMULATED:
        why = pil_section.problem(target)
        if why is not None:
            raise CliError(why, USAGE)
