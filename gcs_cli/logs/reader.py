"""Read any log, also compressed with xz: ULog by its first bytes, else a tlog."""

from __future__ import annotations

import lzma
from pathlib import Path
from typing import Protocol

from flightstack.core.errors import ConfigError
from flightstack.process.console import complain
from gcs_cli.errors import USAGE, CliError
from gcs_cli.logs.recording import Recording
from gcs_cli.logs.tlog_reader import read_tlog
from gcs_cli.logs.ulog_reader import read_ulog
from gcs_cli.run_directory import LOG_NAME

_ULOG_MAGIC = b"ULog"
_XZ_MAGIC = b"\xfd7zXZ\x00"


class ReadLog(Protocol):
    """A log that was read, perhaps in part."""

    @property
    def damaged(self) -> bool:
        """True if a part could not be read."""

    @property
    def duration_s(self) -> float:
        """From the first to the last sample."""


def warn_if_damaged(log: ReadLog, source: object) -> None:
    """Print a warning that names ``source`` if the log could only be read in part."""
    if log.damaged:
        complain(f"gcs: warning: {source}: the log is damaged; read up to {log.duration_s:.1f} s")


def log_file(path: Path) -> Path:
    """Return the log at ``path``: the file, or the ULog of a flight's directory; raise CliError (usage)."""
    if not path.is_dir():
        return path
    logs = [path / LOG_NAME] if (path / LOG_NAME).is_file() else sorted(path.glob("*.ulg"))
    if len(logs) != 1:
        found = f"has {len(logs)} logs" if logs else "has no log"
        raise CliError(f"{path}: this directory {found}: name a .ulg or .tlog file", USAGE)
    return logs[0]


def read_log(path: Path) -> Recording:
    """Read a log, complete or truncated; raise CliError (usage) if it is none."""
    file = log_file(path)
    try:
        content = file.read_bytes()
        if content.startswith(_XZ_MAGIC):
            content = lzma.decompress(content)
    except OSError as error:
        raise CliError(f"{file}: cannot be read: {error.strerror}", USAGE) from None
    except (lzma.LZMAError, EOFError) as error:
        raise CliError(f"{file}: cannot be decompressed: {error}", USAGE) from None
    try:
        return (read_ulog if content.startswith(_ULOG_MAGIC) else read_tlog)(content, str(file))
    except ConfigError as error:
        raise CliError(str(error), USAGE) from None
