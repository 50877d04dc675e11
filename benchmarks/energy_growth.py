"""Growth of conservation errors over many steps at the tightest tolerance (Brouwer's law), beside heyoka.

Root mean square over perturbed starts: states of one run at random times, with velocities scaled by 0.9 to 1. Columns:
steps; errors of energy, relative to the largest kinetic energy, and of conserved momenta, relative to the sum of their
parts, both over eps sqrt(steps); exponent of the energy error from 1e4 steps on; mean energy error of a step, with
its standard error; constraint errors, 99th percentile of the last tenth over that of the first thousand steps, the
worst of the three levels.

Run it: python -m benchmarks.energy_growth [--steps 1e5] [--starts 32] [--scenes top chain] [--figure growth.png]
"""

import argparse
from typing import NamedTuple

import numpy as np

import tsdyn as ts
from benchmarks.peers.heyoka import Heyoka, integrator
from benchmarks.scenes import of_file
from examples import coin
from tests.helpers.closed_loops import bricard
from tsdyn.observables.diagnostics import body_motions
from tsdyn.stress import rods

EPS, OUTPUTS, DENSE, FIRST = np.finfo(float).eps, 32, 300, 1e4


def _chain():
    return rods.build(rods.chain(4) | {"forces": []})


SCENES = {
    "top": lambda: rods.build(of_file("sliding_top")),
    "pendulum": lambda: rods.build(of_file("two_body_pendulum_spatial")),
    "chain": _chain,
    "bricard": bricard,
    "disc": lambda: coin.rolling(0.3, (0.4, 8.0, 1.5)),
}
# Components of angular and linear momentum that are conserved: index of the axis; none of Bricard's loop, held twice
ANGULAR, LINEAR = {"top": [2], "pendulum": [2], "chain": [2]}, {"top": [0, 1]}


class Growth(NamedTuple):
    """One scene."""

    name: str
    steps: np.ndarray  # (k,), mean over the starts
    energy: np.ndarray  # (starts, k), relative
    momentum: np.ndarray  # (starts, k), relative; the largest of all components
    constraints: float  # the end over the beginning

    @property
    def rms(self):
        """Energy error (k,), root mean square over the starts."""
        return np.sqrt((self.energy**2).mean(axis=0))

    def line(self):
        """The columns of a table."""
        late = self.steps >= min(FIRST, self.steps[-1] / 10)
        exponent = np.polyfit(np.log(self.steps[late]), np.log(self.rms[late]), 1)[0]
        walk = EPS * np.sqrt(self.steps[-1])
        mean = self.energy[:, -1] / self.steps[-1]
        momentum = np.sqrt((self.momentum[:, -1] ** 2).mean()) / walk
        return (
            f"{self.name:10}{self.steps[-1]:9.0f}{self.rms[-1] / walk:8.2f}{momentum:8.2f}{exponent:8.2f}"
            f"{mean.mean():10.1e} +-{mean.std() / np.sqrt(mean.size):8.1e}{self.constraints:8.2f}"
        )


def starts(scene, count, seed=0):
    """Perturbed states of a scene."""
    rng = np.random.default_rng(seed)
    t = np.sort(rng.uniform(1.0, 40.0, count))
    run = ts.simulate(scene, (0.0, 41.0), integrator=ts.integrators.Taylor(1e-12), t_eval=t)
    scale = rng.uniform(0.9, 1.0, (count, 1))
    rows = zip(run.q, scale * run.qd, run.qdd, run.multipliers, strict=True)
    return [ts.State(0.0, *row) for row in rows]


def _momentum_error(name, solution):
    """Change of the conserved momenta (k,) over the sum of their parts' magnitudes."""
    angular, linear = ANGULAR.get(name, []), LINEAR.get(name, [])
    spans = np.zeros(solution.t.size)
    for bodies in body_motions(solution.system, solution.q, solution.qd):
        orbital = np.abs(bodies.mass[:, None] * np.cross(bodies.r, bodies.rd)).sum(axis=(1, 2))
        spin = np.abs(np.einsum("bij,kbj->kbi", bodies.inertia, bodies.omega)).sum(axis=(1, 2))
        speed = np.abs(bodies.mass[:, None] * bodies.rd).sum(axis=(1, 2))
        spans += orbital + spin + speed
    found = np.hstack((solution.angular_momentum[:, angular], solution.linear_momentum[:, linear]))
    return np.abs(found - found[0]).max(axis=1, initial=0.0) / spans.max()


