"""``gcs --help`` answers at once because nothing heavy is imported for it."""

from __future__ import annotations

import subprocess
import sys

HEAVY = ("numpy", "numba", "scipy", "matplotlib", "pyulog", "pymavlink", "rich", "jinja2", "plotly")
LIGHT = (
    "flightstack.core",
    "flightstack.process",
    "flightstack.process.command_line",
    "flightstack.process.console",
    "flightstack.process.options",
    "flightstack.core.port_numbers",
)
"""Of the flight stack's modules only those that print, or hold words and numbers for the help."""


def test_help_imports_nothing_heavy() -> None:
    program = (
        "import sys; sys.argv = ['gcs', '--help']; from gcs_cli.__main__ import main; main();"
        f"print('loaded:', *[name for name in {HEAVY!r} if name in sys.modules],"
        f"*[name for name in sys.modules if name.startswith('flightstack.') and name not in {LIGHT!r}])"
    )
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert "Usage: gcs" in result.stdout
    assert result.stdout.rstrip().endswith("loaded:")
