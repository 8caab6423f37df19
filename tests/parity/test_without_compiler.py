"""The loops run uncompiled give the same numbers, bit for bit: what one debugs is what flies."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.parity.flight_rows import flight_rows

ROOT = Path(__file__).resolve().parents[2]
TICKS = 600  # 1.2 s: takeoff through guidance, loops and plant


@pytest.mark.parametrize(("vehicle", "controller"), [("paper_quad", "pid"), ("x_quad", "backstepping")])
def test_a_flight_without_numba_has_the_same_bits(vehicle: str, controller: str) -> None:
    command = [sys.executable, "-m", "tests.parity.flight_rows", vehicle, controller, str(TICKS)]
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, check=True)
    plain = np.frombuffer(done.stdout).reshape(TICKS, -1)
    compiled = flight_rows(vehicle, controller, TICKS)
    different = np.argwhere(~((plain == compiled) | (np.isnan(plain) & np.isnan(compiled))))
    assert different.size == 0, f"first difference (tick, column): {different[0]}"
    assert compiled[-1, 2] < -0.3  # it has flown: 0.74 m high
