"""The directory of a flight: ``runs/<stamp>-<plan>/``, never one that holds another flight; and pages of flights."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from flightstack.core.atomic_file import check_new, write_text_atomically
from flightstack.core.errors import ConfigError
from flightstack.firmware.pil.record import LINK_FILE, STEPS_FILE
from gcs_cli.errors import USAGE, CliError

RUNS = Path("runs")
LOG_NAME, TLOG_NAME, SUMMARY_NAME, REPORT_NAME = "flight.ulg", "gcs.tlog", "summary.json", "report.html"
FILM_NAME = "replay.mp4"
COMPARISON_NAME = "compare.html"
SIMULATOR, STACK = "sim-bridge", "flightstack"
"""The children of a flight; the output of each goes to ``<name>.log``."""
RESULTS = (
    LOG_NAME, TLOG_NAME, SUMMARY_NAME, REPORT_NAME, FILM_NAME, COMPARISON_NAME, LINK_FILE, STEPS_FILE,
    f"{SIMULATOR}.log", f"{STACK}.log",
)  # fmt: skip
"""The files of a flight."""


def make_run_directory(plan: Path, out: Path | None, base: Path = RUNS, *, overwrite: bool = False) -> Path:
    """Make and return the directory; raise CliError (usage) when it cannot be, or holds a flight.

    The files of a flight that never began are removed; with ``overwrite``, those of any other flight too.
    """
    try:
        if out is None:
            return _fresh(base, plan.stem)
        log = out / LOG_NAME
        if log.exists() and log.stat().st_size and not overwrite:
            raise CliError(
                f"--out {out}: {LOG_NAME} of another flight is there; choose another one, or give --overwrite",
                USAGE,
            )
        out.mkdir(parents=True, exist_ok=True)
        if not os.access(out, os.W_OK | os.X_OK):
            raise CliError(f"--out {out}: nothing can be written there: permission denied", USAGE)
        for name in RESULTS:
            (out / name).unlink(missing_ok=True)
    except OSError as error:
        raise CliError(f"{out or base}: the directory cannot be made: {error.strerror}", USAGE) from None
    return out


def fresh_directory(base: Path, name: str) -> Path:
    """Make and return a new directory ``<stamp>-<name>`` in ``base``; raise CliError (usage)."""
    try:
        return _fresh(base, name)
    except OSError as error:
        raise CliError(f"{base}: the directory cannot be made: {error.strerror}", USAGE) from None


@contextlib.contextmanager
def results_directory(out: Path) -> Iterator[None]:
    """Make a directory for results; take it away again when what follows fails before it has written anything.

    Raise CliError (usage) when it cannot be made, or written to.
    """
    new = new_folders(out)
    try:
        out.mkdir(parents=True, exist_ok=True)
        if not os.access(out, os.W_OK | os.X_OK):
            raise CliError(f"{out}: nothing can be written there: permission denied", USAGE)
    except OSError as error:
        raise CliError(f"{out}: the directory cannot be made: {error.strerror}", USAGE) from None
    try:
        yield
    except BaseException:
        _remove(new)
        raise


def new_folders(folder: Path) -> list[Path]:
    """Return the folders that have to be made for ``folder``, the innermost first."""
    return [each for each in (folder, *folder.parents) if not each.exists()]


def remove_run(folder: Path, new: Sequence[Path]) -> None:
    """Remove the files of a flight that never began, and the folders that were made for it."""
    for name in RESULTS:
        (folder / name).unlink(missing_ok=True)
    _remove(new)


def _remove(folders: Sequence[Path]) -> None:
    with contextlib.suppress(OSError):  # of the first that holds something
        for folder in folders:
            folder.rmdir()


def _fresh(base: Path, name: str) -> Path:
    base.mkdir(parents=True, exist_ok=True)
    name, attempt = f"{time.strftime('%Y%m%d-%H%M%S')}-{name}", 1
    while True:
        folder = base / (name if attempt == 1 else f"{name}-{attempt}")
        try:
            folder.mkdir()
        except FileExistsError:  # another flight began in this second
            attempt += 1
            continue
        return folder


def write_page(page: Path, text: str, overwrite: bool) -> ConfigError | OSError | None:
    """Write a page; return the error if it is not written, so that the caller can print its figures first."""
    try:
        check_new(page, overwrite)
        write_text_atomically(page, text)
    except (ConfigError, OSError) as error:
        return error
    return None
