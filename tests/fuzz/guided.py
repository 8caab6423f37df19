"""Coverage-guided fuzz of every link: ``python -m tests.fuzz.guided --seconds 60``, or ``make fuzz SECONDS=60``.

Needs atheris (``pip install atheris``), which is no dependency of the project. Each target of ``tests.fuzz.targets``
runs in a process of its own (``tests.fuzz.instrumented``), so long. A script that fails is kept, with a line that says
how to see it fail again.
"""

from __future__ import annotations

import argparse
import importlib.util
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.fuzz.corpus import SCRIPTS
from tests.fuzz.targets import TARGETS

NAMES = ("hub", "simulator", "bridge", "session")
FOUND = Path("build") / "fuzz"
MAX_LENGTH = 4096


def fuzz_all(names: tuple[str, ...], seconds: int) -> int:
    """Fuzz each target so long; print what was tried; return the process's exit code."""
    return max(_fuzz_apart(name, seconds) for name in names)


def _fuzz_apart(name: str, seconds: int) -> int:
    FOUND.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        write_corpus(name, Path(folder))
        command = [sys.executable, "-m", "tests.fuzz.instrumented", name, folder]
        limits = [f"-max_total_time={seconds}", f"-max_len={MAX_LENGTH}", "-timeout=20", "-rss_limit_mb=2048"]
        kept = f"-artifact_prefix={FOUND}/{name}-"
        with subprocess.Popen(
            [*command, *limits, kept], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        ) as child:
            assert child.stdout is not None
            tail, runs, arrivals, status = [], "0", "0", ""
            for line in child.stdout:
                if line.startswith("TRIED"):
                    _, runs, arrivals = line.split()
                elif match := re.search(r"cov: \d+ ft: \d+ corp: \d+", line):
                    status = match.group()
                tail = [*tail[-60:], line]
        inputs = re.search(r"Done (\d+) runs", "".join(tail))
        runs = inputs.group(1) if inputs else runs
        print(
            f"{name}: {int(runs):,} scripts, {int(arrivals):,} arrivals in {seconds} s; {status}", flush=True
        )
        if child.returncode:
            print("".join(tail), file=sys.stderr)
            print(f"replay: python -m tests.fuzz.guided --replay {name} {FOUND}/{name}-…", file=sys.stderr)
        return int(child.returncode != 0)


def write_corpus(name: str, folder: Path) -> None:
    """Write the scripts to begin with."""
    for number, script in enumerate(SCRIPTS[name]()):
        (folder / f"{number:04}").write_bytes(script)


def replay(name: str, paths: list[str]) -> None:
    """Run kept scripts, without atheris."""
    for path in paths:
        TARGETS[name](Path(path).read_bytes())


def main() -> int:
    """Read the arguments and fuzz."""
    parser = argparse.ArgumentParser(description="Coverage-guided fuzz of every link.")
    parser.add_argument("names", nargs="*", help=f"any of {', '.join(NAMES)}; all by default")
    parser.add_argument("--seconds", type=int, default=60, help="for each target")
    parser.add_argument(
        "--replay", metavar="TARGET", choices=NAMES, help="run scripts that were kept: the names"
    )
    arguments = parser.parse_args()
    if arguments.replay:
        replay(arguments.replay, arguments.names)
        return 0
    if importlib.util.find_spec("atheris") is None:
        print("atheris is not installed; install it with: pip install atheris", file=sys.stderr)
        return 2
    names = tuple(arguments.names) or NAMES
    if not set(names) <= set(NAMES):
        parser.error(f"a target is one of {', '.join(NAMES)}")
    return fuzz_all(names, arguments.seconds)


if __name__ == "__main__":
    sys.exit(main())
