"""Process between a test and a vehicle's processes: it ends them when its standard input is closed.

The kernel closes that pipe when the test's process ends, by whatever signal. It closes the pipes to the vehicle's
processes too when the guard itself is killed.
Usage: ``python -m flightstack.testing.server_guard FOLDER SIMULATOR STACK``, the latter two as JSON lists of arguments.
"""

from __future__ import annotations

import json
import select
import signal
import sys
from pathlib import Path

from gcs_cli.fly.processes import Child, Children, prepare
from gcs_cli.run_directory import SIMULATOR, STACK

_LISTENS = {SIMULATOR: b", speed ", STACK: b"; simulator "}
"""Part of the line that each process prints when it has its ports."""
_STEP_S = 0.05
_EXPLAINED_S = 5.0
"""Time in which the end of one process ends the other one."""


class _Guard:
    """Runs the processes as long as they live and standard input is open."""

    def __init__(self, children: Children) -> None:
        self._children = children

    def wait_for_ports(self, child: Child, folder: Path) -> bool:
        """Wait until ``child`` has printed that it listens; return False if it is over."""
        log = folder / f"{child.name}.log"
        while _LISTENS[child.name] not in log.read_bytes():
            if not self.step():
                return False
        return True

    def step(self) -> bool:
        """Wait for a moment; return False if standard input is closed or a process has ended."""
        is_closed = bool(select.select([sys.stdin], [], [], _STEP_S)[0])
        return not is_closed and not self._children.ended()


def main(folder: Path, simulator: list[str], stack: list[str]) -> str:
    """Run both processes; return why they ended, empty if standard input was closed."""
    with prepare("flightstack") as prepared, Children(folder, prepared) as children:
        guard = _Guard(children)
        # the simulator's port is the lock of an instance: no flight stack may connect to the simulator of another test
        first = children.start(SIMULATOR, "sim_bridge", simulator)
        if guard.wait_for_ports(first, folder):
            second = children.start(STACK, "flightstack", stack)
            if guard.wait_for_ports(second, folder):
                print("ready", flush=True)
                while guard.step():
                    pass
        culprit = children.culprit(_EXPLAINED_S) if children.ended() else None
        return "" if culprit is None else culprit.end_reason


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())
    reason = main(Path(sys.argv[1]), json.loads(sys.argv[2]), json.loads(sys.argv[3]))
    if reason:
        print(reason, flush=True)