def grow(name, steps, count, method=None):
    """Run a scene from all starts; return its `Growth`."""
    scene, method = SCENES[name](), method or ts.integrators.Taylor()
    pilot = ts.simulate(scene, (0.0, 100.0), integrator=method, t_eval=(0.0, 100.0))
    end = 100.0 * steps / pilot.stats.steps
    marks = np.geomspace(end / 1e3, end, OUTPUTS)
    early, late = np.linspace(0.0, 1000.0 * end / steps, DENSE), np.linspace(0.9 * end, end, DENSE)
    times = np.unique(np.concatenate((marks, early, late)))
    at = np.searchsorted(times, marks)
    energy, momentum, made, levels = [], [], [], []
    for state in starts(scene, count):
        run = ts.simulate(scene, (0.0, end), integrator=method, state=state, t_eval=times, history=False)
        run.raise_if_failed()
        energy.append((run.energy - run.energy[0])[at] / run.kinetic_energy.max())
        momentum.append(_momentum_error(name, run)[at])
        made.append(run.stats.steps)
        levels.append(run.constraint_error)
    first, last = (
        np.percentile(np.array(levels)[:, :, where], 99, axis=(0, 2))
        for where in (times <= early[-1], times >= late[0])
    )
    mean = marks / end * np.mean(made)
    return Growth(name, mean, np.array(energy), np.array(momentum), float((last / first).max()))


def heyoka(steps, count):
    """The top by heyoka in minimal coordinates, with its default tolerance, eps, and high accuracy."""
    scene = SCENES["top"]()
    body = scene.bodies[0]
    taylor = integrator(of_file("sliding_top"), tol=EPS, high_accuracy=True)
    energy = []
    for state in starts(scene, count):
        p, pd = state.q[3:7], state.qd[3:7]
        e, x = p[0], p[1:]
        omega = 2.0 * (e * pd[1:] - pd[0] * x - np.cross(x, pd[1:]))
        taylor.time, taylor.state[:] = 0.0, [*p, *omega]
        marks, values, most = [0, *np.geomspace(steps / 1e3, steps, OUTPUTS).astype(int)], [], 0.0
        for before, mark in zip([0, *marks], marks, strict=False):
            for _ in range(mark - before):
                taylor.step()
            kinetic, potential = _energy_of_top(body, taylor.state)
            values.append(kinetic + potential)
            most = max(most, kinetic)
        energy.append((np.array(values) - values[0])[1:] / most)
    energy = np.array(energy)
    return Growth("heyoka", np.array(marks[1:], float), energy, 0.0 * energy, np.nan)


def _energy_of_top(body, state):
    """Kinetic and potential energy by p and omega', the tip on the plane z = 0."""
    e0, e1, e2, e3, a, b, c = state
    nx, ny, nz = 2.0 * (e1 * e3 - e0 * e2), 2.0 * (e2 * e3 + e0 * e1), e0 * e0 - e1 * e1 - e2 * e2 + e3 * e3
    fall = nx * b - ny * a
    J = np.diag(body.inertia)
    return 0.5 * (body.mass * fall**2 + J[0] * a * a + J[1] * b * b + J[2] * c * c), body.mass * 9.6 * nz


def draw(found, path):
    """Energy error against steps, a line a scene; needs matplotlib."""
    from benchmarks.figures import COLOURS, sheet
    from tsdyn.plots import save

    drawn, (ax,) = sheet(1, 5.6, 4.2)
    for one, colour in zip(found, COLOURS, strict=False):
        ax.plot(one.steps, one.rms, color=colour, label=one.name)
    steps = found[0].steps
    ax.plot(steps, 5.0 * EPS * np.sqrt(steps), "k--", label="5 eps sqrt(steps)")
    ax.set(xlabel="steps", ylabel="energy error, rms over the starts / largest kinetic energy")
    ax.legend(frameon=False, fontsize=8)
    return save(drawn, path)


def main():
    """Measure, print, draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=float, default=1e5)
    parser.add_argument("--starts", type=int, default=32)
    parser.add_argument("--scenes", nargs="+", choices=[*SCENES, "heyoka"], default=[*SCENES, "heyoka"])
    parser.add_argument("--figure")
    given = parser.parse_args()
    print("scene         steps  energy  momenta exponent  energy a step           constraints")
    found = []
    for name in given.scenes:
        if name == "heyoka" and Heyoka().missing():
            print(Heyoka().missing())
            continue
        one = heyoka(given.steps, given.starts) if name == "heyoka" else grow(name, given.steps, given.starts)
        print(one.line(), flush=True)
        found.append(one)
    if given.figure:
        print(f"Figure: {draw(found, given.figure)}")


if __name__ == "__main__":
    main()
