"""Run time against error of tsdyn's methods, kernels written by hand and other engines: tables, JSON and a figure.

Run it: python -m benchmarks work-precision, or see python -m benchmarks --help
"""

import json
from pathlib import Path

import numpy as np

from benchmarks import ours, peers, provenance
from benchmarks.by_hand import contenders as by_hand
from benchmarks.measure import Measured, Row, measure
from benchmarks.scenes import FULL, SCENES

QUICK = ("sliding top", "chain of 4")
TITLE = (
    "Run time against error at the end (positions in m, rotation matrices); milliseconds, medians of interleaved runs"
)


def contenders(words=(), others=True):
    """Those whose names hold one of the words (all where there are none), the missing ones as lines that say so."""
    every = (*ours.contenders(), *by_hand.CONTENDERS, *(peers.contenders() if others else ()))
    wanted = [one for one in every if not words or any(word.lower() in one.name.lower() for word in words)]
    lines = [one.missing() for one in wanted]
    return [one for one, line in zip(wanted, lines, strict=True) if not line], [line for line in lines if line]


def run(folder, scenes=(), words=(), others=True, quick=False, large=False, repeats=5, budget=3.0, report=print):
    """Measure, print tables, write work_precision.json into a folder; the Measured of all scenes."""
    names = [name for name in SCENES if any(word.lower() in name for word in scenes)] if scenes else ()
    names = names or (QUICK if quick else tuple(SCENES) if large else FULL)
    found, missing = contenders(words, others)
    for line in missing:
        report(line)
    results = []
    print(f"{TITLE}\n{provenance.line()}\n")
    for name in names:
        settings = {"repeats": 2, "budget": 0.3, "thin": 2} if quick else {"repeats": repeats, "budget": budget}
        results.append(measure(SCENES[name], found, report=report, **settings))
        print(
            f"{results[-1].table()}\nreference: {results[-1].source}, trusted to {results[-1].trusted:.0e}\n",
            flush=True,
        )
        write(results, found, folder / "work_precision.json")
    return results


def write(results, found, path):
    """Rows with machine and versions."""
    path.parent.mkdir(parents=True, exist_ok=True)
    data = provenance.stamp({one.name: one.version() for one in found})
    data["scenes"] = [one._asdict() | {"rows": [row._asdict() for row in one.rows]} for one in results]
    text = json.dumps(data, indent=1, default=float).replace("Infinity", "null").replace("NaN", "null")
    path.write_text(text + "\n")


def read(path):
    """Return the Measured of a file written by `write`."""
    scenes = json.loads(Path(path).read_text())["scenes"]
    whole = lambda row: {k: np.inf if v is None else v for k, v in row.items()}  # noqa: E731
    return [Measured(**one | {"rows": tuple(Row(**whole(row)) for row in one["rows"])}) for one in scenes]


def main():
    """Everything but scaling and cold start."""
    from benchmarks.__main__ import main as command

    command(["work-precision"])


if __name__ == "__main__":
    main()
