"""A test process that is killed leaves no programs behind: a vehicle in real time would take a core from later runs."""

from __future__ import annotations

import os
import select
import subprocess
import sys

from tests.support.programs import ROOT

CLIENT = """
import sys
from tests.support.programs import Program
program = Program("sim_bridge", ["--port", "0"])
print(program.stdout.readline() and program.pid, flush=True)
sys.stdin.read()
"""


def test_programs_of_a_killed_test_process_end() -> None:
    client = subprocess.Popen(
        [sys.executable, "-c", CLIENT], cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    with client:
        assert client.stdout is not None
        program = os.pidfd_open(int(client.stdout.readline()))
        client.kill()
    assert select.select([program], [], [], 60.0)[0]
    os.close(program)
