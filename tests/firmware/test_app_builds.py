"""The firmware's application in other builds: sanitised, measured by gcov, without memory of its own."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.firmware.app_support import FIRMWARE, LIBRARY, PORTABLE, build, cached, sources, words
from tests.firmware.codec_support import compiler
from tests.firmware.kept_builds import kept_build
from tests.support.tools import missing

TESTS = [str(path) for path in sorted(Path(__file__).parent.glob("test_app_*.py")) if path != Path(__file__)]
NEEDLESS = "double"
"""Part of the names of tests that would compile another library."""


def run_tests(library: Path, **environment: str) -> None:
    """Run the application's tests with a library that was compiled in another way."""
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-x",
        "-p",
        "no:cacheprovider",
        "-k",
        f"not {NEEDLESS}",
        *TESTS,
    ]
    done = subprocess.run(
        command, env={**os.environ, LIBRARY: str(library), **environment}, check=False, capture_output=True,
        text=True, timeout=300, cwd=Path(__file__).resolve().parents[2],
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-3_000:] + done.stderr[-3_000:]


@pytest.fixture(scope="module")
def notes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run the tests under both sanitizers; return the folder of gcov's notes and counts, which it leaves.

    The processor itself ends a process that divides by zero: the check of the sanitizer would count as a branch.
    """
    gcc, folder = compiler("gcc"), tmp_path_factory.mktemp("notes")
    flags = [
        *(
            "-fsanitize=address,undefined",
            "-fno-sanitize=integer-divide-by-zero",
            "-fno-sanitize-recover=all",
        ),
        *("--coverage", "-g", "-O0"),
    ]
    library = kept_build("app.so", tuple(gcc), *words(*flags))
    for note in library.parent.glob("*.gcno"):
        shutil.copy(note, folder)
    named = subprocess.run([*gcc, "-print-file-name=libasan.so"], check=True, capture_output=True, text=True)
    sanitizer = {"LD_PRELOAD": named.stdout.strip(), "ASAN_OPTIONS": "detect_leaks=0"}  # Python's own leaks
    run_tests(library, GCOV_PREFIX=str(folder), GCOV_PREFIX_STRIP="99", **sanitizer)
    return folder


def test_nothing_undefined_happens_and_no_memory_is_touched_beyond_its_end(notes: Path) -> None:
    assert list(notes.glob("*.gcda"))


def test_every_line_and_branch_of_the_application_is_run(notes: Path) -> None:
    """No exception is listed: all of firmware/app, both ways of every branch."""
    if not shutil.which("gcov"):
        missing("no gcov on this machine")
    files = [f"app.so-{source.stem}.gcno" for source in sources("app")]
    done = subprocess.run(
        ["gcov", "-b", *files], check=True, capture_output=True, text=True, cwd=notes, timeout=60
    )
    measured = re.findall(r"File '[^']*/app/(\w+\.c)'\nLines executed:([\d.]+)%.*\n(.*\n.*)", done.stdout)
    assert sorted(name for name, _, _ in measured) == [source.name for source in sources("app")]
    wrong = [
        (name, lines, taken)
        for name, lines, branches in measured
        for taken in re.findall(r"Taken at least once:([\d.]+)%", branches) or ["100.00"]
        if (lines, taken) != ("100.00", "100.00")
    ]
    assert wrong == []


def test_the_application_has_no_memory_of_its_own(tmp_path: Path) -> None:
    """No object has anything in .data or .bss: all state is in the structure that the caller owns."""
    if not shutil.which("size"):
        missing("no size on this machine")
    folders = [f"-I{FIRMWARE / folder}" for folder in PORTABLE]
    for source in sources("app"):
        command = [*compiler(), "-std=c99", "-O2", "-c", *folders, str(source), "-o", "part.o"]
        subprocess.run(command, check=True, cwd=tmp_path)
        told = subprocess.run(["size", "part.o"], check=True, capture_output=True, text=True, cwd=tmp_path)
        _text, data, bss, *_ = told.stdout.splitlines()[1].split()
        assert (data, bss) == ("0", "0"), source.name


def test_the_program_compiles_with_every_compiler(tmp_path: Path) -> None:
    """The host's own compiler optimises; the others show their warnings without."""
    cached("fs_host", "-O2", program=True)
    own = Path(shutil.which(compiler()[0]) or "").resolve().name
    for name in ("gcc", "clang"):
        if shutil.which(name) and name not in own:
            build(tmp_path / name, "-O0", cc=[name], program=True)
