"""How tsdyn has Numba compile kernels: to the same machine code as it always does, with less work.

Numba optimises every function with all that it calls linked in, and makes machine code of it and of two wrappers, for
Python and for C. Of a kernel that only kernels call all of that is lost: its callers link it in and do it again. Here
such a kernel is lowered and left at that, operators are typed once for the same operands, and passes over the code that
serve no kernel of tsdyn's are left out. Compiled kernels are stored under a hash of all code that they depend on, and
so are those that kernels link in: what one process has lowered no other one lowers again.

This file alone uses what isn't Numba's or llvmlite's public interface: SEEN lists it, `check` looks whether it is
there. Where it isn't, or fails, stock.py takes its place (compilers.py).
"""

import ctypes
import importlib
import inspect
import json
import pickle
import re
import time
import warnings
from functools import cache, cached_property, partial
from typing import NamedTuple

import llvmlite.binding as llvm
import numba
import numpy as np
from numba import types
from numba.core import typed_passes, untyped_passes
from numba.core.caching import _Cache
from numba.core.ccallback import CFunc
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen, RuntimeLinker
from numba.core.compiler import CompilerBase, CompileResult, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.registry import CPUDispatcher, cpu_target
from numba.core.runtime import rtsys
from numba.core.serialize import dumps
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, lower_getattr_generic, models, register_model

from ..errors import CompilerWarning
from . import cache as files
from .code_hash import deep_hash, is_ours, types_hash, versions
from .target import chosen as target
from .target import portable

