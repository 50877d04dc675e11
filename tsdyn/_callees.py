"""How Numba compiles kernels here: with less work than it does for functions that Python calls, to the same code.

Numba optimises every function with all that it calls linked in and makes machine code of it, with a wrapper for Python
and one for C. Of kernels that only kernels call that is lost: their callers inline them, and do it all again.
"""

from functools import cache, cached_property

import numba
from numba.core import types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core import typed_passes, untyped_passes
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import NativeLowering
from numba.extending import models, register_model

_UNUSED = {
    untyped_passes.WithLifting,
    untyped_passes.InlineClosureLikes,
    untyped_passes.RewriteDynamicRaises,
    untyped_passes.MakeFunctionToJitFunction,
    untyped_passes.InlineInlinables,
    untyped_passes.FindLiterallyCalls,
    untyped_passes.LiteralUnroll,
    untyped_passes.LiteralPropagationSubPipelinePass,
    typed_passes.NopythonRewrites,
    typed_passes.DumpParforDiagnostics,
}


class _Library(JITCodeLibrary):
    """The code of a kernel and of those that it calls, to be linked into others."""

    def finalize(self):
        """Link in what it calls, and leave the rest to who links this in."""
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class _Lowering(NativeLowering):
    _name = "callee_lowering"

    def run_pass(self, state):
        """As Numba's own, into a library of the kind above, without the wrappers that Python and C would call."""
        flags, context = state.flags, state.targetctx
        flags.no_cpython_wrapper = flags.no_cfunc_wrapper = flags.no_compile = True
        state.library = _Library(context.codegen(), state.func_id.func_qualname)
        super().run_pass(state)
        key = object()  # what stands for it in its callers
        context.insert_user_function(key, state.cr.fndesc, [state.library])
        state.cr = state.cr._replace(cfunc=key)
        return True


class _Operator(types.Function):
    """The type of an operator, which remembers what it makes of operands' types.

    Numba tries all its implementations for strings, lists, sets and so on at each call, in typing and in lowering.
    """

    def get_call_type(self, context, args, kws):
        """The signature, as Numba finds it."""
        known = self.__dict__.setdefault("_known", {})
        found = None if kws else known.get(args)
        if found is None:
            found = super().get_call_type(context, args, kws)
            if found is not None and not kws and self.get_impl_key(found) is self.typing_key:
                known[args] = found  # no overload in Python, whose code would depend on flags
        return found


register_model(_Operator)(models.OpaqueModel)


@cache
def _remembering(context):
    """A typing context that shares everything with another, but for the types of operators."""

    class Remembering(type(context)):
        def __init__(self):
            self.__dict__ = context.__dict__

        def __hash__(self):
            return hash(context)

        def __eq__(self, other):
            return other is self or other is context

        def _lookup_global(self, value):
            found = super()._lookup_global(value)
            return _operator(found) if type(found) is types.Function else found

    return Remembering()


@cache
def _operator(function):
    return _Operator(function.templates)


class Compiler(CompilerBase):
    """Numba's own, but for what kernels don't use."""

    callee = False

    def __init__(self, typingctx, *others):
        typingctx = _remembering(typingctx)
        super().__init__(typingctx, *others)
        self.state.targetctx.typing_context = typingctx  # of a copy, which has the flags' error model

    def define_pipelines(self):
        """Numba's own, with another lowering."""
        manager = PassManager("kernel")
        own = True
        seen = set()
        for kind, text in DefaultPassBuilder.define_nopython_pipeline(self.state).passes:
            if own and (kind in _UNUSED or kind in seen):
                continue
            seen.add(kind)
            manager.add_pass(_Lowering if self.callee and kind is NativeLowering else kind, text)
        manager.finalize()
        return [manager]


class _Compiler(Compiler):
    callee = True


class Callee(CPUDispatcher):
    """A kernel; called from Python it is compiled a second time, in Numba's own way."""

    def __init__(self, function, options):
        super().__init__(function, targetoptions={"nopython": True, **options}, pipeline_class=_Compiler)

    @cached_property
    def _direct(self):
        return numba.njit(**{k: v for k, v in self.targetoptions.items() if k != "nopython"})(self.py_func)

    def __call__(self, *arguments):
        """For users who try one."""
        return self._direct(*arguments)

    def add_overload(self, found):
        """There is nothing that Python could call."""
        self.overloads[tuple(found.signature.args)] = found
