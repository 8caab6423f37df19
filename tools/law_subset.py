"""The page of docs/reference about C generated from control laws, with the table of refused constructs."""

from __future__ import annotations

import importlib.util
import sys

from flightstack.firmware.generator.subset import ADVICE
from flightstack.firmware.generator.unit import Program
from tools.generated import ROOT

EXAMPLE = ROOT / "examples" / "mission_tests" / "lqr_controller.py"

HEAD = """\
# C from a control law

{note}

`--loops c`, `host`, `emulated` and `serial:DEVICE`, and `gcs pil`, fly a
[controller of your own](../tutorials/controller.md) in C: the firmware's sources are copied to
`~/.cache/flightstack/firmware/laws/<name>-<hash>`, the law is written into `core` there, compiled with all warnings as
errors, and built for the target. `gcs pil generate --controller NAME` writes the same folder to
`build/firmware-<name>`, for a board. With `double` the C has the bits of Python.

## Subset

Functions marked `@compiled`, with annotations. Types come from annotations and NamedTuples.

| Python | C |
|---|---|
| `float`, `int`, `bool` | `fs_real` (float on a target), `int32_t`, `bool` |
| NamedTuple | `struct`, by `const` pointer; prefix `fs_`, or the name of your package |
| `Annotated[FloatArray, 3, 4]`; `np.zeros(3)` | array of that size; local array |
| array or nested tuple of floats of a module | `static const` table |
| `Annotated[FloatArray, "rotors"]` | array of `FS_MAX_ROTORS` with the number of rotors beside it |
| one result; several results | value; pointers `<name>_out`, none of them to an argument |
| `a = state.attitude` | pointer, if neither changes |
| assignment to a parameter `x` | variable `new_x` |
| constant of a module | `#define` with the prefix; π is `FS_PI` |
| `if`, conditional expression, `and`, `or`, `not`, chained comparison | the same |
| `for i in range(…)`, `break`, `continue` | `for`; bounds are constants, sizes of arrays, variables of outer loops |
| `min`, `max` | `fs_min`, `fs_max`: the first unless a later one is beyond it |
| `abs`, `math.sqrt`, `isfinite`, `isnan`, `floor`, `copysign`, `ldexp`, `frexp` | `fs_…`, equal on every processor |
| functions of `flightstack.core.portable_math` and `geometry` | generated along |
| `_private` function | `static` |
| docstring, comments | comments, in ASCII; each function names its line of Python |

Division by zero gives infinity or NaN, as in compiled Python. `math.floor` of NaN is NaN, and −2⁶³ in compiled
Python. `int` of a float saturates at 2³¹ in C. The sign of a NaN, which `copysign` reads, depends on the processor.

## Refused

A construct outside the subset is refused with file, line and advice:

```text
gcs: --controller: lqr: has no C: lqr_controller.py:40: power: write `x * x`, or `exp(y * log(x))` of …
```

| construct | instead |
|---|---|
"""


def subset_page(note: str) -> str:
    """Return the page."""
    rows = (f"| {construct} | {advice.replace('|', chr(92) + '|')} |" for construct, advice in ADVICE.items())
    link = "[the tutorial's LQR](../tutorials/controller.md)"
    example = f"\n## Example\n\nThe step of {link}:\n\n```c\n{lqr_source()}```\n"
    return HEAD.replace("{note}", note) + "\n".join(rows) + "\n" + example


def lqr_source() -> str:
    """Return the C of the example's controller."""
    spec = importlib.util.spec_from_file_location("lqr_controller", EXAMPLE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["lqr_controller"] = module
    spec.loader.exec_module(module)
    program = Program()
    program.add(module.step)
    (unit,) = (unit for unit in program.written() if unit.module == "lqr_controller")
    return unit.source()
