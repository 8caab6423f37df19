"""Where the firmware's sources are, the hash that names them, and what compiling them for this machine does."""

from __future__ import annotations

import hashlib
import tomllib
from pathlib import Path
from typing import IO

import pytest

from flightstack.firmware import sources
from flightstack.firmware.toolchain import build
from flightstack.firmware.toolchain.build import BuildError, Compiler

ROOT = Path(__file__).parents[2]
BOARD_PORTS = ("ports/bare", "ports/gnu", "ports/nucleo", "ports/pico2")
COMPILED_HERE = (*sources.PORTABLE, "sensing", "laws", "ports/host", "ports/cortex_m4", *BOARD_PORTS)


def test_a_wheel_holds_all_sources_that_an_installation_compiles() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    included = project["tool"]["hatch"]["build"]["targets"]["wheel"]["force-include"]
    sources_included = {name: place for name, place in included.items() if name.startswith("firmware/")}
    assert sources_included == {
        f"firmware/{folder}": f"flightstack/firmware/c/{folder}" for folder in COMPILED_HERE
    }


def test_in_an_installation_the_sources_are_in_the_package(tmp_path: Path, monkeypatch) -> None:
    package = tmp_path / "flightstack" / "firmware"
    (package / "c").mkdir(parents=True)
    monkeypatch.setattr(sources, "__file__", str(package / "sources.py"))
    assert sources.firmware_root() == package / "c"
    (package / "c").rmdir()
    assert sources.firmware_root() == tmp_path / "firmware"


@pytest.fixture
def root(tmp_path: Path, monkeypatch) -> Path:
    """A firmware of two files."""
    for name, text in (("core/a.c", "int a(void);\n"), ("app/b.h", "int b(void);\n"), ("core/notes.txt", "")):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    monkeypatch.setattr(sources, "firmware_root", lambda: tmp_path)
    monkeypatch.setattr(build, "firmware_root", lambda: tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path


def test_the_hash_is_that_of_paths_and_contents(root: Path) -> None:
    expected = hashlib.sha256(b"app/b.h\x0013\x00int b(void);\ncore/a.c\x0013\x00int a(void);\n").digest()
    assert sources.source_hash() == expected[:8]


@pytest.mark.parametrize("change", ["content", "name", "another"])
def test_another_state_of_the_sources_has_another_hash(root: Path, change: str) -> None:
    before = sources.source_hash()
    if change == "content":
        (root / "core/a.c").write_text("int a(int);\n")
    elif change == "name":
        (root / "core/a.c").rename(root / "core/c.c")
    else:
        (root / "mavlink").mkdir()
        (root / "mavlink/d.h").write_text("")
    assert sources.source_hash() != before


def library(root: Path, compiler: Compiler, *flags: str) -> Path:
    return build.cached("a.so", compiler, ["-shared", "-fPIC", *flags], [root / "core/a.c"])


def test_it_is_compiled_once_for_each_state_and_flags(root: Path) -> None:
    compiler = build.host_compiler()
    first = library(root, compiler)
    assert first.read_bytes()[:4] == b"\x7fELF"
    stamp = first.stat().st_mtime_ns
    assert library(root, compiler) == first
    assert first.stat().st_mtime_ns == stamp
    assert library(root, compiler, "-DX") != first
    assert library(root, compiler._replace(version="another")) != first
    (root / "core/a.c").write_text("int a(int);\n")
    assert library(root, compiler).parent != first.parent


def test_a_process_waits_for_another_one_that_compiles_the_same(root: Path, monkeypatch) -> None:
    def other_is_done(lock: IO[str], _: int) -> None:
        Path(lock.name.replace("/.a-", "/a-").replace(".lock", ".so")).write_text("by another process")

    monkeypatch.setattr(build.fcntl, "flock", other_is_done)
    assert library(root, Compiler(("false",), "none")).read_text() == "by another process"


def test_what_does_not_compile_is_one_sentence_and_leaves_nothing(root: Path) -> None:
    (root / "core/a.c").write_text("int a(void) { return }\n")
    with pytest.raises(
        BuildError, match=r"the firmware does not compile with .*: .*a\.c:1:.* error: "
    ) as caught:
        library(root, build.host_compiler())
    assert "\n" not in str(caught.value)
    assert not list((root / "cache").rglob("*.so*"))


def test_a_compiler_that_is_gone_is_one_sentence(root: Path) -> None:
    with pytest.raises(BuildError, match="cannot be compiled with /no/cc"):
        library(root, Compiler(("/no/cc",), "none"))


def test_without_a_home_to_write_to_it_is_compiled_for_this_process(root: Path, monkeypatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null")
    path = library(root, build.host_compiler())
    assert path.exists()
    assert path.parent.name.startswith("flightstack-firmware-")


def test_the_oldest_states_are_forgotten(root: Path, monkeypatch) -> None:
    monkeypatch.setattr(build, "KEPT_STATES", 2)
    made = []
    for text in ("int a;\n", "int b;\n", "int c;\n"):
        (root / "core/a.c").write_text(text)
        made.append(library(root, build.host_compiler()))
    assert [path.exists() for path in made] == [False, True, True]


def test_cc_names_the_compiler(monkeypatch) -> None:
    build.host_compiler.cache_clear()
    monkeypatch.setenv("CC", "/no/such/compiler")
    assert build.host_compiler().command[0] != "/no/such/compiler"
    build.host_compiler.cache_clear()
    monkeypatch.setenv("CC", "cc -pipe")
    assert build.host_compiler().command == ("cc", "-pipe")
    build.host_compiler.cache_clear()
