"""What must be so before any test module is imported."""

from __future__ import annotations

import os

# pymavlink's mavutil reads it once, at its first import, whichever module that is: without it mavutil.mavlink is
# the dialect of version 1, whose messages cannot be signed
os.environ.setdefault("MAVLINK20", "1")
