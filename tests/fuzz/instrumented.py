"""A fuzzed target in a process of its own: ``python -m tests.fuzz.instrumented TARGET FOLDER [OPTION ...]``.

Started by ``tests.fuzz.guided``. Compiled kernels cannot be instrumented and are left out: what guides the search is
the code that takes bytes apart.
"""

from __future__ import annotations

import contextlib
import io
import re
import sys
from pathlib import Path

import atheris

TOP = Path(__file__).resolve().parents[2]
_PACKAGES = ("flightstack", "sim_bridge", "gcs_cli")


def compiled_modules() -> list[str]:
    """Return the modules that Numba compiles: its input has to be as Python made it."""
    sources = [path for package in _PACKAGES for path in (TOP / package).rglob("*.py")]
    found = [
        path for path in sources if re.search(r"^(from|import) .*(compiled|numba)", path.read_text(), re.M)
    ]
    return [".".join(path.relative_to(TOP).with_suffix("").parts) for path in found]


_instrumented = atheris.instrument_imports(include=list(_PACKAGES), exclude=compiled_modules())
with _instrumented, contextlib.redirect_stderr(io.StringIO()):  # one line for each module
    from tests.fuzz.targets import TARGETS


def main() -> None:
    """Fuzz one target until libFuzzer's options say that it is enough."""
    name, *options = sys.argv[1:]
    target = TARGETS[name]
    target(b"")  # it may have to compile the kernels, which is no fault of an input
    runs = arrivals = 0

    def one_input(data: bytes) -> None:
        nonlocal runs, arrivals
        arrivals += target(data)
        runs += 1
        if runs % 64 == 0:
            print(f"TRIED {runs} {arrivals}", file=sys.stderr)

    atheris.Setup([sys.argv[0], *options], one_input)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
