"""How Numba compiles kernels here: to the same machine code as it always does, with less work.

Numba optimises every function with all that it calls linked in, and makes machine code of it and of two wrappers, for
Python and for C. Of a kernel that only kernels call all of that is lost: its callers link it in and do it again. Here
such a kernel is lowered and left at that, operators are typed once for the same operands, and passes over the code that
serve no kernel of tsdyn's are left out.
"""

from functools import cache, cached_property, update_wrapper

import numba
from numba.core import typed_passes, types, untyped_passes
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.registry import CPUDispatcher
from numba.extending import models, register_model

from .cache import KernelCache
from .code_hash import is_ours

OPTIONS = {"error_model": "numpy", "_nrt": False}  # of every kernel
_SERVE_OTHERS = {  # passes for closures, with blocks, exceptions, literal_unroll, array expressions, parallel loops
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


class _Operator(types.Function):
    """The type of an operator or built-in function, which remembers the types of results.

    Numba tries the implementations for strings, lists, sets and so on at each call, in typing and again in lowering.
    """

    def get_call_type(self, context, args, kws):
        """The signature, as Numba finds it."""
        known = self.__dict__.setdefault("_known", {})
        found = None if kws else known.get(args)
        if found is None:
            found = super().get_call_type(context, args, kws)
            overloaded = found is None or self.get_impl_key(found) is not self.typing_key
            if not kws and not overloaded:  # code of an overload in Python depends on its caller's options
                known[args] = found
        return found


register_model(_Operator)(models.OpaqueModel)


@cache
def _operator(function):
    return _Operator(function.templates)


@cache
def _remembering(context):
    """A typing context that shares all with another, but for the types of operators."""

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


class Compiler(CompilerBase):
    """The passes over a kernel."""

    lowering = typed_passes.NativeLowering

    def __init__(self, typingctx, *others):
        typingctx = _remembering(typingctx)
        super().__init__(typingctx, *others)
        self.state.targetctx.typing_context = typingctx  # of a copy, which has the error model of the options

    def define_pipelines(self):
        """Numba's own passes, but those that serve others; all of them for a user's kernel."""
        manager, seen = PassManager("kernel"), set()
        ours = is_ours(self.state.func_id.modname)
        for kind, what in DefaultPassBuilder.define_nopython_pipeline(self.state).passes:
            if not ours or kind not in _SERVE_OTHERS | seen:
                manager.add_pass(self.lowering if kind is typed_passes.NativeLowering else kind, what)
            seen.add(kind)
        manager.finalize()
        return [manager]


class _Library(JITCodeLibrary):
    """The code of a kernel and of those that it calls, to be linked into others."""

    def finalize(self):
        """Link in what the kernel calls, and leave optimising to whoever links this in."""
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class _CalleeLowering(typed_passes.NativeLowering):
    _name = "callee_lowering"

    def run_pass(self, state):
        """As Numba's own, into a library of the kind above, without wrappers."""
        flags, context = state.flags, state.targetctx
        flags.no_cpython_wrapper = flags.no_cfunc_wrapper = flags.no_compile = True
        state.library = _Library(context.codegen(), state.func_id.func_qualname)
        super().run_pass(state)
        key = object()  # by which its callers find it
        context.insert_user_function(key, state.cr.fndesc, [state.library])
        state.cr = state.cr._replace(cfunc=key)
        return True


class _CalleeCompiler(Compiler):
    lowering = _CalleeLowering


class _Dispatcher(CPUDispatcher):
    def get_call_template(self, args, kws):
        """One kernel for all constants that it is called with: what LLVM inlines, it makes anew for each of them."""
        return super().get_call_template(tuple(map(types.unliteral, args)), kws)

    def add_overload(self, found):
        """Keep it from Numba's table of what Python can call."""
        self.overloads[tuple(found.signature.args)] = found


class Callee:
    """A kernel of tsdyn's that kernels call; what Numba needs to compile it is made when a caller is compiled."""

    def __init__(self, py_func, options):
        self.py_func, self.targetoptions = py_func, options
        update_wrapper(self, py_func)

    @cached_property
    def _dispatcher(self):
        options = {"nopython": True, **self.targetoptions}
        return _Dispatcher(self.py_func, {}, options, pipeline_class=_CalleeCompiler)

    @property
    def _numba_type_(self):
        """The type that kernels see."""
        return types.Dispatcher(self._dispatcher)

    @cached_property
    def _from_python(self):
        dispatcher = numba.njit(**self.targetoptions)(self.py_func)
        dispatcher._cache = KernelCache(self.py_func)
        return dispatcher

    def __call__(self, *arguments, **keywords):
        """For whoever tries a kernel: it is compiled, or loaded, for Python."""
        return self._from_python(*arguments, **keywords)

    def __reduce__(self):
        """By name, as functions are."""
        return self.__qualname__
