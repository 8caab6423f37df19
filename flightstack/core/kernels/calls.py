"""Calls of compiled kernels, and of functions of the C library, by compiled code at their address.

A kernel that calls others so includes no machine code of them: it compiles in a second, once for all of them, whichever
they are. Arguments are passed as they are: their types must be those of the called kernel, but a kernel that reads only
the first record of an array may be given its bytes. Imports Numba.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from flightstack.core.compiled import Kernel


def address_of(kernel: Callable[..., Any], *examples: Any) -> int:
    """Return the address of ``kernel``, compiled for the types of ``examples``."""
    assert isinstance(kernel, Kernel)
    result = kernel.dispatcher.result_for(*examples)
    address = int(result.library.get_pointer_to_function(result.fndesc.llvm_func_name))
    assert address, f"{kernel.__name__} has no address"
    return address


def as_bytes(record: Any) -> Any:
    """Return the bytes of records or of a frame, as an array that shares their memory."""
    return np.frombuffer(record, np.uint8)


def _call(result: Any) -> Any:
    """Return what Numba asks of an intrinsic, for kernels that return ``result``."""

    def call(_context: Any, _address: Any, arguments: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            kinds, convention = tuple(signature.args[1]), context.call_conv
            function = convention.get_function_type(result, kinds).as_pointer()
            status, value = convention.call_function(
                builder,
                builder.inttoptr(values[0], function),
                result,
                kinds,
                cgutils.unpack_tuple(builder, values[1], len(kinds)),
            )
            with cgutils.if_unlikely(builder, status.is_error):
                convention.return_status_propagate(builder, status)
            return context.get_dummy_value() if result is types.none else value

        return result(types.int64, arguments), generate

    return call


call_kernel = intrinsic(_call(types.none))
"""Call the kernel at an address with a tuple of arguments."""
call_kernel_int = intrinsic(_call(types.int64))
"""Call the kernel at an address, which returns a whole number, with a tuple of arguments."""
call_kernel_float = intrinsic(_call(types.float64))
"""Call the kernel at an address, which returns a float, with a tuple of arguments."""


def _c_call(_context: Any, _address: Any, arguments: Any) -> Any:
    """Return what Numba asks of an intrinsic, for functions of the C library."""

    def generate(_context: Any, builder: Any, signature: Any, values: Any) -> Any:
        word, count = ir.IntType(64), len(signature.args[1])
        function = ir.FunctionType(word, [word] * count).as_pointer()
        return builder.call(
            builder.inttoptr(values[0], function), cgutils.unpack_tuple(builder, values[1], count)
        )

    return types.int64(types.int64, arguments), generate


call_c = intrinsic(_c_call)
"""Call the C function at an address with a tuple of int64, for integers and pointers; return its result as int64.

Of a result that is shorter in C, only those bits are valid.
"""
