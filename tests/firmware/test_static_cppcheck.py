"""cppcheck over the portable firmware and the F28377S port: chars and ints of 16 bits, and MISRA C:2012."""

from __future__ import annotations

import json
import re
import shutil
import sys
import tomllib
from fnmatch import fnmatch
from pathlib import Path
from typing import NamedTuple

import pytest

from flightstack.firmware.generator.unit import Program, write
from tests.firmware.kept_builds import kept_text
from tests.firmware.static_support import (
    CPPCHECK,
    FIRMWARE,
    OWN_DRIVERLIB,
    PORTABLE,
    code_lines,
    run,
    tools_files,
)
from tests.parity import generated_laws
from tests.support.tools import missing

CHECKED = (*PORTABLE, "sensing", "ports/bare", "ports/f28377s")
TEMPLATE = "{file}|{line}|{id}|{message}"
BUILD = [
    *("--std=c99", f"--platform={CPPCHECK / 'c28x.xml'}", f"-I{CPPCHECK / 'include'}"),
    *("-D__TMS320C28XX__", "-DCPU1", "-D_LAUNCHXL_F28377S", "-U__GNUC__", "-UFS_DOUBLE", "-U__cplusplus"),
]
"""As cl2000 would see the sources; a -D also keeps cppcheck from trying other configurations."""
CHECKS = [
    *("--enable=warning,style,performance,portability", f"--template={TEMPLATE}", "--quiet", "-j2"),
    f"--addon-python={sys.executable}",  # else it starts python3 twice for each file, to find out whether there is one
]
MISRA = "misra-c2012-"


class Finding(NamedTuple):
    """A line that cppcheck has something to say of."""

    file: str
    """Path below firmware/."""
    line: int
    rule: str
    message: str


class Deviation(NamedTuple):
    """What may stay as it is."""

    rule: str
    files: list[str]
    reason: str

    def covers(self, finding: Finding) -> bool:
        return finding.rule.removeprefix(MISRA) == self.rule and any(
            fnmatch(finding.file, f) for f in self.files
        )


def cppcheck(root: Path, *arguments: str | Path) -> list[Finding]:
    """Run cppcheck; paths of findings are told below ``root``."""
    if not shutil.which("cppcheck"):
        missing("no cppcheck on this machine")
    done = run(["cppcheck", *BUILD, *CHECKS, *arguments])
    assert done.returncode == 0, done.stdout
    found = []
    for line in done.stderr.splitlines():
        file, number, rule, message = line.split("|", 3)
        where = Path(file)
        known = where.is_absolute() and where.is_relative_to(root)
        found.append(
            Finding(where.relative_to(root).as_posix() if known else file, int(number), rule, message)
        )
    return found


LISTED = tomllib.loads((CPPCHECK / "deviations.toml").read_text())


@pytest.fixture(scope="module")
def findings(tmp_path_factory: pytest.TempPathFactory) -> list[Finding]:
    """What cppcheck says of a copy: it writes files beside the sources, where two runs would meet."""
    if (
        shutil.which("cppcheck")
        and (version := run(["cppcheck", "--version"]).stdout.split()[-1]) != LISTED["cppcheck"]
    ):
        missing(f"the deviations are listed for cppcheck {LISTED['cppcheck']}, this is {version}")
    root = tmp_path_factory.mktemp("firmware")
    for name in CHECKED:
        shutil.copytree(FIRMWARE / name, root / name, ignore=shutil.ignore_patterns("*.dump", "*.ctu-info"))
    folders = [root / name for name in CHECKED]
    headers = [root / "core" / "estimation", FIRMWARE / "laws"]
    assert [folder.name for folder in folders if not list(folder.glob("*.c"))] == []
    includes = [f"-I{folder}" for folder in (*folders, *headers)]
    not_ours = [
        f"--suppress=*:{folder}/*" for folder in (OWN_DRIVERLIB, CPPCHECK / "include", FIRMWARE / "laws")
    ]
    words = ["--addon=misra", *includes, f"-I{OWN_DRIVERLIB}", *not_ours, *folders]
    text = kept_text(
        "cppcheck", ("cppcheck",), tools_files(__file__), lambda: json.dumps(cppcheck(root, *words))
    )
    return [Finding(*each) for each in json.loads(text)]


