"""The mutation run itself: what it compiles, in which order it tries tests, and what it remembers."""

from __future__ import annotations

import signal
import subprocess
from pathlib import Path

import numpy as np
import pytest

from tests.firmware.codec_support import compiler
from tests.mutation.mutants import Mutant, mutants
from tests.mutation.objects import CompileError, Objects, WarningError
from tests.mutation.order import Order
from tests.mutation.results import Results
from tests.mutation.trials import KILLED, LOOPED, SURVIVED, UNTRIED, Verdict, _fate_of

HEADER = "static inline int twice(int x) { return 2 * x; }\n"
SOURCES = {
    "one.c": '#include "twice.h"\nint one(void);\nint one(void) { return twice(1); }\n',
    "other.c": "int other(void);\nint other(void) { return 7; }\n",
}


def mutant(function: str = "f", text: str = "int f(void)\n{\n    return 1 + 1;\n}\n") -> Mutant:
    made = next(mutants("core/example.c", text))
    return made._replace(function=function)


@pytest.fixture
def built(tmp_path: Path) -> Objects:
    """Return the objects of a library of two sources and a header."""
    (tmp_path / "twice.h").write_text(HEADER)
    for name, text in SOURCES.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "objects").mkdir()
    objects = Objects(tmp_path / "objects")
    words = [*compiler(), "-shared", "-fPIC", "-O2", f"-I{tmp_path}", "-o", str(tmp_path / "it.so")]
    objects.run([*words, *(str(tmp_path / name) for name in SOURCES)])
    return objects


@pytest.mark.parametrize(
    ("file", "right", "wrong", "is_same"),
    [
        ("twice.h", "2 * x", "x + x", True),
        ("twice.h", "2 * x", "3 * x", False),
        ("other.c", "7", "7 + 0", True),
        ("other.c", "7", "8", False),
    ],
)
def test_same_object_code_is_no_fault(
    built: Objects, tmp_path: Path, file: str, right: str, wrong: str, is_same: bool
) -> None:
    path = tmp_path / file
    original = path.read_text()
    path.write_text(original.replace(right, wrong))
    built.mutate(path)
    assert built.is_same_code(built.libraries) == is_same
    assert built.is_same_optimised(built.libraries, original) == is_same
    assert built.is_same_code(built.libraries) == is_same


def test_mutant_that_does_not_compile_is_told_from_one_with_a_warning(built: Objects, tmp_path: Path) -> None:
    path = tmp_path / "other.c"
    built.mutate(path)
    path.write_text(SOURCES["other.c"].replace("7;", "7 7;"))
    with pytest.raises(CompileError):
        built.is_same_code(built.libraries)
    path.write_text(SOURCES["other.c"].replace("return", "int unused; return"))
    with pytest.raises(WarningError):
        built.is_same_code(built.libraries)


def test_library_of_a_mutant_has_the_other_objects_as_they_were(built: Objects, tmp_path: Path) -> None:
    kept = sorted((tmp_path / "objects").glob("*.o"))
    before = [path.stat().st_mtime_ns for path in kept]
    (tmp_path / "other.c").write_text(SOURCES["other.c"].replace("7", "8"))
    built.mutate(tmp_path / "other.c")
    words = [*compiler(), "-shared", "-fPIC", "-O2", f"-I{tmp_path}", "-o", str(tmp_path / "mutant.so")]
    built.run([*words, *(str(tmp_path / name) for name in SOURCES)])
    assert (tmp_path / "mutant.so").read_bytes() != (tmp_path / "it.so").read_bytes()
    assert [path.stat().st_mtime_ns for path in kept] == before


def test_commands_that_make_no_library_are_run_as_they_are(tmp_path: Path) -> None:
    done = Objects(tmp_path).run([*compiler(), "--version"], capture_output=True, text=True)
    assert isinstance(done, subprocess.CompletedProcess)
    assert done.stdout


def test_tests_that_found_mutants_nearby_come_first_and_cheap_ones_before_dear_ones() -> None:
    order = Order([0.1, 0.1, 0.01])
    assert order.ranked(mutant()) == [2, 0, 1]
    spent = np.array([np.nan, 0.1, 0.01])
    for _ in range(30):
        order.learn(mutant("f"), spent, 1)
    assert order.ranked(mutant("f"))[0] == 1
    for _ in range(30):
        order.learn(mutant("g"), np.array([0.1, np.nan, 0.01]), 0)
    assert order.ranked(mutant("g"))[0] == 0
    assert order.ranked(mutant("f"))[0] == 1


@pytest.mark.parametrize(
    ("ended_by", "fate"), [(signal.SIGSEGV, KILLED), (signal.SIGPROF, LOOPED), (signal.SIGKILL, UNTRIED)]
)
def test_crash_is_a_find_and_a_kill_by_the_system_is_none(ended_by: int, fate: str) -> None:
    assert _fate_of(ended_by) == fate


def test_results_are_found_again_and_the_last_one_counts(tmp_path: Path) -> None:
    path, tried = tmp_path / "build/results.jsonl", mutant()
    Results(path).add(Verdict(tried, SURVIVED, "", 4.0))
    Results(path).add(Verdict(tried, KILLED, "test_it", 0.2))
    found = Results(path).of(tried)
    assert found is not None
    assert (found.fate, found.test, found.file) == (KILLED, "test_it", "core/example.c")


def test_result_of_another_text_is_unknown(tmp_path: Path) -> None:
    results = Results(tmp_path / "results.jsonl")
    results.add(Verdict(mutant(), KILLED, "test_it", 0.2))
    assert results.of(mutant(text="int f(void)\n{\n    return 1 + 1 + 1;\n}\n")) is None


def test_line_that_was_not_written_to_its_end_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "results.jsonl"
    results = Results(path)
    results.add(Verdict(mutant(), KILLED, "test_it", 0.2))
    path.write_text(path.read_text() + '{"key": "cut')
    again = Results(path)
    assert again.found == results.found
    again.add(Verdict(mutant(text="int f(void) { return 1 + 2; }"), KILLED, "test_it", 0.2))
    assert len(Results(path).found) == 2
