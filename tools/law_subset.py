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
| NamedTuple | `struct`, by pointer; prefix `fs_`, or the name of your package |
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

Memory and parameters of a law hold floats. Arrays stand in other NamedTuples, such as the state of an estimator.

## Arrays

An estimator keeps vectors and matrices in NamedTuples of arrays with constant shapes, and writes them in place:

```python
STATES = 24


class Filter(NamedTuple):
    x: Annotated[FloatArray, STATES]
    covariance: Annotated[FloatArray, STATES, STATES]


@compiled
def add_noise(filter: Filter, variance: Annotated[FloatArray, STATES], dt_s: float) -> None:
    p = filter.covariance
    for i in range(STATES):
        p[i, i] += variance[i] * dt_s
```

```c
void my_add_noise(my_filter *filter, const fs_real variance[24], fs_real dt_s)
{
    for (int32_t i = 0; i < 24; i++) {
        filter->covariance[i][i] += variance[i] * dt_s;
    }
}
```

* Shapes are numbers or constants of the module, in the annotation. Arrays are `float64` in Python.
* `FloatArray` alone is an array of any size; a function that reads `row.size` has a parameter `row_size` in C.
* Loops run over constants, sizes and variables of outer loops, such as `range(row + 1)` for a triangle, and over
  integer parameters for which every caller gives such a number, `range(at, at + count)`.
* Integers stand in `Annotated[np.ndarray[tuple[int], np.dtype[np.int64]], N]`; C has 32 bits of each.
* A parameter is `const` in C unless the function, or one that it calls, writes to its arrays.
* `p = filter.covariance` and `row = p[i]` are names of the same array, `np.zeros((3, 3))` and `np.empty(3)` new ones.
* Slices and whole-array arithmetic are refused: sums have a written order, and so the same bits everywhere.

A NumPy record keeps the whole memory of an estimator. A NamedTuple declares it: `dtype_of` in
`flightstack.core.record_types` gives its dtype, and the generator its structure, with the same names.

```python
class Memory(NamedTuple):
    params: Params  # floats: a row of the record
    filter: Filter  # arrays: fields of the record, a structure within that of C
    means: Annotated[FloatArray, 5, 7]
    time_s: float
    flags: Annotated[Record, Flags]  # a record in the record
    sensors: Annotated[RecordArray, Sensor, 3]


MEMORY = dtype_of(Memory)


@compiled
def step(memory: Annotated[RecordArray, Memory]) -> None:
    m = memory[0]
    params = Params(*as_tuple(m["params"], len(Params._fields)))
    add_noise(Filter(m["x"], m["covariance"]), m["means"][0], params.dt_s)
    sensor = m["sensors"][1]
    if m["flags"]["landed"] == 0:
        sensor["fused_s"] = m["time_s"]
```

* C has no copies: `m` is `memory`, `params` is `&memory->params`, and `Filter(…)` is `&memory->filter`.
* A function may return such a part of its only parameter, `filter_of(m)`; C takes the part at once.
* Fields `float` and `int` are numbers, which are read and written by name. `Annotated[Record, Flags]` is a structure in
  C, `Annotated[RecordArray, Sensor, 3]` an array of them; `sensor` is `&memory->sensors[1]`.
* `Annotated[Record, Memory]` is one record, `Annotated[RecordArray, Memory]` an array of one, of which `[0]` is taken.

`firmware/core/estimation` is the whole estimator, generated by `python -m firmware.tools.generate_core`.
`tests/parity/generated_filter.py` has a Kalman filter of attitude and gyro bias, and the propagation and
fusion of 24 states. `test_generated_estimator.py` translates prediction, fusion and alignment of
`flightstack/estimation`, with the bits of Python.

## Numbers

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
