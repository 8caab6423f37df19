"""Export a log as tables: a directory with one CSV or Parquet file per topic."""

from __future__ import annotations

import csv
import json
import secrets
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from flightstack.core.atomic_file import naming
from flightstack.core.errors import ConfigError
from gcs_cli.errors import library
from gcs_cli.logs.info import start_utc
from gcs_cli.logs.recording import AnyArray, Recording, Topic

TIME_COLUMN = "timestamp"
"""First column: time in µs, as in the log."""
TEXTS, PARAMETERS = "texts", "parameters"
"""Names of the further tables."""


def export_csv(recording: Recording, folder: Path, overwrite: bool) -> int:
    """Write CSV files; return their number. Raise ConfigError or OSError."""
    return _export(recording, folder, ".csv", overwrite, _write_csv)


def export_parquet(recording: Recording, folder: Path, overwrite: bool) -> int:
    """Write Parquet files, with the log's facts as metadata; return their number. Raise CliError or OSError."""
    pyarrow, parquet = library("pyarrow"), library("pyarrow.parquet")
    metadata = {
        "source": recording.source,
        "start_us": str(recording.start_us),
        "start_utc": start_utc(recording) or "",
        "info": json.dumps(recording.facts, default=str),
    }

    def write(path: Path, columns: dict[str, Any]) -> None:
        table = pyarrow.table(columns).replace_schema_metadata(metadata)
        parquet.write_table(table, path, compression="zstd")

    return _export(recording, folder, ".parquet", overwrite, write)


def tables(recording: Recording) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the name and the columns of each table."""
    for topic in recording.topics:
        yield topic.name, _columns(topic)
    if recording.texts:
        times, severities, texts = zip(*recording.texts, strict=True)
        yield TEXTS, {TIME_COLUMN: times, "severity": severities, "text": texts}
    if recording.parameters:
        rows = [(recording.start_us, name, value) for name, value in recording.parameters.items()]
        times, names, values = zip(*rows, *recording.changes, strict=True)
        yield PARAMETERS, {TIME_COLUMN: times, "name": names, "value": values}


def _columns(topic: Topic) -> dict[str, AnyArray]:
    return {TIME_COLUMN: topic.time_us, **topic.fields}


def _write_csv(path: Path, columns: dict[str, Any]) -> None:
    values = [column.tolist() if hasattr(column, "tolist") else column for column in columns.values()]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*values, strict=True))


def _export(
    recording: Recording,
    folder: Path,
    suffix: str,
    overwrite: bool,
    write: Callable[[Path, dict[str, Any]], None],
) -> int:
    if folder.exists() and not folder.is_dir():
        raise ConfigError(folder, "", "is not a directory")
    if folder.is_dir() and any(folder.iterdir()) and not overwrite:
        raise ConfigError(folder, "", "is not empty: name another directory or give --overwrite")
    count = 0
    with new_folder(folder) as temporary:
        for name, columns in tables(recording):
            write(temporary / f"{name}{suffix}", columns)
            count += 1
    return count


@contextmanager
def new_folder(folder: Path) -> Iterator[Path]:
    """Yield an empty directory, whose files go to ``folder`` at the end; after an error nothing is left.

    Raise OSError, which names ``folder`` instead of the temporary directory.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    temporary = folder.with_name(f".{secrets.token_hex(8)}.{folder.name[-60:]}")
    with naming(folder, temporary):
        temporary.mkdir()
        try:
            yield temporary
            if folder.is_dir():
                for file in temporary.iterdir():
                    file.replace(folder / file.name)
            else:
                temporary.rename(folder)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
