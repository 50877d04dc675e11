"""All benchmarks: python -m benchmarks [--quick]. Tables are printed; JSON and figures are written."""

import argparse
import sys
from pathlib import Path

from benchmarks import cold_start, scaling, work_precision

PARTS = ("work-precision", "scaling", "cold-start")


def main(arguments=None):
    """Run what is asked for."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="part", help=f"some of {', '.join(PARTS)}; all where none is named")
    parser.add_argument("--quick", action="store_true", help="two scenes, few settings, small sizes: a minute or two")
    parser.add_argument("--large", action="store_true", help="also scenes of more than 16 bodies")
    parser.add_argument("--scenes", nargs="+", default=(), metavar="WORD", help="scenes whose names hold a word")
    parser.add_argument("--methods", nargs="+", default=(), metavar="WORD", help="contenders whose names hold a word")
    parser.add_argument("--no-peers", action="store_true", help="only tsdyn and the kernels written by hand")
    parser.add_argument("--repeats", type=int, default=5, help="timed rounds (5)")
    parser.add_argument("--budget", type=float, default=3.0, help="seconds that one run may take (3)")
    parser.add_argument("--largest", type=int, default=4096, help="bodies, for scaling (4096)")
    parser.add_argument("--folder", type=Path, default=Path("benchmarks") / "results", help="of JSON")
    parser.add_argument("--figures", type=Path, help="of figures (the folder of JSON; docs/images for the pages)")
    given = parser.parse_args(arguments)
    unknown = set(given.parts) - set(PARTS)
    if unknown:
        parser.error(f"no part {', '.join(sorted(unknown))}; there are {', '.join(PARTS)}")
    parts, figures = given.parts or PARTS, given.figures or given.folder

    def report(line):
        print(line, file=sys.stderr, flush=True)

    if "work-precision" in parts:
        results = work_precision.run(
            given.folder, given.scenes, given.methods, not given.no_peers, given.quick, given.large, given.repeats,
            given.budget, report,
        )  # fmt: skip
        draw("work_precision", results, figures)
    if "scaling" in parts:
        sizes = scaling.run(given.folder, given.quick, largest=given.largest, report=report)
        draw("scaling", sizes, figures)
    if "cold-start" in parts:
        cold_start.main()


def draw(name, results, folder):
    """Write a figure where matplotlib is there."""
    try:
        from benchmarks import figures

        print(f"Figure: {getattr(figures, name)(results, folder / f'{name}.png')}")
    except ImportError as error:
        print(f"No figure: {error}; pip install '.[plot]'")


if __name__ == "__main__":
    main()
