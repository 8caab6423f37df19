"""The table of a campaign as Parquet and CSV: the same bytes for the same rows."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from flightstack.core.atomic_file import replacing, write_text_atomically
from gcs_cli.campaign.journal import CSV, PARQUET
from gcs_cli.campaign.rows import Row, columns
from gcs_cli.errors import library

_WHOLE = ("flight", "seed")


def write_tables(folder: Path, rows: Sequence[Row], as_csv: bool) -> None:
    """Write the table as Parquet and, if wanted, as CSV; raise OSError, or CliError without pyarrow."""
    write_parquet(folder / PARQUET, rows)
    if as_csv:
        write_csv(folder / CSV, rows)


def write_parquet(path: Path, rows: Sequence[Row]) -> None:
    """Write the table; raise OSError, or CliError without pyarrow."""
    pyarrow, parquet = library("pyarrow"), library("pyarrow.parquet")
    content = columns(rows)
    kinds = {name: _kind(pyarrow, name, values) for name, values in content.items()}
    table = pyarrow.table(content, schema=pyarrow.schema(list(kinds.items())))
    with replacing(path) as temporary:
        parquet.write_table(table, temporary, compression="zstd")


def write_csv(path: Path, rows: Sequence[Row]) -> None:
    """Write the table, an empty cell where a flight has no number; raise OSError."""
    text = io.StringIO()
    content: Mapping[str, Sequence[Any]] = columns(rows)
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(content)
    writer.writerows(zip(*content.values(), strict=True))
    write_text_atomically(path, text.getvalue())


def _kind(pyarrow: Any, name: str, values: Sequence[Any]) -> Any:
    """Return the type of a column."""
    if name in _WHOLE:
        return pyarrow.int64()
    given = {type(value) for value in values if value is not None}
    if given == {bool}:
        return pyarrow.bool_()
    return pyarrow.float64() if given <= {int, float} and not _is_text(name) else pyarrow.string()


def _is_text(name: str) -> bool:
    """Return True for a column of texts, also if all of them are missing."""
    return name in ("outcome", "outcome_text", "failed", "closest", "log_sha256")
