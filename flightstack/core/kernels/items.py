"""Items of arrays and of records as LLVM values, without the copies on the stack that Numba makes of each array.

Numba stores an array, which is a structure of seven fields, on the stack at each access to one of its items, and reads
the fields back. LLVM removes these copies; most of its work on an estimator was that. The code does the same here, for
kernels alone: Numba compiles all other functions of the process in its own way, and all of them with NUMBA_BOUNDSCHECK.
"""
# mypy: disable-error-code="untyped-decorator,attr-defined"

from __future__ import annotations

import operator
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeAlias

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.imputils import impl_ret_borrowed, lower_builtin, lower_cast, lower_getattr_generic
from numba.np import arrayobj

from flightstack.core.kernels.compiler import compiles_kernel

_Lowering: TypeAlias = Callable[..., Any]


def _instead_of(other: _Lowering) -> Callable[[_Lowering], _Lowering]:
    """Return a decorator of code for kernels; other functions have that of Numba."""

    def decorate(own: _Lowering) -> _Lowering:
        @wraps(own)
        def lower(context: Any, builder: Any, *rest: Any) -> Any:
            is_own = compiles_kernel() and not context.enable_boundscheck
            return (own if is_own else other)(context, builder, *rest)

        return lower

    return decorate


def _part(builder: Any, whole: Any, index: int) -> Any:
    """Return an element of a structure: the value that was inserted, if that is in sight."""
    while isinstance(whole, ir.instructions.InsertValue):
        if whole.indices[0] == index:
            return whole.operands[1]
        whole = whole.operands[0]
    if isinstance(whole, ir.Constant) and isinstance(whole.constant, (list, tuple)):
        return whole.constant[index]
    return builder.extract_value(whole, index)


class _Fields:
    """The fields of an array's value."""

    def __init__(self, context: Any, builder: Any, kind: Any, value: Any) -> None:
        self._model, self._builder, self._value = context.data_model_manager[kind], builder, value
        self._ndim = kind.ndim

    def __getattr__(self, name: str) -> Any:
        return _part(self._builder, self._value, self._model.get_field_position(name))

    def sizes(self, name: str) -> list[Any]:
        """Return the elements of ``shape`` or ``strides``."""
        whole = getattr(self, name)
        return [_part(self._builder, whole, axis) for axis in range(self._ndim)]


def _array(context: Any, builder: Any, kind: Any, fields: dict[str, Any]) -> Any:
    """Return the value of an array with these fields."""
    model = context.data_model_manager[kind]
    value = ir.Constant(context.get_value_type(kind), ir.Undefined)
    for name, field in fields.items():
        value = builder.insert_value(value, field, model.get_field_position(name))
    return value


def _is_plain(kinds: Any) -> bool:
    return all(isinstance(kind, types.Integer) for kind in kinds)


def _index(context: Any, builder: Any, kind: Any, index: Any, sizes: list[Any], axis: int) -> Any:
    """Return an index as a word; a negative one counts from the end, unless it is known not to be negative."""
    if not kind.signed:
        return context.cast(builder, index, kind, types.uintp)
    word = context.cast(builder, index, kind, types.intp)
    if isinstance(word, ir.Constant):
        return word if word.constant >= 0 else builder.add(word, sizes[axis])
    return arrayobj.slicing.fix_index(builder, word, sizes[axis])


def _place(context: Any, builder: Any, kind: Any, fields: _Fields, kinds: Any, indices: Any) -> Any:
    """Return the address of an item or of a row, and shape and strides of the row."""
    shape, strides = fields.sizes("shape"), fields.sizes("strides")
    words = [
        _index(context, builder, each, index, shape, axis)
        for axis, (each, index) in enumerate(zip(kinds, indices, strict=True))
    ]
    rest = [context.get_constant(types.intp, 0)] * (kind.ndim - len(words))
    place = cgutils.get_item_pointer2(
        context, builder, fields.data, shape, strides, kind.layout, [*words, *rest]
    )
    return place, shape[len(words) :], strides[len(words) :]