MADE = "versions.json"  # in a folder of kernels that came with tsdyn: the versions that compiled them
CALLBACK_FRAMES = "_raw_object_cache"  # of llvmlite.binding.executionengine: how its callbacks' names begin
SEEN = "0.63.1", "0.68.1"  # the oldest and the newest Numba that all of these were seen in, with llvmlite 0.46 to 0.50
PRIVATE = """
typed_passes.NativeLowering.run_pass(self, state)
typed_passes.NopythonRewrites
typed_passes.DumpParforDiagnostics
untyped_passes.WithLifting
untyped_passes.InlineClosureLikes
untyped_passes.RewriteDynamicRaises
untyped_passes.MakeFunctionToJitFunction
untyped_passes.InlineInlinables
untyped_passes.FindLiterallyCalls
untyped_passes.LiteralUnroll
untyped_passes.LiteralPropagationSubPipelinePass
compiler.CompilerBase.__init__(self, typingctx, targetctx, library, args, return_type, flags, locals)
compiler.CompilerBase.__init__:state
compiler.CompilerBase.define_pipelines(self)
compiler.DefaultPassBuilder.define_nopython_pipeline(state, name)
compiler.CompileResult._reduce(self)
compiler.CompileResult._rebuild:unserialize_library
compiler.CompileResult._replace
compiler.CompileResult._find_referenced_environments(self)
compiler.CompileResult.lifted
compiler.CompileResult.library
compiler_machinery.PassManager.add_pass(self, pss, description)
compiler_machinery.PassManager.finalize(self)
compiler_machinery.PassManager.__init__:passes
compiler_machinery.register_pass(mutates_CFG, analysis_only)
types.Function.get_call_type(self, context, args, kws)
types.Function.get_impl_key(self, sig)
types.Function.__init__:typing_key
types.Dispatcher.__init__(self, dispatcher)
typing.context.BaseContext._lookup_global(self, gv)
typing.templates.AttributeTemplate.resolve(self, value, attr)
typing.templates.AttributeTemplate.generic_resolve
base.BaseContext.insert_user_function(self, func, fndesc, libs)
base.BaseContext.refresh(self)
base.BaseContext.get_function(self, fn, sig, _firstcall)
base.BaseContext.subtarget(self, kws)
base.BaseContext.subtarget:cached_internal_func
cpu.CPUContext.codegen(self)
cpu.CPUContext.init:_internal_codegen
codegen.CodeLibrary._raise_if_finalized(self)
codegen.CodeLibrary.__init__:_reload_init
codegen.CodeLibrary.finalize(self)
codegen.CodeLibrary._ensure_finalized(self)
codegen.CodeLibrary.has_dynamic_globals
codegen.CPUCodeLibrary.__init__(self, codegen, name)
codegen.CPUCodeLibrary.__init__:_linking_libraries
codegen.CPUCodeLibrary.__init__:_final_module
codegen.CPUCodeLibrary._get_module_for_linking(self)
codegen.CPUCodeLibrary._get_module_for_linking:_shared_module
codegen.CPUCodeLibrary._finalize_dynamic_globals(self)
codegen.CPUCodeLibrary._optimize_functions(self, ll_module)
codegen.CPUCodeLibrary._optimize_functions:_data_layout
codegen.CPUCodegen._function_pass_manager(self, kwargs)
codegen.JITCPUCodegen._library_class
codegen.CPUCodeLibrary._finalize_final_module:_finalized
codegen.JITCPUCodegen.set_env(self, env_name, env)
codegen.CPUCodegen._scan_and_fix_unresolved_refs(self, module)
codegen.CPUCodegen.__init__:_rtlinker
codegen.RuntimeLinker.PREFIX
codegen.RuntimeLinker.__init__:_unresolved
codegen.JitEngine.is_symbol_defined(self, name)
codegen.JITCPUCodegen._customize_tm_options:_get_host_cpu_name
codegen.JITCPUCodegen._customize_tm_features:_get_host_cpu_features
codegen.JITCodeLibrary.serialize_using_object_code(self)
registry.cpu_target
registry.CPUDispatcher.__init__(self, py_func, locals, targetoptions, pipeline_class)
registry.CPUDispatcher.__init__:_cache
registry.CPUDispatcher.__init__:targetoptions
registry.CPUDispatcher.compile(self, sig)
registry.CPUDispatcher.get_call_template(self, args, kws)
registry.CPUDispatcher.add_overload(self, cres)
ccallback.CFunc.__init__(self, pyfunc, sig, locals, options, pipeline_class)
ccallback.CFunc.__init__:_cache
ccallback.CFunc.compile(self)
caching._Cache.load_overload(self, sig, target_context)
caching._Cache.save_overload(self, sig, data)
bytecode.FunctionIdentity.from_function:unique_id
itanium_mangler.mangle_identifier(ident, template_params, abi_tags, uid)
funcdesc.FunctionDescriptor._from_python_function:unique_id
funcdesc.FunctionDescriptor.__init__:typemap
funcdesc.FunctionDescriptor.__init__:calltypes
compiler.CompileResult._fields
dispatcher.Dispatcher.compile:load_overload
dispatcher.Dispatcher.compile:insert_user_function
options.DefaultOptions._nrt
compiler.Flags.no_cpython_wrapper
compiler.Flags.no_cfunc_wrapper
compiler.Flags.no_compile
runtime.rtsys.initialize(ctx)
serialize.dumps(obj)
"""  # below numba.core: a name, with the parameters that a call or an override counts on, or :attribute that code sets
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
_NUMBA = "_ZN5numba"  # how names of Numba's own functions begin
_NUMBERED = re.compile(r"B\d+v\d")  # in a name: a number by which Numba tells functions of one name apart
_OPTIONAL = "__array__", "static_getitem", "static_setitem"  # of which no type need have an implementation
_of_ours = {}  # way of lowering: passes over tsdyn's own kernels


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


class _Kernel(JITCodeLibrary):
    """The code of a kernel."""

    def _optimize_functions(self, ll_module):
        """As Numba's own, with one sequence of passes for all functions of the module."""
        ll_module.data_layout = self._codegen._data_layout
        passes, builder = self._codegen._function_pass_manager()
        for function in ll_module.functions:
            passes.run(function, builder)


class _Codegen(JITCPUCodegen):
    """Machine code for the portable target, beside Numba's own, which users' functions have."""

    _library_class = _Kernel

    def __init__(self, beside):
        super().__init__("tsdyn")
        self._beside = beside

    def _get_host_cpu_name(self):
        return portable()

    def _get_host_cpu_features(self):
        return ""

    def _scan_and_fix_unresolved_refs(self, module):
        """Users' functions that call themselves in a ring are called where Numba has compiled them."""
        super()._scan_and_fix_unresolved_refs(module)
        engine = self._beside._engine
        for name, pointer in self._rtlinker._unresolved.items():
            if engine.is_symbol_defined(name):
                pointer.value = engine.get_function_address(name)


