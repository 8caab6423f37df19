"""Files that are written whole or not at all, and never over a file that the user did not mean."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from flightstack.core import atomic_file
from flightstack.core.atomic_file import (
    OWNER_ONLY,
    check_creatable,
    check_new,
    replacing,
    write_bytes_atomically,
    write_text_atomically,
)
from flightstack.core.errors import ConfigError


def test_a_replaced_file_leaves_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    write_text_atomically(path, "old")
    write_text_atomically(path, "new")
    assert path.read_text() == "new"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_temporary_names_are_unpredictable_and_new(tmp_path: Path) -> None:
    path = tmp_path / "film.mp4"
    names = set()
    for _ in range(3):
        with replacing(path) as temporary:
            names.add(temporary.name)
            assert temporary.stat().st_size == 0
            assert temporary.suffix == ".mp4"
    assert len(names) == 3


def test_a_temporary_name_that_is_taken_is_not_written_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(atomic_file.secrets, "token_hex", lambda _: "guessed")
    victim = tmp_path / "victim"
    victim.write_text("precious")
    (tmp_path / ".guessed.a.txt").symlink_to(victim)
    with pytest.raises(FileExistsError):
        write_text_atomically(tmp_path / "a.txt", "new")
    assert victim.read_text() == "precious"


def test_modes_follow_the_umask_or_keep_a_key_private(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        write_bytes_atomically(tmp_path / "open", b"")
        write_bytes_atomically(tmp_path / "key", b"", OWNER_ONLY)
    finally:
        os.umask(before)
    assert (tmp_path / "open").stat().st_mode & 0o777 == 0o640
    assert (tmp_path / "key").stat().st_mode & 0o777 == 0o600


def test_the_target_of_a_link_is_replaced_not_the_link(tmp_path: Path) -> None:
    (tmp_path / "target").write_text("old")
    (tmp_path / "link").symlink_to("target")
    write_text_atomically(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "target").read_text() == "new"


def test_a_device_is_written_to_not_replaced() -> None:
    write_text_atomically(Path("/dev/null"), "gone")
    assert Path("/dev/null").is_char_device()
    with pytest.raises(OSError, match="No space left on device") as raised:
        write_text_atomically(Path("/dev/full"), "too much")
    assert (raised.value.errno, raised.value.filename) == (errno.ENOSPC, "/dev/full")


def test_a_pipe_named_by_its_descriptor_is_written_to() -> None:
    """As /dev/stdout and the shell's >(command) name one."""
    reader, writer = os.pipe()
    write_text_atomically(Path(f"/dev/fd/{writer}"), "words")
    os.close(writer)
    assert os.read(reader, 99) == b"words"
    os.close(reader)


def test_a_file_behind_a_descriptor_is_written_to_not_replaced(tmp_path: Path) -> None:
    """As /dev/stdout is one after `gcs ... > file`: later output must go to the same file."""
    with open(tmp_path / "output", "ab") as output:
        write_text_atomically(Path(f"/dev/fd/{output.fileno()}"), "words")
        output.write(b" and more")
    assert (tmp_path / "output").read_text() == "words and more"


@pytest.mark.parametrize("mode", [0o600, 0o664, 0o755])
def test_replaced_file_keeps_permissions(tmp_path: Path, mode: int) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")
    path.chmod(mode)
    write_text_atomically(path, "new")
    assert (path.read_text(), path.stat().st_mode & 0o777) == ("new", mode)
    write_bytes_atomically(path, b"key", OWNER_ONLY)
    assert path.stat().st_mode & 0o777 == 0o600


def test_a_failed_write_keeps_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")

    def fail(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(atomic_file.os, "fsync", fail)
    with pytest.raises(OSError, match="No space left") as raised:
        write_text_atomically(path, "new")
    assert raised.value.filename == str(path)
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.txt"]


@pytest.mark.parametrize("has_name", [True, False])
def test_a_write_error_names_the_file_not_its_temporary_one(has_name: bool, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with pytest.raises(OSError, match="No space left") as raised, replacing(path) as temporary:
        raise OSError(errno.ENOSPC, "No space left on device", *([str(temporary)] if has_name else []))
    assert raised.value.filename == str(path)


def test_an_error_of_another_file_keeps_its_name(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError) as raised, replacing(tmp_path / "a.mcap"):
        (tmp_path / "missing").read_text()
    assert raised.value.filename == str(tmp_path / "missing")


def test_a_temporary_file_that_cannot_be_made_is_not_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(path: Path, *_: object) -> None:
        raise OSError(errno.EROFS, "Read-only file system", str(path))

    monkeypatch.setattr(atomic_file.os, "open", fail)
    with pytest.raises(OSError, match="Read-only") as raised, replacing(tmp_path / "a.mcap"):
        pass
    assert raised.value.filename == str(tmp_path / "a.mcap")


def test_an_existing_file_is_refused_unless_it_may_be_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    check_new(path, overwrite=False)
    path.write_text("mine")
    check_new(path, overwrite=True)
    with pytest.raises(ConfigError, match=r"a.txt: exists already: name another file or give --overwrite$"):
        check_new(path, overwrite=False)


@pytest.mark.parametrize(
    ("name", "is_folder", "reason"),
    [
        ("folder", False, "Is a directory"),
        ("file/a.txt", False, "Not a directory"),
        ("file", True, "Not a directory"),
        ("closed/new/a.txt", False, "Permission denied"),
        ("closed", True, "Permission denied"),
    ],
)
def test_a_file_that_cannot_be_created_is_refused(
    name: str, is_folder: bool, reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for folder in ("folder", "closed"):
        (tmp_path / folder).mkdir()
    (tmp_path / "file").touch()
    monkeypatch.setattr(os, "access", lambda path, _mode: Path(path).name != "closed")  # root may write there
    with pytest.raises(ConfigError, match=f"{name}: cannot be written: {reason}$"):
        check_creatable(tmp_path / name, is_folder=is_folder)
    for free, is_one in (("file", False), ("folder", True), ("new/a.txt", False), ("folder/new", True)):
        check_creatable(tmp_path / free, is_folder=is_one)


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("dangling", "No such file or directory"),
        ("loop", "Too many levels of symbolic links"),
        ("dangling/new.txt", "No such file or directory"),
        ("loop/new.txt", "Too many levels of symbolic links"),
        ("é" * 128, "File name too long"),
        (f"new/{'a' * 256}/b.txt", "File name too long"),
    ],
)
def test_a_bad_link_and_a_long_name_are_refused(name: str, reason: str, tmp_path: Path) -> None:
    (tmp_path / "dangling").symlink_to("missing")
    (tmp_path / "loop").symlink_to("loop")
    for is_folder in (False, True):
        with pytest.raises(ConfigError, match=f"cannot be written: {reason}$"):
            check_creatable(tmp_path / name, is_folder=is_folder)
    check_creatable(tmp_path / ("a" * 255))


def test_a_device_can_be_written() -> None:
    check_creatable(Path(os.devnull))
