"""Write the files of firmware/core that are made of Python: types, numbers, parameter table, laws and the estimator.

``--check`` fails when a file is stale.
"""

from __future__ import annotations

import sys
from pathlib import Path

from flightstack.control.controller import BUILT_IN
from flightstack.firmware.generator.core_files import core_files
from flightstack.firmware.generator.filter_files import filter_files
from tools.generated import ROOT, write_or_check

CORE = ROOT / "firmware" / "core"


def files() -> dict[Path, str]:
    """Return the text of every generated file."""
    loops = {CORE / name: text for name, text in core_files(BUILT_IN).items()}
    return loops | {CORE / "estimation" / name: text for name, text in filter_files(BUILT_IN).items()}


if __name__ == "__main__":
    sys.exit(write_or_check(files()))
