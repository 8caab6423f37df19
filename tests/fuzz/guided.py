"""Coverage-guided fuzz of every link: ``python -m tests.fuzz.guided --seconds 60``, or ``make fuzz SECONDS=60``.

Needs atheris (``pip install atheris``), which is no dependency of the project. Each target of ``tests.fuzz.targets``
runs in a process of its own, so long. Compiled kernels cannot be instrumented and are left out: what
guides the search is the code that takes bytes apart. A script that fails is kept, with a line that says how to see
it fail again.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib.util
import io
import re
import subprocess
import sys
import tempfile
from pathlib import Path

NAMES = ("hub", "simulator", "bridge", "session")
FOUND = Path("build") / "fuzz"
MAX_LENGTH = 4096
TOP = Path(__file__).resolve().parents[2]
_PACKAGES = ("flightstack", "sim_bridge", "gcs_cli")


def fuzz_one(name: str, options: list[str]) -> None:
    """Fuzz one target in this process until libFuzzer's ``options`` say that it is enough."""
    import atheris  # noqa: PLC0415

    hook = atheris.instrument_imports(include=list(_PACKAGES), exclude=compiled_modules())
    with hook, contextlib.redirect_stderr(io.StringIO()):  # one line for each module
        from tests.fuzz import targets  # noqa: PLC0415
    target = targets.TARGETS[name]
    target(b"")  # it may have to compile the kernels, which is no fault of an input
    runs = arrivals = 0

    def one_input(data: bytes) -> None:
        nonlocal runs, arrivals
        arrivals += target(data)
        runs += 1
        if runs % 64 == 0:
            print(f"TRIED {runs} {arrivals}", file=sys.stderr)

    atheris.Setup([sys.argv[0], *options], one_input)
    atheris.Fuzz()


def compiled_modules() -> list[str]:
    """Return the modules that Numba compiles: its input has to be as Python made it."""
    sources = [path for package in _PACKAGES for path in (TOP / package).rglob("*.py")]
    found = [
        path for path in sources if re.search(r"^(from|import) .*(compiled|numba)", path.read_text(), re.M)
    ]
    return [".".join(path.relative_to(TOP).with_suffix("").parts) for path in found]


def fuzz_all(names: tuple[str, ...], seconds: int) -> int:
    """Fuzz each target so long; print what was tried; return the process's exit code."""
    return max(_fuzz_apart(name, seconds) for name in names)


def _fuzz_apart(name: str, seconds: int) -> int:
    FOUND.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        write_corpus(name, Path(folder))
        command = [sys.executable, "-m", "tests.fuzz.guided", "--target", name, folder]
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
    """Write the scripts to begin with, by a process that is not instrumented."""
    from tests.fuzz.corpus import SCRIPTS  # noqa: PLC0415

    for number, script in enumerate(SCRIPTS[name]()):
        (folder / f"{number:04}").write_bytes(script)


def replay(name: str, paths: list[str]) -> None:
    """Run kept scripts, without atheris."""
    from tests.fuzz.targets import TARGETS  # noqa: PLC0415

    for path in paths:
        TARGETS[name](Path(path).read_bytes())


def main() -> int:
    """Read the arguments and fuzz."""
    if sys.argv[1:2] == ["--target"]:
        fuzz_one(sys.argv[2], sys.argv[3:])
        return 0
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