@pytest.fixture(scope="module")
def deviations() -> list[Deviation]:
    return [Deviation(one["rule"], one.get("files", ["*"]), one["reason"]) for one in LISTED["deviation"]]


def test_whatever_is_found_is_listed_with_its_reason(
    findings: list[Finding], deviations: list[Deviation]
) -> None:
    assert len(findings) > 100  # the addon ran
    assert [f for f in findings if not any(d.covers(f) for d in deviations)] == []


def test_no_listed_deviation_is_out_of_date(findings: list[Finding], deviations: list[Deviation]) -> None:
    for deviation in deviations:
        assert len(deviation.reason) > 20
        for pattern in deviation.files:
            narrow = deviation._replace(files=[pattern])
            assert any(narrow.covers(finding) for finding in findings), (deviation.rule, pattern)


LAWS_MAY = {
    "8.7": "A public function of Python is public in C, also if one file uses it.",
    "8.9": "A table of a module stands above the functions, as in Python.",
}


def test_generated_laws_of_users_have_no_other_findings(deviations: list[Deviation], tmp_path: Path) -> None:
    program = Program()
    for law in generated_laws.LAWS.values():
        program.add(law)
    folder = tmp_path / "laws"
    write(program.written(), folder)
    shutil.copy(FIRMWARE / "laws" / "fs_law_math.h", folder)
    others = [f"--suppress=*:{path}/*" for path in (FIRMWARE / "core", CPPCHECK / "include")]
    found = cppcheck(tmp_path, "--addon=misra", f"-I{folder}", f"-I{FIRMWARE / 'core'}", *others, folder)
    assert len(found) > 50
    own = [finding for finding in found if finding.rule.removeprefix(MISRA) not in LAWS_MAY]
    assert [finding for finding in own if not any(d.covers(finding) for d in deviations)] == []


def test_no_source_silences_cppcheck() -> None:
    for folder in CHECKED:
        for path in (FIRMWARE / folder).glob("*.[ch]"):
            assert "cppcheck-suppress" not in path.read_text(), path.name


PLANTED = {
    "shiftTooManyBits": "uint32_t f(uint16_t a) { return (uint32_t)(a << 16); }",
    "integerOverflow": "uint32_t f(uint16_t ms) { int16_t k = 40 * 1000; return (uint32_t)ms + (uint32_t)k; }",
    "truncLongCastReturn": "int32_t f(int16_t a, int16_t b) { return a * b; }",
    "compareValueOutOfTypeRangeError": "uint16_t f(uint16_t a) { return a > 70000UL ? 1U : 0U; }",
    "arrayIndexOutOfBounds": "uint16_t f(uint16_t a) { uint16_t o[8] = {0U}; o[a & 7U] = a; return o[8]; }",
    "uninitvar": "uint16_t f(uint16_t a) { uint16_t b; if (a > 3U) { b = 1U; } return b; }",
}


@pytest.mark.parametrize("rule", PLANTED)
def test_the_check_sees_what_only_16_bits_make_wrong(rule: str, tmp_path: Path) -> None:
    """Without the platform file, or without our stdint.h, the first four would pass."""
    path = tmp_path / "planted.c"
    path.write_text(f"#include <stdint.h>\n{PLANTED[rule]}\n")
    assert rule in [finding.rule for finding in cppcheck(tmp_path, path)]


RECURSIVE = """#include <stdint.h>
uint16_t f(uint16_t n);
uint16_t f(uint16_t n)
{
    if (n == 0U)
        return 1U;
    return (uint16_t)(n * f((uint16_t)(n - 1U)));
}
"""


def test_the_misra_check_is_awake(tmp_path: Path) -> None:
    path = tmp_path / "planted.c"
    path.write_text(RECURSIVE)
    rules = {finding.rule.removeprefix(MISRA) for finding in cppcheck(tmp_path, "--addon=misra", path)}
    assert {"15.6", "17.2"} <= rules  # no braces; recursion


def test_the_platform_is_a_c28x() -> None:
    text = (CPPCHECK / "c28x.xml").read_text()
    sizes = dict(re.findall(r"<([\w-]+)>(\d+)</", text))
    assert (sizes["char_bit"], sizes["int"], sizes["long"], sizes["float"]) == ("16", "1", "2", "2")
    assert not any("uint8_t" in line for _, line in code_lines(CPPCHECK / "include" / "stdint.h"))
