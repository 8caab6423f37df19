"""The folder of logs: what it shows, and what it never gives away."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from flightstack.logging.log_files import LogFiles, default_log
from flightstack.logging.log_library import LogLibrary, create_log_file
from flightstack.mavlink.services.log_store import DatedLogs, FlatLogs, LogInfo
from flightstack.mavlink.services.virtual_files import Entry


def write(path: Path, data: bytes, time_s: int) -> Path:
    path.write_bytes(data)
    os.utime(path, (time_s, time_s))
    return path


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    inside = tmp_path / "logs"
    inside.mkdir()
    write(inside / "b.ulg", b"second", 2_000)
    write(inside / "a.ulg", b"third!!", 90_000)
    write(inside / "c.ulg", b"first", 1_000)
    write(inside / "notes.txt", b"no log", 1_000)
    write(inside / ".hidden.ulg", b"no log", 1_000)
    write(inside / "tab\t.ulg", b"no name for the wire", 1_000)
    write(tmp_path / "secret.ulg", b"secret", 1_000)
    (inside / "link.ulg").symlink_to(tmp_path / "secret.ulg")
    (inside / "directory.ulg").mkdir()
    os.mkfifo(inside / "pipe.ulg")
    return inside


def test_logs_are_listed_from_the_oldest_on(folder: Path) -> None:
    logs = LogLibrary(folder).logs()
    assert logs == [LogInfo("c.ulg", 5, 1_000), LogInfo("b.ulg", 6, 2_000), LogInfo("a.ulg", 7, 90_000)]


def test_a_folder_that_is_not_there_has_no_logs(tmp_path: Path) -> None:
    library = LogLibrary(tmp_path / "none")
    assert library.logs() == []
    assert library.open("a.ulg") is None
    assert library.erase() == 0


def test_a_log_is_read_from_anywhere(folder: Path) -> None:
    reader = LogLibrary(folder).open("b.ulg")
    assert reader is not None
    assert (reader.size, reader.read(0, 99), reader.read(2, 3), reader.read(9, 9)) == (
        6,
        b"second",
        b"con",
        b"",
    )
    reader.close()
    reader.close()


def test_a_log_that_grows_keeps_the_size_it_had(folder: Path) -> None:
    reader = LogLibrary(folder).open("b.ulg")
    assert reader is not None
    with open(folder / "b.ulg", "ab") as file:
        file.write(b" and more")
    assert reader.read(0, 99) == b"second"
    reader.close()


@pytest.mark.parametrize(
    "name",
    [
        "../secret.ulg",
        "link.ulg",
        "directory.ulg",
        "pipe.ulg",
        "notes.txt",
        ".hidden.ulg",
        "",
        "x/../b.ulg",
        "none.ulg",
    ],
)
def test_nothing_but_logs_of_the_folder_is_opened(folder: Path, name: str) -> None:
    assert LogLibrary(folder).open(name) is None
    assert LogLibrary(folder).open(str(folder.parent / "secret.ulg")) is None


def test_erasing_keeps_the_open_log_and_all_that_is_none(folder: Path) -> None:
    library = LogLibrary(folder)
    with create_log_file(folder / "new.ulg") as log, create_log_file(folder / "a.ulg", overwrite=True):
        log.write(b"in flight")
        assert library.erase() == 2
        assert {log.name for log in library.logs()} == {"a.ulg", "new.ulg"}
    assert (folder / "notes.txt").exists()
    assert (folder / "link.ulg").is_symlink()
    assert (folder.parent / "secret.ulg").read_bytes() == b"secret"
    assert library.erase() == 2
    assert library.logs() == []


def test_logs_as_directories(folder: Path) -> None:
    library = LogLibrary(folder)
    dated, flat = DatedLogs(library), FlatLogs(library)
    assert flat.list("") == [Entry("c.ulg", 5), Entry("b.ulg", 6), Entry("a.ulg", 7)]
    assert flat.list("b.ulg") is None
    assert dated.list("") == [Entry("1970-01-01", None), Entry("1970-01-02", None)]
    assert dated.list("1970-01-02") == [Entry("a.ulg", 7)]
    assert dated.list("1970-01-03") is None
    opened = dated.open("1970-01-02/a.ulg")
    assert opened is not None
    assert opened.read(0, 9) == b"third!!"
    opened.close()
    assert dated.open("1970-01-01/a.ulg") is None
    assert dated.open("a.ulg") is None


def test_each_instance_lists_and_erases_its_own_logs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    paths = [default_log(instance, "20260101-000000") for instance in (0, 1, 11)]
    assert paths[0] == Path("runs/20260101-000000-flight.ulg")
    libraries = []
    for path in paths:
        files = LogFiles(path)
        for _ in range(2):
            log = files.open(rotors=4)
            assert log is not None
            log.close()
        libraries.append(LogLibrary(path.parent))
    names = ["20260101-000000-flight-2.ulg", "20260101-000000-flight.ulg"]
    for library in libraries:
        assert sorted(log.name for log in library.logs()) == names
    assert libraries[0].erase() == 2
    assert [len(library.logs()) for library in libraries] == [0, 2, 2]
