"""Numbers of bodies, and of gravity, for many cases."""

import numpy as np

from ..sparse.tolerances import THIN
from .columns import inertias, masses, orientations, parameter_rates, vectors

WEIGHTS = {"mass", "inertia"}  # attributes that are numbers of a system; the others are of starts


class GravityColumns:
    """The acceleration of free fall of each case.

    As each sort of columns it has `width`, the numbers of a case; `fill`, which checks and writes them and says which
    cases fit; and `places`: arrays, where a part of them begins, how many words, from which number on.
    """

    width, written = 3, ("gravity",)

    def __init__(self, name):
        self.name = name

    def fill(self, values, numbers, starts):
        """Gravity as it is."""
        numbers[:], fits = vectors(values[self.name])
        return fits

    def places(self, systems, graphs):
        """Gravity of each system."""
        return [(system.gravity, 0, 3, 0) for system in systems]


class MassColumns:
    """m and 1 / m of a body."""

    width, written = 2, ("mass",)

    def __init__(self, body, name, weights):
        self.i, self.name, self.weights = body.index, name, weights
        weights.follow(body)

    def fill(self, values, numbers, starts):
        """Mass and its inverse."""
        m, fits = masses(values[self.name])
        numbers[:, 0], numbers[:, 1] = m, 1.0 / m
        self.weights.masses[self.i] = m
        return fits

    def places(self, systems, graphs):
        """In each system and constraint graph."""
        found = [(system.mass, self.i, 1, 0) for system in systems]
        for graph in graphs:
            found += [(graph.mass, 16 * self.i, 1, 0), (graph.inverse, 16 * self.i, 1, 1)]
        return found


class InertiaColumns:
    """J' and its inverse, and whether the body has a gyroscopic torque, as a word."""

    width, written = 19, ("inertia",)

    def __init__(self, body, name, weights):
        self.i, self.name, self.weights = body.index, name, weights
        weights.follow(body)

    def fill(self, values, numbers, starts):
        """Inertia, its inverse, and whether it is that of a sphere."""
        J, fits = inertias(values[self.name])
        moments = np.linalg.eigh(J)[0]
        fits &= moments[:, 0] > THIN * moments[:, 2]
        numbers[:, :9] = J.reshape(-1, 9)
        J = np.where(fits[:, None, None], J, np.eye(3))
        numbers[:, 9:18] = np.linalg.inv(J).reshape(-1, 9)
        spins = (J[:, :1, :1] * np.eye(3) != J).any(axis=(1, 2))
        numbers[:, 18] = spins.astype(np.int64).view(float)
        self.weights.moments[self.i], self.weights.inertias[self.i] = moments, np.abs(J).max(axis=(1, 2))
        return fits

    def places(self, systems, graphs):
        """In each system, and in each graph in which the orientation isn't locked."""
        i = self.i
        found = [(system.inertia, 9 * i, 9, 0) for system in systems]
        for graph in graphs:
            if graph.bodies[i, 1] == 7:
                for row in range(3):
                    found.append((graph.mass, 16 * i + 4 * (row + 1), 3, 3 * row))
                    found.append((graph.inverse, 16 * i + 4 * (row + 1), 3, 9 + 3 * row))
                found.append((graph.spins, i, 1, 18))
        return found


class StateColumns:
    """The start of a body, which is no number of a system."""

    width, written = 0, ()

    def __init__(self, body, names, arena):
        self.names, self.values = names, body.values
        self.at, length = arena.base.system.bodies[body.index].tolist()
        self.turns = length == 7

    def fill(self, values, numbers, starts):
        """q and qd of the body in the starts of all cases."""
        fits, kept = True, {}
        for attribute, name in self.names.items():
            kept[attribute], good = (orientations if attribute == "orientation" else vectors)(values[name])
            fits = fits & good
        at, q, qd = self.at, starts[:, 0], starts[:, 1]
        if "position" in kept:
            q[:, at : at + 3] = kept["position"]
        if "velocity" in kept:
            qd[:, at : at + 3] = kept["velocity"]
        if self.turns and not kept.keys().isdisjoint(("orientation", "angular_velocity")):
            p, w = (
                kept[name] if name in kept else np.tile(self.values[name], (len(starts), 1))
                for name in ("orientation", "angular_velocity")
            )
            q[:, at + 3 : at + 7], qd[:, at + 3 : at + 7] = p, parameter_rates(p, w)
        return fits

    def places(self, systems, graphs):
        """None: starts are no part of a system."""
        return []
