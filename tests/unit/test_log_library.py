"""The folder of logs: what it shows, and what it never gives away."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from flightstack.mavlink.files import Entry
from flightstack.process import log_library
from flightstack.process.log_files import LogFiles, default_log
from flightstack.process.log_library import LogLibrary, create_log_file
from flightstack.services.logs.log_store import DatedLogs, FlatLogs, LogInfo


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
    assert logs == (LogInfo("c.ulg", 5, 1_000), LogInfo("b.ulg", 6, 2_000), LogInfo("a.ulg", 7, 90_000))


def test_a_folder_that_is_not_there_has_no_logs(tmp_path: Path) -> None:
    library = LogLibrary(tmp_path / "none")
    assert library.logs() == ()
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
    assert library.logs() == ()


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


class Clock:
    """Stands for the module ``time``, and counts the looks at the disk."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_s = 1e6
        self.listed = self.examined = 0
        scandir, status = os.scandir, os.stat
        monkeypatch.setattr(log_library.time, "time", lambda: self.now_s)

        def count_listed(*words: object) -> object:
            self.listed += 1
            return scandir(*words)  # type: ignore[call-overload]

        def count_examined(*words: object, **options: object) -> os.stat_result:
            self.examined += 1
            return status(*words, **options)  # type: ignore[arg-type]

        monkeypatch.setattr(log_library.os, "scandir", count_listed)
        monkeypatch.setattr(log_library.os, "stat", count_examined)

    def take(self) -> tuple[int, int]:
        """Return how often the folder was listed, and a file examined, since the last call."""
        taken = self.listed, self.examined - 1  # the folder itself
        self.listed = self.examined = 0
        return taken


@pytest.fixture
def hundred(tmp_path: Path) -> Path:
    for number in range(100):
        write(tmp_path / f"{number:04}.ulg", b"log", 1_000 + number)
    os.utime(tmp_path, (1_000, 1_000))
    return tmp_path


def test_a_list_of_logs_examines_the_folder_once_an_interval(
    hundred: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = Clock(monkeypatch)
    library = LogLibrary(hundred)
    first = library.logs()
    assert (len(first), clock.take()) == (100, (1, 100))
    assert all(library.logs() is first for _ in range(118))
    assert clock.take() == (0, -1)
    clock.now_s += log_library.SCAN_INTERVAL_S
    assert library.logs() is first
    assert clock.take() == (0, 0)


def test_changes_by_other_programs_show_in_the_next_interval(
    hundred: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = Clock(monkeypatch)
    library = LogLibrary(hundred)
    library.logs()
    (hundred / "0007.ulg").unlink()
    write(hundred / "new.ulg", b"new", int(clock.now_s))
    write(hundred / "copy", b"longer log", 1_001)
    (hundred / "copy").rename(hundred / "0001.ulg")
    os.utime(hundred, (2_000, 2_000))
    clock.take()
    clock.now_s += log_library.SCAN_INTERVAL_S
    logs = {log.name: log.size for log in library.logs()}
    assert (len(logs), logs["new.ulg"], logs["0001.ulg"]) == (100, 3, 10)
    assert clock.take() == (1, 2)
    write(hundred / "new.ulg", b"it grows", int(clock.now_s))
    clock.now_s += log_library.SCAN_INTERVAL_S
    assert library.logs()[-1] == LogInfo("new.ulg", 8, 1_000_001)


def test_a_log_of_this_process_shows_at_once(hundred: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Clock(monkeypatch)
    own: list[str] = []
    library = LogLibrary(hundred, lambda: own[0] if own else None)
    library.logs()
    write(hundred / "own.ulg", b"begun", 999_999)
    own.append("own.ulg")
    assert library.logs()[-1] == LogInfo("own.ulg", 5, 999_999)
    write(hundred / "own.ulg", b"begun and ended", 1_000_000)
    own.clear()
    assert library.logs()[-1] == LogInfo("own.ulg", 15, 1_000_000)


def test_an_overwritten_log_shows_its_new_size(hundred: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock(monkeypatch)
    own: list[str] = []
    library = LogLibrary(hundred, lambda: own[0] if own else None)
    library.logs()
    own.append("0007.ulg")
    with create_log_file(hundred / "0007.ulg", overwrite=True) as log:
        log.write(b"a new log in the same file")
        os.utime(hundred / "0007.ulg", (1_000_000, 1_000_000))
    assert library.logs()[-1] == LogInfo("0007.ulg", 26, 1_000_000)
    clock.take()
    assert library.logs()[-1].size == 26
    assert clock.take() == (0, -1)


@pytest.mark.parametrize("ends", [False, True])
def test_the_open_log_shows_its_size_after_a_pause(
    hundred: Path, monkeypatch: pytest.MonkeyPatch, ends: bool
) -> None:
    clock = Clock(monkeypatch)
    own: list[str] = ["own.ulg"]
    write(hundred / "own.ulg", b"begun", 1_000_000)
    library = LogLibrary(hundred, lambda: own[0] if own else None)
    library.logs()
    clock.now_s += 70.0
    library.logs()
    write(hundred / "own.ulg", b"begun, paused, grown", 1_000_070)
    if ends:
        own.clear()
    else:
        clock.now_s += log_library.SCAN_INTERVAL_S
    assert library.logs()[-1] == LogInfo("own.ulg", 20, 1_000_070)


def test_an_old_log_that_another_process_grows_shows_its_size_in_a_minute(
    hundred: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = Clock(monkeypatch)
    library = LogLibrary(hundred)
    library.logs()
    write(hundred / "0007.ulg", b"paused and grown", 1_000_030)
    clock.now_s += log_library.RECENT_S
    assert library.logs()[-1] == LogInfo("0007.ulg", 16, 1_000_030)


def test_a_log_begun_during_an_erase_is_locked(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The file is examined the very moment when its writer wants the lock."""
    path, library = folder / "b.ulg", LogLibrary(folder)
    examiner = library.open("b.ulg")
    assert examiner is not None
    assert examiner.claim()
    monkeypatch.setattr(log_library.time, "sleep", lambda _: examiner.close())
    with create_log_file(path, overwrite=True) as log:
        log.write(b"in flight")
        assert library.erase() == 2
        assert path.read_bytes() == b"in flight"


def test_a_log_erased_before_its_lock_is_begun_again(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = folder / "b.ulg"
    examiner = LogLibrary(folder).open("b.ulg")
    assert examiner is not None
    assert examiner.claim()

    def erase(_: float) -> None:
        path.unlink(missing_ok=True)
        examiner.close()

    monkeypatch.setattr(log_library.time, "sleep", erase)
    with create_log_file(path, overwrite=True) as log:
        log.write(b"in flight")
        assert path.read_bytes() == b"in flight"


def test_a_lock_of_another_program_does_not_hold_up_a_log(folder: Path) -> None:
    examiner = LogLibrary(folder).open("b.ulg")
    assert examiner is not None
    assert examiner.claim()
    with create_log_file(folder / "b.ulg", overwrite=True) as log:
        log.write(b"in flight")
    examiner.close()
    assert (folder / "b.ulg").read_bytes() == b"in flight"