@cache
def _for_target(context):
    """A target context that shares all with Numba's, but for the processor."""

    class Shared(type(context)):
        def get_function(self, fn, sig, _firstcall=True):
            """As Numba's own, but look for new declarations of nothing that is known to have none."""
            return super().get_function(fn, sig, _firstcall and not (isinstance(fn, str) and fn in _OPTIONAL))

    found = context.subtarget(_internal_codegen=_Codegen(context.codegen())) if portable() else context.subtarget()
    found.__class__ = Shared
    return found


class Compiler(CompilerBase):
    """The passes over a kernel."""

    lowering = typed_passes.NativeLowering

    def __init__(self, typingctx, targetctx, *others):
        typingctx = _remembering(typingctx)
        super().__init__(typingctx, _for_target(targetctx), *others)
        self.state.targetctx.typing_context = typingctx  # of a copy, which has the error model of the options

    def define_pipelines(self):
        """Numba's own passes, but those that serve others; all of them for a user's kernel."""
        if not is_ours(self.state.func_id.modname):
            return [self._passes()]
        if self.lowering not in _of_ours:
            _of_ours[self.lowering] = self._passes(_SERVE_OTHERS)
        return [_of_ours[self.lowering]]

    def _passes(self, without=None):
        manager, seen = PassManager("kernel"), set()
        for kind, what in DefaultPassBuilder.define_nopython_pipeline(self.state).passes:
            if without is None or kind not in without | seen:
                manager.add_pass(self.lowering if kind is typed_passes.NativeLowering else kind, what)
            seen.add(kind)
        manager.finalize()
        return manager


class _Library(_Kernel):
    """The code of a kernel and of those that it calls, to be linked into others."""

    def __init__(self, codegen, name, bitcode=None):
        super().__init__(codegen, name)
        if bitcode is not None:  # as it was stored
            self._shared_module = self._final_module = llvm.parse_bitcode(bitcode)
            self._finalized = True

    def finalize(self):
        """Link in what the kernel calls, and leave optimising to whoever links this in.

        Numba tells its own functions apart by numbers of this process, too. They are named after the kernel here.
        """
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        bodies = [function for function in self._final_module.functions if not function.is_declaration]
        for i, function in enumerate(one for one in bodies if one.name.startswith(_NUMBA)):
            function.name = f"{self.name}.{i}"
        self._finalize_dynamic_globals()
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class _CalleeLowering(typed_passes.NativeLowering):
    _name = "callee_lowering"

    def run_pass(self, state):
        """As Numba's own, into a library of the kind above, without wrappers."""
        flags, context = state.flags, state.targetctx
        flags.no_cpython_wrapper = flags.no_cfunc_wrapper = flags.no_compile = True
        state.library = _Library(context.codegen(), str(state.func_id.unique_id))
        super().run_pass(state)
        key = object()  # by which its callers find it
        context.insert_user_function(key, state.cr.fndesc, [state.library])
        state.cr = state.cr._replace(cfunc=key)
        return True


class _CalleeCompiler(Compiler):
    lowering = _CalleeLowering

    def define_pipelines(self):
        """As of `Compiler`, for a kernel that is told from others of its name by its code.

        Numba numbers them, in each process anew: of two with one number, a third process would link one for both.
        """
        function = self.state.func_id.func
        if _can_be_stored(function, self.state.args):
            self.state.func_id.unique_id = f"h{deep_hash(function)}{types_hash(self.state.args)}"
        return super().define_pipelines()


def _can_be_stored(function, kinds):
    """Not of a user's, whose globals may change; nor what takes a function of this process."""
    return is_ours(function.__module__) and not any(map(_has_code, kinds))


def _has_code(kind):
    return isinstance(kind, types.Callable) or (isinstance(kind, types.BaseTuple) and any(map(_has_code, kind.types)))


def _is_numbered(function):
    """Whether the name of a function with a body has a number of this process."""
    return not function.is_declaration and _NUMBERED.search(function.name) is not None


