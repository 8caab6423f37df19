"""Numba's compiler with less work: functions that kernels call are neither optimised nor turned into machine code.

A kernel includes the LLVM code of all functions that it calls. Numba optimises that code and makes machine code of it
for each function as well as for the kernel, because Python may call the function too. Here Python calls kernels only.
"""

from __future__ import annotations

import importlib
import operator
import os
from pickle import UnpicklingError
from types import FunctionType, SimpleNamespace
from typing import Any

import numba
from llvmlite.binding import Linkage, parse_assembly, parse_bitcode
from numba.core import caching, errors, types
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult, Flags
from numba.core.environment import lookup_environment
from numba.core.registry import CPUDispatcher
from numba.core.runtime import rtsys
from numba.core.sigutils import normalize_signature
from numba.core.typed_passes import AnnotateTypes, DumpParforDiagnostics, InlineOverloads, NopythonRewrites
from numba.core.typing.templates import AbstractTemplate, Signature, infer_global, signature
from numba.core.untyped_passes import (
    FindLiterallyCalls,
    InlineClosureLikes,
    InlineInlinables,
    LiteralPropagationSubPipelinePass,
    LiteralUnroll,
    MakeFunctionToJitFunction,
    WithLifting,
)

from flightstack.core.kernels.cache import is_own

_DEFAULTS = {name: option.default for name, option in Flags.options.items()}
_DAMAGED = (
    UnpicklingError,
    EOFError,
    AttributeError,
    ImportError,
    IndexError,
    KeyError,
    TypeError,
    ValueError,
)
"""Exceptions of ``pickle`` for a file that is not what was written."""
_COLOURS = "_termcolor_inst"
"""Numba's name of the colours of its messages."""
_NO_COLOURS = SimpleNamespace(
    **{name: lambda text: text for name in ("code", "errmsg", "filename", "indicate", "highlight", "reset")}
)
"""Numba formats a message for each operation before it fails; for a terminal that takes a twentieth of its time."""
_NEEDLESS = {
    InlineClosureLikes, MakeFunctionToJitFunction, WithLifting, InlineInlinables, FindLiterallyCalls, LiteralUnroll,
    LiteralPropagationSubPipelinePass, InlineOverloads, NopythonRewrites, AnnotateTypes, DumpParforDiagnostics,
}  # fmt: skip
"""Passes for closures, comprehensions, ``with``, inlining and expressions of arrays, which our kernels do not have."""
_NO_ENVIRONMENT = SimpleNamespace(set_env=lambda name, environment: None)


class _Flags(Flags):  # type: ignore[misc]  # Numba has no types
    """Compiler flags, which Numba compares for each operator and call.

    A function called by compiled code does not depend on the wrapper of its caller: without this flag, Numba finds it
    again instead of compiling it twice.
    """

    def values(self) -> dict[str, Any]:
        return {**_DEFAULTS, **self._values, "no_cpython_wrapper": True}


class _Compiler(Compiler):  # type: ignore[misc]
    """Compiles a function with flags and operators of this module."""

    active = 0  # compilations, one within the other; one thread at a time, under Numba's lock

    def __init__(
        self,
        typingctx: Any,
        targetctx: Any,
        library: Any,
        args: Any,
        return_type: Any,
        flags: Flags,
        locals: Any,
    ) -> None:
        from flightstack.core.kernels.intrinsics import register

        register(PartCompiler)
        importlib.import_module("flightstack.core.kernels.items")
        super().__init__(typingctx, targetctx, library, args, return_type, _Flags(flags), locals)

    def compile_extra(self, func: Any) -> CompileResult:
        """Compile ``func``."""
        _Compiler.active += 1
        names = vars(errors)
        colours, names[_COLOURS] = names[_COLOURS], _NO_COLOURS
        try:
            result = super().compile_extra(func)
        finally:
            names[_COLOURS] = colours
            _Compiler.active -= 1
        if not self.state.flags.nrt and _has_arrays(result.signature.return_type):
            raise errors.TypingError(
                f"{func.__qualname__} returns an array: a kernel of this project must not"
            )
        return result

    def define_pipelines(self) -> Any:
        """Return Numba's passes, for functions of this project the fewer that they need."""
        passes = super().define_pipelines()
        if is_own(self.state.func_id.modname):
            for manager in passes:
                manager.passes = [each for each in manager.passes if each[0] not in _NEEDLESS]
        return passes


