"""Run time against error of every integrator on the reference scenes: tables, and docs/images/work_precision.png.

Run it: python -m benchmarks.work_precision [figure]
"""

import sys
from pathlib import Path

import tsdyn as ts
from benchmarks.scenes import SCENES
from tsdyn.benchmark_plot import figure
from tsdyn.plots import save

FIGURE = Path(__file__).parents[1] / "docs" / "images" / "work_precision.png"


def measure(scenes=SCENES, repeats=3):
    """Yield the title and the Benchmark of each scene."""
    for title, scene in scenes.items():
        yield (
            title,
            ts.benchmark(
                scene.build(),
                [
                    kind
                    for kind in ts.integrators.registered()
                    if kind.__module__.startswith("tsdyn.")
                    and (scene.steps or kind.embedded_order)
                    and kind.__name__ not in scene.without
                ],
                scene.tolerances,
                scene.span,
                steps=scene.steps,
                max_steps=scene.max_steps,
                repeats=repeats,
                reference=scene.reference(),
            ),
        )


def main(arguments=None):
    """Print the tables, write the figure."""
    arguments = sys.argv[1:] if arguments is None else arguments
    found = {}
    for title, benchmark in measure():
        found[title] = benchmark
        print(f"{title}\n{benchmark}\n", flush=True)
        if benchmark.interrupted:
            break
    print(f"Figure: {save(figure(found), Path(arguments[0]) if arguments else FIGURE)}")


if __name__ == "__main__":
    main()
