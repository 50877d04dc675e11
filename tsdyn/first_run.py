"""Which kernels a run needs, so that a first one can have them compiled at the same time."""

from . import friction_basis, friction_solve, linearise, motion_program, null_space, series_steps, start
from ._compiled import DEBUG
from ._workers import compile_ahead
from .expansion_pack import FAR, room
from .integrators import DOP853, Taylor
from .run import advance
from .signal import Signal
from .taylor import advance_series

_known = set()  # what this process has made sure of: methods and forms, each with or without what is between steps


def prepare_first_run(scene, method, form, within):
    """Have compiled what a run of the scene needs, if any of it is missing on disk.

    method is None for the default; within: whether anything is asked for between the steps.
    """
    key = type(method), form.name, within
    if DEBUG or (scene._packed is not None and key in _known):
        return
    compile_ahead(dict.fromkeys([*of_scene(scene, method, form), *of_method(scene, method, form, within)]))
    _known.add(key)


def of_scene(scene, method, form):
    """The kernels of constraints and forces."""
    series = _series(scene, method, form)
    far = "far_" if series and _is_far(scene, series) else ""
    for kind, moving in _kinds(scene).items():
        names = ["phi", "jacobian", "gamma", *["phi_t"] * moving, *["remember"] * bool(kind.memory)]
        if not kind.normalises:
            names += ["reduced", "values", "bias", *["drift"] * moving]
            names += [f"{far}driven_series" if moving else f"{far}series"] * bool(series)
        if method is not None and method.implicit:
            names.append("curvature")
        yield from (kind.kernels[name] for name in names if name in kind.kernels)
    for force in scene.forces:
        names = ["force", "remember", *["series"] * bool(series)]
        if method is not None and method.implicit:
            names.append("jacobian")
        if "normal_load" in force.kernels:
            names += ["normal_load", "unit_friction"]
            yield (friction_solve if form.basis_free else friction_basis).rub
        yield from (force.kernels[name] for name in names if name in force.kernels)
        if any(isinstance(value, Signal) and value.motions for value in vars(force).values()):
            yield motion_program.run_program


def of_method(scene, method, form, within):
    """The kernels of a start, of the method and of the form."""
    yield start._look
    series = _series(scene, method, form)
    if series:
        yield series_steps.expand_far_series if _is_far(scene, series) else series_steps.expand_series
        yield from (series_steps.reach, advance_series)
        yield from (series_steps.accelerate_here, series_steps.pass_singular) if within else ()
        return
    method = method or DOP853()
    form = form.serving(method)
    kernels = form.kernels
    yield from (kernels.place, kernels.accelerate, (kernels if form.basis_free else null_space).complete)
    yield from (kernels.check, kernels.start_chart, advance)
    if method.driver == "steps":
        yield method.kernel(form.first_order)[0]
    if method.step is None:
        yield from (*method.errors, kernels.error_norm)
    if method.implicit:
        yield from (linearise.linearise, linearise.reduce, linearise.factorise, linearise.solve, linearise.soften)
        yield kernels.error_norm
    if within:
        interpolant = method.interpolant(form.first_order)
        yield from (interpolant.fill, interpolant.value)
        yield from (method.second,) if method.implicit else ()


def _kinds(scene):
    """{class of constraint: whether one of them moves}."""
    kinds = {}
    for constraint in scene.primitives:
        kind = type(constraint)
        kinds[kind] = kinds.get(kind, False) or constraint.rheonomic
    return kinds


def _series(scene, method, form):
    """The Taylor method that will run the scene, or None."""
    if method is not None:
        return method if isinstance(method, Taylor) else None
    serves = form.name == "tangent" and all("series" in part.kernels for part in _parts(scene))
    return Taylor(1e-8) if serves else None


def _parts(scene):
    yield from (kind for kind in _kinds(scene) if not kind.normalises)
    yield from scene.forces


def _is_far(scene, method):
    return len(scene.bodies) * room(method.orders()[2]) > FAR