def _has_arrays(kind: Any) -> bool:
    """Return True if a type has an array to which references are counted; views of records have none.

    A caller that counts them, such as a law of a user, would free it.
    """
    if isinstance(kind, numba.types.BaseTuple):
        return any(map(_has_arrays, kind))
    return isinstance(kind, numba.types.Buffer) and not isinstance(kind, numba.types.NestedArray)


def compiles_kernel() -> bool:
    """Return True while a kernel is compiled."""
    return _Compiler.active > 0


class KernelCompiler(_Compiler):
    """Compiles a function that Python calls."""

    def compile_extra(self, func: Any) -> CompileResult:
        """Compile ``func`` and set the environments of all functions that it includes."""
        result = super().compile_extra(func)
        names = (variable.name for variable in result.library._final_module.global_variables)
        environments = tuple(filter(None, map(lookup_environment, names)))
        for environment in environments:
            result.library.codegen.set_env(environment.env_name, environment)
        return result._replace(referenced_envs=environments)  # keeps them alive

    def define_pipelines(self) -> Any:
        """Return Numba's passes, which fill the library given here."""
        library = _KernelLibrary(self.state.targetctx.codegen(), self.state.func_id.func_qualname)
        library.enable_object_caching()
        self.state.library = library
        return super().define_pipelines()


class PartCompiler(_Compiler):
    """Compiles a function that compiled functions call."""

    def define_pipelines(self) -> Any:
        """Return Numba's passes, which fill the library given here."""
        self.state.library = _PartLibrary(self.state.targetctx.codegen(), self.state.func_id.func_qualname)
        return super().define_pipelines()


def _general(kind: Any) -> Any:
    """Return the type for which a function is compiled: of a constant any, of a vector in a record that of all."""
    if isinstance(kind, types.NestedArray) and kind.ndim == 1:
        return types.Array(kind.dtype, 1, "C")
    return numba.types.unliteral(kind)


class PartDispatcher(CPUDispatcher):  # type: ignore[misc]
    """A function that compiled functions call."""

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Return Numba's template of the call: of a function for all constants, unless it asks for theirs.

        Kernels include it, where LLVM computes with the constants anyway.
        """
        try:
            return super().get_call_template(
                tuple(map(_general, args)), {name: _general(kind) for name, kind in kws.items()}
            )
        except errors.TypingError:
            return super().get_call_template(args, kws)


class _KernelLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Machine code of a function that Python calls, and of the parts that it includes.

    A part takes each array as seven arguments: a call with many arrays writes hundreds of numbers to the stack. Parts
    are internal, so that LLVM sees all calls: it drops arguments without use, and inlines what is called once.
    """

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:
            if function.linkage == Linkage.linkonce_odr:
                function.linkage = Linkage.internal
        super()._optimize_final_module()


class _PartLibrary(JITCodeLibrary):  # type: ignore[misc]
    """LLVM code of a function and of those that it calls, for the kernels that include it."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    @property
    def codegen(self) -> Any:
        """Setter of the function's environment, a variable in the machine code of each kernel."""
        return _NO_ENVIRONMENT

    def serialize_using_object_code(self) -> Any:
        """Return name and LLVM code."""
        return self.name, self._get_module_for_linking().as_bitcode()

    @classmethod
    def load(cls, codegen: Any, name: str, bitcode: bytes) -> _PartLibrary:
        """Return a library from its serialised form."""
        library = cls(codegen, name)
        library._final_module = library._shared_module = parse_bitcode(bitcode)
        library._finalize_final_module()
        return library


_UserLocator: Any = (
    vars(caching).get("UserProvidedCacheLocator") or vars(caching)["_UserProvidedCacheLocator"]
)
"""Its name before Numba 0.62 was private."""


class _Locator(_UserLocator):  # type: ignore[misc]
    """Files of a kernel in a cache directory that is keyed by its sources: every copy of them shares its kernels."""

    def __init__(self, function: FunctionType, file: str) -> None:
        super().__init__(function, file)
        self._path = os.path.join(numba.config.CACHE_DIR, function.__module__)

    def get_cache_path(self) -> str:
        return self._path

    def get_source_stamp(self) -> str:
        return ""