class _Store(_Cache):
    """A disk cache of one function."""

    @property
    def cache_path(self):
        """The folder that kernels are written to."""
        return str(files.folder())

    def enable(self):
        """Do nothing: kernels are always cached."""

    disable = flush = enable


class _CalleeCache(_Store):
    """The disk cache of a kernel that kernels call: LLVM's code of it, which other processes link into theirs."""

    def __init__(self, function, options):
        self._function, self._options = function, sorted(options.items())

    def _file(self, kinds):
        key = files.key_of((types_hash(kinds), self._options), target())
        return f"{files.name_of(self._function)}-{key}{files.CALLEE}"

    def load_overload(self, sig, target_context):
        """Return the kernel, or None."""
        return files.load(self._file(sig), partial(_linkable, context=_for_target(target_context)))

    def save_overload(self, sig, data):
        """Store the kernel."""
        library, fndesc = data.library, data.fndesc
        module = library._get_module_for_linking()
        if files.folder() is None or _depends_on_process(library) or any(map(_is_numbered, module.functions)):
            return
        fndesc.typemap = fndesc.calltypes = None
        try:
            kept = library.name, tuple(library._reload_init), module.as_bitcode(), fndesc, data.signature
            files.save(self._file(sig), pickle.dumps(kept))
        except OSError as error:
            files.warn_unwritable(error)
        except (AttributeError, TypeError, pickle.PicklingError):  # a type of this process alone
            return


def _linkable(payload, context):
    """The kernel of a stored one: a pickle, as Numba's own are, out of a folder that only the user writes to."""
    name, begin, bitcode, fndesc, signature = pickle.loads(payload)
    for call in begin:
        call()
    library = _Library(context.codegen(), name, bitcode)
    library._reload_init.update(begin)
    nothing = CompileResult(*[None] * len(CompileResult._fields))
    return nothing._replace(library=library, fndesc=fndesc, signature=signature, entry_point=object(), objectmode=False)


class _Dispatcher(CPUDispatcher):
    def __init__(self, function, variables, options, **others):
        super().__init__(function, variables, options, **others)
        if is_ours(function.__module__):  # a global of a user's may change
            self._cache = _CalleeCache(function, options)

    def get_call_template(self, args, kws):
        """One kernel for all constants that it is called with: what LLVM inlines, it makes anew for each of them."""
        return super().get_call_template(tuple(map(types.unliteral, args)), kws)

    def add_overload(self, found):
        """Keep it from Numba's table of what Python can call."""
        self.overloads[tuple(found.signature.args)] = found


def check():
    """Raise ImportError unless everything that is private is as it was seen."""
    for line in PRIVATE.strip().split("\n"):
        demand(line)


def demand(line):
    """Raise ImportError unless a line of PRIVATE holds."""
    home, _, attribute = line.partition(":")
    home, _, parameters = home.partition("(")
    try:
        found = importlib.import_module(f"numba.core.{home.partition('.')[0]}")
        for name in home.split(".")[1:]:
            found = getattr(found, name)
    except (ImportError, AttributeError) as error:
        raise ImportError(f"numba.core.{home} is gone") from error
    if attribute and attribute not in inspect.unwrap(found).__code__.co_names:
        raise ImportError(f"numba.core.{home} has no {attribute}")
    if parameters and ", ".join(inspect.signature(found).parameters) != parameters[:-1]:
        raise ImportError(f"numba.core.{home} takes {inspect.signature(found)}, not ({parameters}")


def tested(own):
    """Return own(), which compiles a kernel or loads it; run the kernel of the self-test once a process.

    Before it where it is stored; after it, and stored, where the process compiles kernels.
    """
    if _untested and is_stored(_probe, _PROBE_TYPE, "probe"):
        _test()
    found = own()
    if _untested and files.statistics["misses"] and files.folder() is not None:
        _test()
    return found


def _test():
    _untested.clear()
    before = {name: files.statistics[name] for name in ("hits", "misses")}
    made = callback(_probe, _PROBE_TYPE, {"error_model": "numpy"}, False, "probe")
    files.statistics.update({name: count - files.statistics[name] for name, count in before.items()})
    found = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)(made.address)(20)
    if found != 41:
        raise ImportError(f"the kernel of the self-test gives {found}, not 41")


