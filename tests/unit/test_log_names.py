"""Which file over MAVLink FTP is a log of the log protocol, whose lists share no number."""

from __future__ import annotations

import pytest

from flightstack.mavlink.files import Entry
from gcs_cli.clients.log_client import LogEntry
from gcs_cli.transfers.log_calls import file_of


def logs(*sizes: int) -> tuple[LogEntry, ...]:
    return tuple(LogEntry(number, size, 0) for number, size in enumerate(sizes))


def files(*sizes: int) -> tuple[Entry, ...]:
    return tuple(Entry(f"{number}.ulg", size) for number, size in enumerate(sizes))


@pytest.mark.parametrize(
    ("listed", "stored", "number", "name"),
    [
        ((10, 20), (10, 20), 1, "1.ulg"),
        ((10, 10), (10, 10), 1, None),  # the same size
        ((10, 20), (10, 27), 1, "1.ulg"),  # grows
        ((10, 20), (10, 15), 1, None),  # smaller: another file
        ((10, 20), (10, 27, 28), 1, None),
        ((10, 20), (11, 27), 1, None),
        ((10, 20), (), 1, None),
    ],
)
def test_file_of_a_log_is_found_by_its_size(
    listed: tuple[int, ...], stored: tuple[int, ...], number: int, name: str | None
) -> None:
    found = file_of(logs(*listed)[number], logs(*listed), files(*stored))
    assert (None if found is None else found.name) == name
