"""Write docs/reference/pil-faults.md: ``python -m tools.pil_faults``, half a minute. A test replays the faults too."""

from __future__ import annotations

import tempfile
from pathlib import Path

from tools.generated import ROOT, write_or_check
from tools.pil_faults.page import page
from tools.pil_faults.planted import PlantedCore, faults, findings

PAGE = ROOT / "docs" / "reference" / "pil-faults.md"

with tempfile.TemporaryDirectory() as folder:
    raise SystemExit(write_or_check({PAGE: page(findings(PlantedCore(Path(folder) / "firmware"), faults()))}))