def options(allocates):
    """What kernels have beside the options that `njit` documents: Numba's runtime only where they allocate."""
    return {"_nrt": allocates}


def callee(function, options, allocates=False):
    """What compiles a kernel that kernels call."""
    return _Dispatcher(function, {}, {"nopython": True, **options, "_nrt": allocates}, pipeline_class=_CalleeCompiler)


def _twice(i):
    return 2 * i


_twice = callee(_twice, {"error_model": "numpy"})


def _probe(i):
    return _twice(i) + 1


_PROBE_TYPE = types.int64(types.int64)
_untested = [True]


# Kernels that came with tsdyn, compiled by a Numba that may be another one.
#
# Machine code needs nothing of Numba but addresses of its helpers; wrappers for Python the layout of what they pass.


_foreign = [False]  # whether another Numba has compiled them


class _Pair(NamedTuple):
    whole: np.ndarray
    number: float


def _probe_arguments(values, pair, i):
    """Arrays, a named tuple and a number, to and fro."""
    pair.whole[i] += 1
    return values[i, 1] * pair.number + pair.whole[i]


def compile_probes():
    """Compile, and store, the kernels of the self-tests."""
    callback(_probe, _PROBE_TYPE, {"error_model": "numpy"}, False, "probe")
    options = {"nogil": True, "error_model": "numpy"}
    entry(_probe_arguments, options, False, lambda compile_for: compile_for).compile(_kinds())


def probe_files():
    """Where they are stored."""
    return stored_file(_probe, _PROBE_TYPE, "probe"), stored_file(_probe_arguments, _kinds())


def _kinds():
    return types.float64[:, ::1], numba.typeof(_Pair(np.zeros(1, np.int64), 1.0)), types.int64


def _try_out(folder):
    """Raise an error unless Python and the kernel of the self-test in this folder understand each other."""
    context, name = cpu_target.target_context, KernelCache(_probe_arguments).file(_kinds())
    rtsys.initialize(context)
    kernel = _rebuilt(files.opened(name, (folder / name).read_bytes()), context).entry_point
    whole = np.array([3])
    found = kernel(np.array([[1.0, 2.5]]), _Pair(whole, 2.0), 0), whole[0]
    if found != (9.0, 4):
        raise ImportError(f"the kernel of the self-test gives {found}, not (9.0, 4)")


@cache
def shipped():
    """The folder of kernels that came with tsdyn, if they serve here; one warning where another Numba refuses them."""
    path = files.shipped(portable()) if portable() else None
    if path is None:
        return None
    made = {}
    try:
        made = json.loads((path / MADE).read_text(encoding="utf-8"))
        if made != versions():
            _foreign[0] = True
            _try_out(path)
    except Exception as error:  # whatever another Numba makes of them
        cause = " ".join(f"{type(error).__name__}: {error}".split())[:300]
        warnings.warn(
            f"kernels that came with tsdyn were compiled by Numba {made.get('numba')} and are compiled anew, since "
            f"Numba {numba.__version__} can't use them ({cause}).",
            CompilerWarning,
            stacklevel=2,
        )
        return None
    return path


def entry(function, options, allocates, around):
    """What compiles a kernel that Python calls; `around` decorates what compiles it."""
    dispatcher = numba.njit(pipeline_class=Compiler, _nrt=allocates, **options)(function)
    dispatcher._cache = store = KernelCache(function)
    own = dispatcher.compile

    def compile_for(arguments):
        try:
            return own(arguments)
        finally:
            store.release()

    dispatcher.compile = around(compile_for)
    return dispatcher


def callback(function, signature, options, allocates, suffix="kernel"):
    """Compile a kernel that others call by address."""
    kind = signature.args, signature.return_type
    made = CFunc(function, kind, locals={}, options={**options, "_nrt": allocates}, pipeline_class=Compiler)
    made._cache = store = KernelCache(function, suffix)
    try:
        made.compile()
    finally:
        store.release()
    return made


def stored_file(function, signature, suffix="kernel"):
    """The file that has the machine code; None where there is none."""
    name = KernelCache(function, suffix).file(signature)
    return next((path / name for path in (shipped(), *files.folders()) if path and (path / name).exists()), None)