def _get(context: Any, builder: Any, sig: Any, array: Any, kinds: Any, indices: Any) -> Any:
    """Return an item, or a row of an array of more dimensions."""
    kind, result = sig.args[0], sig.return_type
    fields = _Fields(context, builder, kind, array)
    place, shape, strides = _place(context, builder, kind, fields, kinds, indices)
    if not isinstance(result, types.Buffer):
        item = arrayobj.load_item(context, builder, kind, place)
        return impl_ret_borrowed(context, builder, result, item)
    count = context.get_constant(types.intp, 1)
    for size in shape:
        count = builder.mul(count, size, flags=["nsw"])
    word = context.get_value_type(types.intp)
    row = _array(context, builder, result, {
        "meminfo": fields.meminfo, "parent": fields.parent, "nitems": count, "itemsize": fields.itemsize,
        "data": place, "shape": cgutils.pack_array(builder, shape, word),
        "strides": cgutils.pack_array(builder, strides, word),
    })  # fmt: skip
    return impl_ret_borrowed(context, builder, result, row)


@lower_builtin(operator.getitem, types.Array, types.Integer)
@_instead_of(arrayobj.getitem_arraynd_intp)
def _get_item(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return _get(context, builder, sig, args[0], sig.args[1:], args[1:])


@lower_builtin(operator.getitem, types.Array, types.BaseTuple)
@_instead_of(arrayobj.getitem_array_tuple)
def _get_item_of_matrix(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    kinds = sig.args[1].types
    if not kinds or not _is_plain(kinds):
        return arrayobj.getitem_array_tuple(context, builder, sig, args)
    indices = [_part(builder, args[1], axis) for axis in range(len(kinds))]
    return _get(context, builder, sig, args[0], kinds, indices)


@lower_builtin(operator.setitem, types.Array, types.Any, types.Any)
@_instead_of(arrayobj.setitem_array)
def _set_item(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    kind, index, item = sig.args
    kinds = index.types if isinstance(index, types.BaseTuple) else (index,)
    if len(kinds) != kind.ndim or not _is_plain(kinds):
        return arrayobj.setitem_array(context, builder, sig, args)
    is_tuple = isinstance(index, types.BaseTuple)
    indices = [_part(builder, args[1], axis) for axis in range(len(kinds))] if is_tuple else [args[1]]
    fields = _Fields(context, builder, kind, args[0])
    place, _shape, _strides = _place(context, builder, kind, fields, kinds, indices)
    arrayobj.store_item(context, builder, kind, context.cast(builder, args[2], item, kind.dtype), place)
    return None


@lower_builtin(len, types.Array)
@_instead_of(arrayobj.array_len)
def _length(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return _Fields(context, builder, sig.args[0], args[0]).sizes("shape")[0]


@lower_getattr_generic(types.Record)
@_instead_of(arrayobj.record_getattr)
def _field_of_record(context: Any, builder: Any, kind: Any, record: Any, name: Any) -> Any:
    """Return a field of a record: of an array in the record, a view with a constant shape."""
    field = kind.typeof(name)
    if not isinstance(field, types.NestedArray):
        return arrayobj.record_getattr(context, builder, kind, record, name)
    context.sentry_record_alignment(kind, name)
    word, model = context.get_value_type(types.intp), context.data_model_manager[field]

    def empty(part: str) -> Any:
        return ir.Constant(context.get_value_type(model.get_type(part)), None)

    def words(numbers: Any) -> Any:
        return ir.Constant(ir.ArrayType(word, len(numbers)), [word(number) for number in numbers])

    data = cgutils.get_record_member(builder, record, kind.offset(name), context.get_data_type(field.dtype))
    array = _array(context, builder, field, {
        "meminfo": empty("meminfo"), "parent": empty("parent"), "nitems": word(field.nitems),
        "itemsize": word(field.size), "data": data, "shape": words(field.shape), "strides": words(field.strides),
    })  # fmt: skip
    return impl_ret_borrowed(context, builder, kind, array)


@lower_cast(types.NestedArray, types.Array)
@_instead_of(arrayobj.array_to_array)
def _array_of_record(_context: Any, _builder: Any, _from: Any, _to: Any, value: Any) -> Any:
    return value
