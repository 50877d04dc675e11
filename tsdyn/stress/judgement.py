"""Judgement of a random scene: it runs within the laws, is refused, or ends with a message; all else is a fault."""

import time
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from ..elements.unilateral import contacts_of
from ..errors import InvalidArgument, TsdynError
from ..integrators import Nystrom4
from ..maths.tolerances import EPS
from ..simulation.prepared_run import simulate
from . import laws, random_scenes
from .laws import Finding
from .random_scenes import generate
from .tolerances import (
    AMPLIFIED,
    FALL,
    MULTIPLE,
    NEAR_SINGULAR_ENDS,
    ROUNDED,
    ROUNDINGS,
    SEEN,
    SHORTER,
    TIGHTER,
    TILTED,
)
from .twins import Mirror

# Laws that compare runs of a random scene: a tighter tolerance, another method or form, the same run once more.
#
# An error that exceeds MULTIPLE tolerances is judged by its convergence: at tolerances TIGHTER by a thousand less than
# FALL of it must be left. Fixed steps have no tolerance, and may be too long for the motion: of their errors less than
# FALL must be left by steps shorter by SHORTER, or from those to steps shorter still, where an adaptive run comes to
# the end.

FEW, FEW_IMPACTS = 20, 2  # bodies; instants of impacts
DEFAULT = 1e-8  # rtol, and atol, of a run without one


def energy(case, solution, run):
    """Energy less the work of loads, drivers and friction is constant, to the tolerance."""
    roundings = ROUNDINGS * EPS * np.abs(solution.potential_energy).max(initial=0.0)

    def left(one):
        change, size = laws.energy_left(one)
        return max(change - roundings, 0.0) / (size or 1.0)

    return _converging("energy less work", left, case, solution, run)


def momenta(case, solution, run):
    """Linear momentum, and angular momentum about the centroid, of a scene that nothing outside it holds or loads."""
    scene = solution.scene
    ends = {id(body) for item in (*scene.constraints, *scene.forces) for body in laws.bodies_of(item)}
    if id(scene.ground) in ends or any(force.b is None for force in scene.forces):
        return []
    parts = enumerate(("linear momentum", "angular momentum"))
    return [
        found
        for i, law in parts
        for found in _converging(law, lambda one, i=i: laws.momentum_left(one)[i], case, solution, run)
    ]


def another_method(case, solution, run):
    """Two methods agree at the end of the run, to the tolerance."""
    other = {"integrator": "rk45" if case.options.get("integrator") == "dop853" else "dop853"}
    return _agreeing("agreement of two methods", case, solution, run, other)


def implicit_methods(case, solution, run):
    """So do the implicit methods, in scenes where they take few steps, as far as they serve the scene."""
    if len(solution.scene.bodies) > FEW:
        return []
    found = []
    with suppress(InvalidArgument):  # Radau: friction by reactions, the null-space form
        found += _agreeing("agreement with SDIRK54", case, solution, run, {"integrator": "sdirk54"})
        found += _agreeing("agreement with Radau", case, solution, run, {"integrator": "radau"})
    return found


def another_form(case, solution, run):
    """The tangent form and the null-space form, which is dense and for SI units, agree."""
    name = case.options.get("integrator")
    if len(solution.scene.bodies) > FEW or name in (None, "taylor") or case.length != 1.0:
        return []
    form = "tangent" if case.options.get("formulation") == "null-space" else "null-space"
    return _agreeing("agreement of two forms", case, solution, run, {"formulation": form})


def once_more(case, solution, run):
    """The same run gives the same bits; so does a prepared one, after another run of it."""
    again = run(case), run(case, by=laws.prepared_twice)
    return [Finding("same bits of the same run", float(sum(not laws.same_bits(solution, one) for one in again)), 0.0)]


def stopped(case, solution, run):
    """A run that is stopped, and goes on from its checkpoint, gives the same bits."""
    after = np.random.default_rng(solution.t.size).random() if contacts_of(case.scene.constraints) else 0.0
    same = laws.resumed_is_same(case.scene, case.span, solution, after, **case.options)
    return [] if same is None else [Finding("same bits after a stop", 0.0 if same else 1.0, 0.0)]


def saved(case, solution, run):
    """A solution that is saved and loaded has the same bits."""
    same = laws.saved_is_same(solution)
    return [] if same is None else [Finding("same bits of a file", 0.0 if same else 1.0, 0.0)]


def output_times(case, solution, run):
    """Output times change no step, and outputs there are those of dense output."""
    t = np.unique(np.linspace(*case.span, 7))
    other = run(case, t_eval=t)
    steps = abs(other.stats.steps - solution.stats.steps)
    size = 1.0 + np.abs(solution.q).max(initial=0.0)
    off = np.abs(other.q - solution.at(t).q).max(initial=0.0) / size if other.success else np.inf
    return [
        Finding("steps with output times", float(steps), 0.0),
        Finding("outputs within steps", float(off), laws.off_steps(solution)),
    ]