def is_stored(function, signature, suffix="kernel"):
    """Whether there is such a file."""
    return stored_file(function, signature, suffix) is not None


def attributes(kind, resolve, lower):
    """Give all types of a class attributes: of the types resolve(kind, name), by the code of `lower`.

    Returns what to call with each type and the names of its attributes.
    """

    @infer_getattr
    class Fields(AttributeTemplate):
        key = kind

        def generic_resolve(self, value, name):
            return resolve(value, name)

    lower_getattr_generic(kind)(lower)
    return lambda kind, names: None


class KernelCache(_Store):
    """The disk cache of a kernel with machine code, with a lock so that processes starting together compile once."""

    def __init__(self, function, suffix="kernel"):
        self._function, self._suffix = function, suffix
        self._lock = None

    @cached_property
    def _name(self):
        return files.name_of(self._function)  # at first use, when all that the function names is defined

    def file(self, signature):
        """The name of the file for a signature."""
        return f"{self._name}-{files.key_of(signature, target())}.{self._suffix}"

    def load_overload(self, sig, target_context):
        """Return the compiled function, or None; a miss takes the lock that save_overload gives back."""
        started = time.perf_counter()
        if is_ours(self._function.__module__):
            rtsys.initialize(target_context)
        else:  # libraries that a user's kernel calls, such as LAPACK, are found by what Numba imports here
            target_context.refresh()
        file, rebuild = self.file(sig), partial(_rebuilt, context=target_context)
        found = files.load(file, rebuild, shipped())
        if found is None:
            self.release()  # of a compilation that was interrupted
            self._lock = files.acquire(file)
            found = files.load(file, rebuild)
        if found is None:
            target_context.refresh()  # before the compiler's own context stands over it
            files.statistics["misses"] += 1
            files.tell()
        else:
            files.statistics["hits"] += 1
            self.release()
        files.statistics["seconds"] += time.perf_counter() - started
        return found

    def save_overload(self, sig, data):
        """Store the compiled function and let waiting processes read it."""
        data.library._ensure_finalized()
        for environment in data._find_referenced_environments():  # of a user's functions, which Numba has compiled
            data.library.codegen.set_env(environment.env_name, environment)
        try:
            if files.folder() is not None and not data.lifted and not _depends_on_process(data.library):
                plain = data._replace(type_annotation="")  # the source's text, which generated functions don't have
                (name, kind, (code, bitcode)), *others = plain._reduce()
                reduced = (name, kind, (code, _without_bodies(bitcode))), *others
                files.save(self.file(sig), dumps((_symbols(data.library), reduced)))
        except OSError as error:
            files.warn_unwritable(error)
        finally:
            self.release()

    def release(self):
        """Give the lock back, if it is held."""
        if self._lock is not None:
            self._lock.close()
            self._lock = None


def _rebuilt(payload, context):
    """The compiled function of a stored one."""
    symbols, reduced = pickle.loads(payload)
    absent = [name for name in symbols if llvm.address_of_symbol(name) is None] if _foreign[0] else ()
    if absent:  # LLVM would end the process
        raise ImportError(f"Numba {numba.__version__} has no {', '.join(absent)}")
    return CompileResult._rebuild(_for_target(context), *reduced)


def _symbols(library):
    """Names of what the code is linked to when it is loaded."""
    module = library._final_module
    names = [one.name for kind in (module.functions, module.global_variables) for one in kind if one.is_declaration]
    return [name for name in names if not name.startswith("llvm.")]


def _depends_on_process(library):
    """Whether the code has addresses of this process, or is linked to functions that call each other in a ring."""
    names = (one.name for one in library._final_module.global_variables)
    return library.has_dynamic_globals or any(name.startswith(RuntimeLinker.PREFIX) for name in names)


def _without_bodies(bitcode):
    """LLVM's code with empty functions of the same names, which is all that is read of it: nothing links it in."""
    functions = [found for found in llvm.parse_bitcode(bitcode).functions if not found.is_declaration]
    return llvm.parse_assembly(
        "\n".join(f'define void @"{found.name}"() {{ ret void }}' for found in functions)
    ).as_bitcode()