class _CacheImpl(CompileResultCacheImpl):  # type: ignore[misc]
    _locator_classes = [_Locator]  # noqa: RUF012


class _KernelCacheImpl(_CacheImpl):
    def reduce(self, result: CompileResult) -> Any:
        """Return the result to store, with the names of the functions that are called in place of all LLVM code.

        Python calls the one, ``calls`` the other. Numba keeps the LLVM code for callers: they include the part.
        """
        (name, kind, (machine_code, _)), *rest = super().reduce(result)
        called = result.fndesc.llvm_cpython_wrapper_name, result.fndesc.llvm_func_name
        names = parse_assembly("\n".join(f'define void @"{each}"() {{ ret void }}' for each in called))
        return ((name, kind, (machine_code, names.as_bitcode())), *rest)


class KernelCache(FunctionCache):  # type: ignore[misc]
    """Cache on disk of functions that Python calls."""

    _impl_class = _KernelCacheImpl

    def load_overload(self, sig: Any, target_context: Any) -> CompileResult | None:
        """Return the stored result for these types, or None.

        Numba would first install all types and functions that it can compile. A stored result needs its runtime alone.
        Two processes that save for the first time at once choose the same file: the index of one names the other's.
        Numba does not sync its files: those that a power failure damaged are stored again.
        """
        stored = None
        rtsys.initialize(target_context)
        try:
            with self._guard_against_spurious_io_errors():
                stored = self._load_overload(sig, target_context)
        except _DAMAGED:
            self.flush()
        arguments, _ = normalize_signature(sig)
        return stored if stored is not None and tuple(stored.signature.args) == tuple(arguments) else None

    def save_overload(self, sig: Any, data: CompileResult) -> None:
        """Store the result, unless it is for a type of another package: a process without that cannot read the file."""
        if all(_is_own_type(each) for each in (*data.signature.args, data.signature.return_type)):
            super().save_overload(sig, data)


def _is_own_type(kind: types.Type) -> bool:
    """Return True if no part of a type is a named tuple of another package."""
    named = getattr(kind, "instance_class", None)
    parts = getattr(kind, "types", ())  # of a tuple
    return (named is None or is_own(named.__module__)) and all(_is_own_type(part) for part in parts)


class _PartCacheImpl(_CacheImpl):
    def rebuild(self, target_context: Any, payload: Any) -> CompileResult:
        """Return the result of a compilation as ``CompileResult._rebuild`` does, but without machine code."""
        serialised, description, environment, function_signature, object_mode, lifted, annotation, *rest = (
            payload
        )
        reload_init, environments = rest
        for reload in reload_init:
            reload()
        library = _PartLibrary.load(target_context.codegen(), *serialised)
        return CompileResult(
            target_context=target_context,
            typing_context=target_context.typing_context,
            library=library,
            environment=environment,
            entry_point=target_context.get_executable(library, description, environment),
            fndesc=description,
            type_annotation=annotation,
            signature=function_signature,
            objectmode=object_mode,
            lifted=lifted,
            typing_error=None,
            call_helper=None,
            metadata=None,
            reload_init=reload_init,
            referenced_envs=environments,
        )


class PartCache(KernelCache):
    """Cache on disk of functions that compiled functions call."""

    _impl_class = _PartCacheImpl


class FloatOperator(AbstractTemplate):  # type: ignore[misc]
    """Type of an operator with two floats, found before Numba asks NumPy for a matching ufunc.

    Templates are for all of a process: outside the compilation of a kernel this one leaves the type to Numba.
    """

    metadata = {"target": "cpu"}  # noqa: RUF012  # sorts it before those for all targets
    result: Any = types.float64

    def generic(self, args: tuple[Any, ...], kws: dict[str, Any]) -> Signature | None:
        """Return the signature of two floats, or None for Numba's own."""
        if not compiles_kernel() or kws or args != (types.float64, types.float64):
            return None
        return signature(self.result, *args)


class _FloatComparison(FloatOperator):
    result = types.boolean


for _operator in (operator.add, operator.sub, operator.mul, operator.truediv):
    infer_global(_operator)(FloatOperator)
for _operator in (operator.lt, operator.le, operator.gt, operator.ge, operator.eq, operator.ne):
    infer_global(_operator)(_FloatComparison)
