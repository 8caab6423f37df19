"""Functions that Numba compiles in a way of their own: portable math, and copies between arrays, tuples and bytes.

Compiled from Python, each pair of types of a copy would be a function of its own for Numba, 5 % of the compilation in
all. A call of C, as Numba makes for ``frexp``, keeps LLVM from computing several numbers at once. Kernels that are read
from the cache do without this module.
"""
# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

import importlib
import math
from functools import cache
from typing import Any

import numba
from llvmlite import ir
from numba.core import cgutils
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import register_jitable, type_callable
from numba.np import linalg
from numba.np.arrayobj import load_item, make_array, populate_array, store_item

from flightstack.core import portable_math
from flightstack.core.array_items import as_tuple, local_zeros, put, store


@cache
def register(part_compiler: Any) -> None:
    """Register portable math with the compiler of called functions, once, before Numba's first compilation."""
    _import_without_scipy()
    for function in portable_math.FUNCTIONS:
        register_jitable(error_model="numpy", no_cfunc_wrapper=True, pipeline_class=part_compiler)(function)


def _import_without_scipy() -> None:
    """Import Numba's array functions without their search for BLAS, which imports scipy.linalg and takes 0.2 s.

    A kernel that needs BLAS, such as a plug-in controller, repeats the search when it is compiled.
    """
    search, linalg.ensure_blas = linalg.ensure_blas, lambda: None
    try:
        importlib.import_module("numba.np.arraymath")
    finally:
        linalg.ensure_blas = search