def other_masses(case, solution, run):
    """Masses, whatever their ratio, change neither the degrees of freedom nor which rows are redundant."""
    scene = case.scene
    if len(scene.bodies) > FEW:
        return []
    factors = 10.0 ** np.random.default_rng(len(scene.bodies)).uniform(-12.0, 12.0, len(scene.bodies))
    values = {f"{body.name}.mass": f * body.mass for body, f in zip(scene.bodies, factors, strict=True)}
    found = [_mobility(each) for each in (scene, scene.with_parameters(values))]
    return [Finding("mobility with other masses", float(found[0] != found[1]), 0.0)]


def _mobility(scene):
    found = scene.mobility()
    return found.degrees_of_freedom, found.rank, [row.name for row in found.redundant]


def with_few_impacts(case, solution, run):
    """Two methods agree after FEW_IMPACTS at most: later motions don't depend continuously on what came before."""
    case, solution = _shortened(case, solution, run)
    return another_method(case, solution, run) if solution.success else []


def mirrored(case, solution, run):
    """The scene in a mirror, its parts in another order, does the same, after FEW_IMPACTS at most."""
    case, solution = _shortened(case, solution, run)
    mirror = Mirror(np.random.default_rng(solution.t.size).uniform(0.0, np.pi))
    image = case._replace(scene=mirror.scene(case.scene))

    def apart(options):
        one, two = (run(each, **options) for each in (case, image))
        seen = mirror.coordinates(case.scene, one.q[-1])
        return _distance(image, two, seen) if one.success and two.success else np.nan

    other = run(image)
    if not (solution.success and other.success):
        return [Finding("end of the mirrored scene", float(other.success != solution.success), 0.0, other.message)]
    error = _distance(image, other, mirror.coordinates(case.scene, solution.q[-1]))
    found = _falling("motion of the mirrored scene", apart, error, case, run)
    if any(one.broken for one in found):
        found = _explained(found, case, solution, (image, other, mirror), run)
    return found


def _explained(found, case, solution, reflection, run):
    """What is found of the image of a motion that may amplify rounding.

    A motion of the same phases under a gravity that is TILTED is the measure: the image may leave the motion by
    AMPLIFIED of what that does, at every time up to the end.
    """
    gravity = np.array(case.scene.gravity)
    tilt = TILTED * np.linalg.norm(gravity) * np.random.default_rng(solution.t.size).standard_normal(3)
    beside = run(case._replace(scene=case.scene.with_parameters({"gravity": (gravity + tilt).tolist()})))
    if not beside.success or [names for *_, names in beside.phases] != [names for *_, names in solution.phases]:
        return found
    image, other, mirror = reflection
    worst = None
    for t in np.linspace(*case.span, SEEN + 1)[1:]:
        q = solution.at(t).q
        error = _distance(image, other, mirror.coordinates(case.scene, q), other.at(t).q)
        limit = max(MULTIPLE * _tolerance(case), AMPLIFIED * _distance(case, beside, q, beside.at(t).q))
        if worst is None or error * worst.limit > worst.size * limit:
            worst = Finding(found[0].law, error, limit, f"at t = {t:.6g} s, beside a gravity that is tilted")
    return [worst]


def _shortened(case, solution, run):
    """A case and its run, to the middle between the last of FEW_IMPACTS and the next one where there are more."""
    times = sorted({t for t, *_ in solution.impulses})
    if len(times) <= FEW_IMPACTS:
        return case, solution
    case = case._replace(span=(case.span[0], 0.5 * sum(times[FEW_IMPACTS - 1 : FEW_IMPACTS + 1])))
    return case, run(case)


OF_THE_SAME = once_more, stopped, saved, output_times
ALL = other_masses, another_method, implicit_methods, another_form, *OF_THE_SAME


def _tolerance(case):
    return case.options.get("rtol", DEFAULT)


def _tighter(case):
    """Return options of runs, each of which is more accurate than the one before."""
    method = case.options.get("integrator")
    if isinstance(method, Nystrom4):
        return [{"integrator": Nystrom4(step=method.step / SHORTER**k), "max_steps": None} for k in (1, 2)]
    return [{name: TIGHTER * case.options.get(name, DEFAULT) for name in ("rtol", "atol")} | {"max_steps": None}]


def _is_resolved(case, run):
    """Whether the motion is one that a method of fixed steps can follow to the end.

    An adaptive one does, and takes most of its steps longer than the shortest fixed ones: where slow slips turn,
    longer steps don't show their order.
    """
    method = case.options.get("integrator")
    if not isinstance(method, Nystrom4):
        return True
    other = run(case, integrator="dop853", rtol=DEFAULT, atol=DEFAULT * min(case.length, 1.0))
    return other.success and np.median(np.diff(other.t)) > method.step / SHORTER**2


def _converging(law, left, case, solution, run):
    """Judge an error of a run, and where it is large, how it falls with the tolerance."""

    def error_of(options):
        other = run(case, **options)
        return left(other) if other.success else np.nan

    return _falling(law, error_of, left(solution), case, run)


