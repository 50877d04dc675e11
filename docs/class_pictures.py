"""Pictures of classes: a constraint or force in the scene of its own example, a method's error against its work."""

import doctest
import io
from contextlib import redirect_stdout
from functools import cache

import numpy as np

import tsdyn as ts
from docs.painting import markers, paint
from tsdyn.drawing import BLUE, GREY, new_figure
from tsdyn.errors import TsdynError
from tsdyn.measuring.haug_tables import sliding_top

WIDTH, HEIGHT, DPI, COLOURS = 4.2, 3.0, 130, 64
END = 1.0  # s, of scenes that an example doesn't run
TOLERANCES = tuple(10.0**-k for k in range(3, 12))
NUTATING = (0.5, 0.0, 12.0)  # rad/s, of the top that methods are compared on
STEPS = tuple(0.05 / 2**k for k in range(7))  # s


def picture(cls, example, path):
    """Draw the picture of a class; return what it shows, nothing for a class without an example that has a scene."""
    if issubclass(cls, ts.Integrator):
        return method_picture(cls, path)
    solution = example_run(example)
    if solution is None:
        return ""
    item = next((one for one in _items(solution.scene) if type(one) is cls), None)
    with new_figure(WIDTH, HEIGHT) as figure:
        axes = figure.subplots()
        paint(axes, solution, at=(0.0, 1.0))
        named = markers(axes, solution, item) if item is not None else []
        save_small(figure, path)
    what = f"The scene of the example at the start (pale) and after {solution.t[-1]:.3g} s."
    return f"{what} Markers at the end: {', '.join(named)}." if named else what


def save_small(figure, path):
    """Write a picture of few kilobytes: a PNG of few colours."""
    from PIL import Image

    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=DPI)
    Image.open(buffer).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE).save(path, optimize=True)


def _items(scene):
    return [*scene.constraints, *scene.forces, *(scene.primitives)]


def example_run(example):
    """The solution that the Examples section of a docstring has, or a run of its scene; None without a scene."""
    names = {}
    with redirect_stdout(io.StringIO()):
        for one in doctest.DocTestParser().get_examples(example):
            exec(compile(one.source, "<example>", "single"), names)
    found = [value for value in names.values() if isinstance(value, ts.Solution)]
    if found:
        return found[-1]
    scene = next((value for value in names.values() if isinstance(value, ts.Scene)), None)
    return None if scene is None or not scene.bodies else ts.simulate(scene, (0.0, END))


def settings(cls):
    """Instances of a method from loose to tight: by tolerances, or by fixed steps."""
    for tolerance, step in zip(TOLERANCES, (*STEPS, None, None), strict=True):
        try:
            yield cls(rtol=tolerance, atol=tolerance)
        except (TypeError, TsdynError):
            if step is not None:
                yield cls(step=step)


@cache
def work_and_error(cls):
    """Evaluations and errors (k,) each of a method for 2 s of the top."""
    exact = ts.simulate(sliding_top(NUTATING), (0.0, 2.0), integrator=ts.integrators.Taylor(tol=1e-15)).q[-1]
    runs = [ts.simulate(sliding_top(NUTATING), (0.0, 2.0), integrator=method) for method in settings(cls)]
    work = np.array([run.stats.evaluations for run in runs])
    return work, np.maximum([np.abs(run.q[-1] - exact).max() for run in runs], 1e-16)


def method_picture(cls, path):
    """Error against evaluations, the other methods in grey."""
    with new_figure(WIDTH, HEIGHT) as figure:
        axes = figure.subplots()
        for other in ts.integrators.registered():
            if other is not cls and other.__module__.startswith("tsdyn."):
                axes.loglog(*work_and_error(other), color=GREY, linewidth=0.8, alpha=0.5)
        axes.loglog(*work_and_error(cls), "o-", color=BLUE, markersize=4, label=cls.__name__)
        axes.set(xlabel="evaluations", ylabel="error of q after 2 s")
        axes.legend(frameon=False)
        save_small(figure, path)
    return f"A sliding, nutating top: error against evaluations of {cls.__name__}, the other methods in grey."
