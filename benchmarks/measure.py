"""Run time against error: every contender at every useful setting, timed in interleaved rounds."""

from typing import NamedTuple

import numpy as np

ERRORS = tuple(10.0**-k for k in range(2, 15))
BRIEF = 0.02  # s, that a sample is made of at least, as far as its calls go


class Row(NamedTuple):
    """One contender at one setting."""

    contender: str
    setting: str  # "tolerance" or "step" (s)
    value: float
    error: float  # largest over positions (m) and rotation matrices at the end
    seconds: float  # median over rounds
    least: float  # the least of all samples
    rounds: int
    message: str = ""  # of a run that failed; error and seconds are inf


class Measured(NamedTuple):
    """A scene's rows."""

    scene: str
    trusted: float  # what the reference is right to
    source: str
    rows: tuple

    def contenders(self):
        """Their names, in the order of the rows."""
        return tuple(dict.fromkeys(row.contender for row in self.rows))

    def seconds_to(self, contender, error, which="seconds"):
        """The least time to an error, between settings by straight lines in logarithms; inf where it isn't reached."""
        rows = [row for row in self.rows if row.contender == contender and not row.message]
        points = sorted((row.error, getattr(row, which)) for row in rows)
        points = [point for point in points if point[0] > 0.0]
        best = np.inf
        for e, s in points:
            if e <= error:
                best = min(best, s)
        for e, s in points:
            for f, u in points:
                if e <= error < f and u < s:
                    share = np.log(error / e) / np.log(f / e)
                    best = min(best, float(np.exp((1 - share) * np.log(s) + share * np.log(u))))
        return best

    def table(self, errors=ERRORS):
        """Milliseconds to each error, a line a contender."""
        width = max([len(name) for name in self.contenders()] + [len(self.scene)])
        lines = [f"{self.scene:{width}}" + "".join(f"{f'{error:.0e}':>9}" for error in errors)]
        for name in self.contenders():
            cells = [self.seconds_to(name, error) for error in errors]
            text = "".join(f"{_milliseconds(x) if np.isfinite(x) else '-':>9}" for x in cells)
            said = {row.message for row in self.rows if row.contender == name and row.message}
            note = f"   {min(said)}" if said and not np.isfinite(min(cells)) else ""
            lines.append(f"{name:{width}}{text}{note}"[:200])
        return "\n".join(lines)


def _milliseconds(seconds):
    return f"{1e3 * seconds:.3g}" if seconds < 1.0 else f"{1e3 * seconds:.0f}"


def measure(scene, contenders, repeats=5, budget=3.0, thin=1, report=print):
    """Return the Measured of a scene.

    Parameters
    ----------
    scene : scenes.Benchmarked
    contenders : sequence of Contender
        Those that are missing or don't serve the scene are passed over.
    repeats : int
        Timed rounds; runs slower than 1 s are timed in the first two only.
    budget : float, s
        A contender goes on to tighter settings until a run takes longer.
    thin : int
        Take every so many settings.
    report : callable, given a line of progress
    """
    reference = scene.reference()
    r, A = reference.r[-1], reference.A[-1]
    rows, runs, most = [], [], []
    for contender in contenders:
        if contender.serves(scene):
            report(f"{scene.name}: {contender.name}")
            for row, run in _ladder(contender, scene, r, A, budget, thin):
                rows.append(row)
                runs.append(run)
                most.append(contender.calls)
    samples = [[] for _ in rows]
    for turn in range(repeats):
        report(f"{scene.name}: round {turn + 1} of {repeats}")
        for i, (row, run) in enumerate(zip(rows, runs, strict=True)):
            if not row.message and (row.seconds < 1.0 or turn < 2):
                calls = int(np.clip(BRIEF / row.seconds, 1, most[i]))
                if calls > 1:
                    run(row.value)  # what ran before has taken the caches
                samples[i].append([run(row.value).seconds for _ in range(calls)])
    rows = [
        row._replace(
            seconds=float(np.median([np.median(x) for x in taken])),
            least=float(min(min(x) for x in taken)),
            rounds=len(taken),
        )
        if taken
        else row
        for row, taken in zip(rows, samples, strict=True)
    ]
    return Measured(scene.name, reference.trusted, reference.source, tuple(rows))


def _ladder(contender, scene, r, A, budget, thin):
    """Rows and runs from loose to tight, until one takes too long or the error falls no further."""
    try:
        run = contender.prepare(scene)
    except Exception as error:  # of another engine's own kind: it is one row of many
        yield Row(contender.name, contender.setting, np.nan, np.inf, np.inf, np.inf, 0, _said(error)), None
        return
    best, idle, failed = np.inf, 0, 0
    for value in contender.values[::thin]:
        try:
            outcome = run(value)
            if outcome.seconds < 0.5 * budget:  # the first call may have compiled or loaded something
                outcome = min(outcome, run(value), key=lambda one: one.seconds)
        except Exception as error:
            yield Row(contender.name, contender.setting, value, np.inf, np.inf, np.inf, 0, _said(error)), None
            failed += 1
            if failed == 3:
                return
            continue
        off = outcome.error(r, A)
        yield Row(contender.name, contender.setting, value, off, outcome.seconds, outcome.seconds, 1), run
        idle = 0 if off < 0.5 * best else idle + 1
        best = min(best, off)
        if outcome.seconds > budget or (idle == 3 and best < 1e-9):
            return


def _said(error):
    return f"{type(error).__name__}: {error}".splitlines()[0]
