"""Which kernels a run needs, so that a first one can have them compiled at the same time."""

from ..configuration import start_kernels
from ..elements.laws import SceneLaw
from ..formulations.registry import FORMULATIONS
from ..integrators import DOP853, Taylor
from ..jit.compiled import DEBUG
from ..methods.explicit import called_for
from ..model.equations import is_of_user
from ..model.packed import has_rates, second_derivatives
from ..motions import program, tracing
from ..motions.signals import Signal
from ..rows.interface import ELIMINATION
from ..runs.arguments import adaptive
from ..runs.path_loads import watch
from ..runs.stepper import advance
from ..taylor import step_parts
from ..taylor.layout import FAR, no_series, pays, room
from ..taylor.series_engine import accelerating, expanding
from ..taylor.stepper import advance_series
from .workers import compile_ahead

_known = set()  # what this process has made sure of: method, form, whether there is anything between steps, friction


def prepare_first_run(scene, method, form, within, default):
    """Have compiled what a run of the scene needs, if any of it is missing on disk.

    method may be None: `default` is then (rtol, atol, whether Taylor may be chosen). within: whether anything is asked
    for between the steps.
    """
    packed = scene._packed
    mixed = form.is_mixed(has_rates(scene))
    key = type(method), form.name, mixed, within, packed is not None and packed.system.normals.size > 0
    if (key in _known and packed is not None) or DEBUG or not scene.bodies:
        return
    compile_ahead(kernels_of(scene, method or _default_method(scene, *default), form, within))
    _known.add((*key[:4], _is_rough(scene)))


def kernels_of(scene, method, form, within):
    """The kernels that a run of the scene needs, as the keys of a dict; arguments as of `prepare_first_run`."""
    rough, form = _is_rough(scene), form.serving(method, has_rates(scene))
    far = isinstance(method, Taylor) and len(scene.bodies) * room(method.orders()[2]) > FAR
    return dict.fromkeys([*of_scene(scene, method, form, far, rough), *of_method(method, form, within, far, rough)])


def _is_rough(scene):
    """Whether there is joint friction."""
    return any("normal_load" in force.kernels for force in scene.forces)


def of_scene(scene, method, form, far, rough):
    """The kernels of constraints and forces, far and rough as of `of_method`, and those for several rows."""
    series, implicit = isinstance(method, Taylor), method.implicit
    if implicit or sum(one.all_rows for one in scene.primitives if not one.normalises) > 1:
        yield from ELIMINATION["symmetric"]
        if rough or not series:
            yield from ELIMINATION["unsymmetric"]
    for kind, moving in _kinds(scene).items():
        second = second_derivatives(form.basis_free) if implicit else ()
        yield from of_constraint(kind, moving, series, far, second)
    if not series and any(is_of_user(force) for force in scene.forces):
        yield watch
    if series and any(_is_checked(force) for force in scene.forces):
        yield step_parts.check_laws
    for force in scene.forces:
        signals = [value for value in vars(force).values() if isinstance(value, Signal)]
        yield from of_force(force.kernels, series, implicit, form, "driven_" * bool(signals))
        if series and (hasattr(force.kernels, "program") or isinstance(force, SceneLaw)):
            yield tracing.run_order
        if signals and (series or any(signal.motions for signal in signals)):
            yield program.run_program


def of_constraint(kind, moving, series=True, far=False, second=()):
    """The loops over constraints of a class; moving: whether one of them depends on time; second: derivatives."""
    names = ["phi", "jacobian", "gamma", *["phi_t"] * moving, *["remember"] * bool(kind.memory)]
    if not kind.normalises:
        names += ["reduced", "values", "bias", *["drift"] * moving]
        names += ["far_" * far + "driven_" * moving + "series", "contact_rows", "contact_series"] * series
    names += second
    return [kind.kernels[name] for name in names if name in kind.kernels]


def of_force(kernels, series=True, implicit=False, form=FORMULATIONS["tangent"], driven=""):
    """The loops over forces that have these kernels; driven: "driven_" for the series of those with loads of time."""
    names = ["force", "remember", "normal_load", "unit_friction", *["jacobian"] * implicit]
    names += [driven + "series", driven + "check", driven + "margin", "load_slope"] * series
    found = [kernels[name] for name in names if name in kernels]
    if "normal_load" in kernels and not series:
        found.append(form.friction_solver)
    return found


def of_method(method, form, within, far=False, rough=False):
    """The kernels of a start, of the method and of the form.

    far: of series that are too long for caches near by; rough: of a scene with joint friction.
    """
    yield start_kernels.evaluate_start
    if isinstance(method, Taylor):
        yield from (expanding(rough, far), step_parts.reach, advance_series)
        yield from (accelerating(rough), step_parts.pass_singular) if within else ()
        return
    kernels = form.kernels
    yield from (kernels.place, kernels.accelerate, kernels.complete)
    yield from (kernels.check, kernels.start_chart, kernels.error_norm, advance)
    if method.driver == "steps":
        yield from filter(None, called_for(method.kernel(form.first_order)[0]))
        yield from form.stage_kernels(form.frees_stages)
    if method.step is None:
        yield from method.errors
    if method.implicit:
        yield from form.stages(method.coupled > 0).values()
    if within:
        interpolant = method.interpolant(form.first_order)
        yield from (interpolant.fill, interpolant.value)
        yield from (method.second,) if method.implicit else ()


def _is_checked(force):
    """Whether series of a force may differ from its law."""
    sharp = force.sharp or any(isinstance(value, Signal) and not value.entire for value in vars(force).values())
    return sharp or force.positive != ()


def _kinds(scene):
    """{class of constraint: whether one of them moves}."""
    kinds = {}
    for constraint in scene.primitives:
        kind = type(constraint)
        kinds[kind] = kinds.get(kind, False) or constraint.rheonomic
    return kinds


def _default_method(scene, rtol, atol, series):
    """The explicit method that the default will find to begin with."""
    kinds = (kind.kernels for kind in _kinds(scene) if not kind.normalises)
    series = series and all("series" in kernels for kernels in kinds) and pays(scene.primitives, scene.forces)
    series = series and not any(no_series(force, force.parameters()) for force in scene.forces)
    return adaptive(Taylor if series else DOP853, rtol, atol)