def _agreeing(law, case, solution, run, options):
    """Judge the distance of the ends of two runs, and where it is large, how it falls with the tolerances."""
    other = run(case, **options | _tolerances(case, options))
    if not other.success:
        return []

    def apart(tighter):
        one, two = run(case, **tighter), run(case, **tighter | options | _tolerances(case, options, TIGHTER))
        return _distance(case, one, two.q[-1]) if one.success and two.success else np.nan

    rounded = NEAR_SINGULAR_ENDS if laws.is_near_singular(solution) else ROUNDED
    return _falling(law, apart, _distance(case, solution, other.q[-1]), case, run, rounded)


def _falling(law, error_of, error, case, run, rounded=ROUNDED):
    """Judge an error, and where it is large, error_of(options), NaN for runs that fail; below `rounded` it is none."""
    limit, first = MULTIPLE * _tolerance(case), error
    if error <= limit:
        return [Finding(law, error, limit)]
    if not _is_resolved(case, run):
        return []
    for options in _tighter(case):
        before, error = error, error_of(options)
        if np.isnan(error):
            return []
        found = Finding(law, error, max(FALL * before, rounded), f"{first:.1e} at the looser tolerance")
        if not found.broken:
            break
    return [found]


def _tolerances(case, options, factor=1.0):
    """Tolerances beside the name of a method; a form alone keeps those of the case, fixed steps have none."""
    if "integrator" not in options:
        return {}
    return {name: factor * case.options.get(name, DEFAULT) for name in ("rtol", "atol")}


def _distance(case, one, q, own=None):
    """Largest distance of the end of a run, or of `own` in it, from q (n,): positions in units of the scene's size."""
    scale = np.ones(one.q.shape[1])
    lengths = (one.system.bodies[:, :1] + np.arange(3)).ravel()
    scale[lengths] = max(np.abs(one.q[:, lengths] - one.q[0, lengths]).max(initial=0.0), case.length)
    far = ROUNDINGS * EPS * np.abs(one.q[:, lengths]).max(initial=0.0)
    left = np.abs((one.q[-1] if own is None else own) - q)
    left[lengths] = np.maximum(left[lengths] - far, 0.0)
    return float((left / scale).max(initial=0.0))


MOST_STEPS = 3_000  # of a run
COMPARED = 0.7  # of the cases are run in another way, too
PASSAGES = 4
FAULT = "FAULT"


class Judgement(NamedTuple):
    """How a scene or a block of calls came out; a fault's word begins with FAULT."""

    seed: int
    name: str
    word: str
    said: str = ""
    seconds: float = 0.0

    @property
    def fault(self):
        """True if it was none of those that are allowed."""
        return self.word.startswith(FAULT)


def judge_scene(seed, least=None, most=None):
    """Return the `Judgement` of the scene of a seed; one in PASSAGES passes places where a law is not analytic."""
    if least is None and seed % PASSAGES == PASSAGES - 1:
        return judge_case(random_scenes.draw(seed), (another_method,), seed)
    case = generate(seed, least, most)
    return judge_case(case, comparison(np.random.default_rng((seed, 1)), case), seed)


def comparison(rng, case):
    """Return the comparison by which a case is judged besides the laws of its run, in a tuple, or none.

    Motions with impacts at one instant don't depend continuously on their start: methods may differ. Functions of
    the user's have no image, and no place in a file.
    """
    served = (with_few_impacts, mirrored, *OF_THE_SAME) if contacts_of(case.scene.constraints) else ALL
    if "events" in case.options:
        served = with_few_impacts, once_more, stopped, output_times
    return (served[rng.integers(len(served))],) if rng.random() < COMPARED else ()


def judge_case(case, others, seed=None):
    """Return the `Judgement` of a case, judged by the laws of its run and by comparisons with others."""
    began = time.perf_counter()
    try:
        word, said = judge(case, others)
    except TsdynError as error:
        word, said = type(error).__name__, str(error)
        if not said.strip():
            word, said = f"{FAULT} no message", word
    except Exception as error:
        word, said = f"{FAULT} {type(error).__name__}", str(error)
    return Judgement(seed, case.name, word, said, time.perf_counter() - began)


def judge(case, others):
    """Return the word for a case, and what was said; raises what the run raises."""
    if case.assembled:
        case.scene.assemble()
    solution = run_case(case)
    if not solution.success and not solution.message.strip():
        return f"{FAULT} no message", str(solution.status)
    actions = zip(solution.t_events or (), case.options.get("events", ()), strict=True)
    found = laws.findings(solution, [(times, *event.gives) for times, event in actions if event.gives])
    if solution.success:
        found += energy(case, solution, run_case) + momenta(case, solution, run_case)
        found += [one for other in others for one in other(case, solution, run_case)]
    broken = [one for one in found if one.broken]
    if broken:
        return f"{FAULT} {broken[0].law}", "; ".join(map(str, broken[:3]))
    return str(solution.status), solution.message


def run_case(case, by=simulate, **more):
    """Run a case by a function like `simulate`, with other options in place of its own where they are given."""
    options = {"dense_output": True, "max_steps": MOST_STEPS} | case.options | more
    return by(case.scene, case.span, **options)