@lower_builtin(math.frexp, numba.types.float64)
def _lower_frexp(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    """Take a number apart by its bits; zero, infinities and NaN stay, with exponent 0."""
    number, word = args[0], ir.IntType(64)
    exponent_mask, bias = word(0x7FF), word(1022)  # with this exponent a number is in [0.5, 1)

    def stored_exponent(of: Any) -> Any:
        return builder.and_(builder.lshr(builder.bitcast(of, word), word(52)), exponent_mask)

    is_subnormal = builder.icmp_unsigned("==", stored_exponent(number), word(0))
    normal = builder.select(is_subnormal, builder.fmul(number, number.type(2.0**54)), number)
    exponent = builder.sub(stored_exponent(normal), bias)
    exponent = builder.select(is_subnormal, builder.sub(exponent, word(54)), exponent)
    fraction = builder.and_(builder.bitcast(normal, word), word(~(0x7FF << 52)))
    mantissa = builder.bitcast(builder.or_(fraction, word(1022 << 52)), number.type)
    stays = builder.or_(
        builder.icmp_unsigned("==", stored_exponent(number), exponent_mask),
        builder.fcmp_ordered("==", number, number.type(0.0)),
    )
    exponent = context.cast(builder, exponent, numba.types.int64, sig.return_type[1])
    parts = builder.select(stays, number, mantissa), builder.select(stays, exponent.type(0), exponent)
    return context.make_tuple(builder, sig.return_type, parts)


def _is_vector(kind: Any) -> bool:
    return isinstance(kind, numba.types.Array) and kind.ndim == 1


@type_callable(as_tuple)
def _type_as_tuple(_: Any) -> Any:
    def result(array: Any, count: Any) -> Any:
        if _is_vector(array) and isinstance(count, numba.types.IntegerLiteral):
            return numba.types.UniTuple(array.dtype, count.literal_value)
        return None

    return result


@type_callable(store)
def _type_store(context: Any) -> Any:
    def result(out: Any, values: Any) -> Any:
        if not (_is_vector(out) and out.mutable):
            return None
        if isinstance(values, numba.types.BaseTuple):
            items = values.types
        elif _is_vector(values):
            items = (values.dtype,)
        else:
            return None
        is_convertible = all(context.can_convert(item, out.dtype) is not None for item in items)
        return numba.types.none if is_convertible else None

    return result


def _pointer(context: Any, builder: Any, array_type: Any, array: Any, index: Any) -> Any:
    return cgutils.get_item_pointer(context, builder, array_type, array, [index])


@lower_builtin(as_tuple, numba.types.Array, numba.types.IntegerLiteral)
def _lower_as_tuple(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    array_type, array = sig.args[0], make_array(sig.args[0])(context, builder, args[0])
    indices = (context.get_constant(numba.types.intp, index) for index in range(sig.return_type.count))
    pointers = [_pointer(context, builder, array_type, array, index) for index in indices]
    items = [load_item(context, builder, array_type, pointer) for pointer in pointers]
    return context.make_tuple(builder, sig.return_type, items)


@lower_builtin(store, numba.types.Array, numba.types.BaseTuple)
def _lower_store_tuple(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    out_type, out = sig.args[0], make_array(sig.args[0])(context, builder, args[0])
    for number, item_type in enumerate(sig.args[1].types):
        item = context.cast(builder, builder.extract_value(args[1], number), item_type, out_type.dtype)
        index = context.get_constant(numba.types.intp, number)
        store_item(context, builder, out_type, item, _pointer(context, builder, out_type, out, index))
    return context.get_dummy_value()


@lower_builtin(store, numba.types.Array, numba.types.Array)
def _lower_store_array(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    (out_type, out), (values_type, values) = (
        (array_type, make_array(array_type)(context, builder, array))
        for array_type, array in zip(sig.args, args, strict=True)
    )
    with cgutils.for_range(builder, cgutils.unpack_tuple(builder, values.shape, 1)[0]) as loop:
        item = load_item(
            context, builder, values_type, _pointer(context, builder, values_type, values, loop.index)
        )
        item = context.cast(builder, item, values_type.dtype, out_type.dtype)
        store_item(context, builder, out_type, item, _pointer(context, builder, out_type, out, loop.index))
    return context.get_dummy_value()


@type_callable(put)
def _type_put(_: Any) -> Any:
    def result(out: Any, at: Any, number: Any) -> Any:
        takes = _is_vector(out) and out.mutable and out.dtype == numba.types.uint8
        is_number = isinstance(number, (numba.types.Integer, numba.types.Float))
        return numba.types.none if takes and is_number and isinstance(at, numba.types.Integer) else None

    return result


@lower_builtin(put, numba.types.Array, numba.types.Integer, numba.types.Number)
def _lower_put(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    out_type, out = sig.args[0], make_array(sig.args[0])(context, builder, args[0])
    at = context.cast(builder, args[1], sig.args[1], numba.types.intp)
    place = builder.bitcast(_pointer(context, builder, out_type, out, at), args[2].type.as_pointer())
    builder.store(args[2], place, align=1)
    return context.get_dummy_value()


@infer_global(local_zeros)
class _LocalZeros(AbstractTemplate):  # type: ignore[misc]  # Numba has no types
    def generic(self, args: tuple[Any, ...], kws: dict[str, Any]) -> Any:
        """Return the signature for constant sizes, else None."""
        if kws or not args or not all(isinstance(size, numba.types.IntegerLiteral) for size in args):
            return None
        return signature(numba.types.Array(numba.types.float64, len(args), "C"), *args)


@lower_builtin(local_zeros, numba.types.VarArg(numba.types.IntegerLiteral))
def _lower_local_zeros(context: Any, builder: Any, sig: Any, _args: Any) -> Any:
    shape = [size.literal_value for size in sig.args]
    item = context.get_value_type(numba.types.float64)
    memory = ir.ArrayType(item, math.prod(shape))
    place = cgutils.alloca_once(builder, memory)
    builder.store(ir.Constant(memory, None), place)
    word = context.get_constant
    strides = [8 * math.prod(shape[axis + 1 :]) for axis in range(len(shape))]
    array = make_array(sig.return_type)(context, builder)
    populate_array(
        array,
        data=builder.bitcast(place, item.as_pointer()),
        shape=[word(numba.types.intp, size) for size in shape],
        strides=[word(numba.types.intp, stride) for stride in strides],
        itemsize=word(numba.types.intp, 8),
        meminfo=None,
    )
    return array._getvalue()
