"""Setups of loops on a target, for tests of the link."""

from __future__ import annotations

import math

import numpy as np

from flightstack.control.attitude_pid import CONTROLLER as PID
from flightstack.firmware.c_loops import CLoops, HostLoops, LoopsSetup
from flightstack.firmware.toolchain.build import host_library
from flightstack.params.gains_file import open_gains
from flightstack.params.vehicle import load_vehicle

HASH = bytes(range(1, 9))
"""What the application of the tests tells."""


def setup(controller=PID) -> LoopsSetup:
    tilt = math.radians(45.0)
    return LoopsSetup(load_vehicle("x_quad"), controller, open_gains("tuned"), tilt, 500.0, 100.0, 5)


SPEEDS = np.zeros(8, np.float32)


def sil(controller=PID) -> CLoops:
    of = setup(controller)
    return CLoops("c", HostLoops(host_library(), of.numbers()), of)
