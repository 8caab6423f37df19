"""Garbage collection around the start of a program."""

from __future__ import annotations

import gc
import subprocess
import sys

from flightstack.process import collection


def test_nothing_is_collected_during_the_start() -> None:
    assert gc.isenabled()
    with collection.paused():
        assert not gc.isenabled()
    assert gc.isenabled()


END = """
import gc, sys
from flightstack.process import collection

class Loop:
    def __init__(self):
        self.own = self
    def __del__(self):
        print("collected", self.name)

def loop(name):
    Loop().name = name

with collection.paused():
    loop("made at the start")
    collection.resume()
    assert gc.isenabled()
    loop("made in flight")
    gc.collect()
    loop("left at the end")
"""


def test_only_objects_made_in_flight_are_collected() -> None:
    done = subprocess.run([sys.executable, "-c", END], capture_output=True, text=True, check=True)
    assert done.stdout == "collected made in flight\n"
