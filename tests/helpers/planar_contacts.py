"""Contacts with friction in minimal coordinates, by DOP853 between events: modes by trying all of them."""

from itertools import product

import numpy as np
from scipy.integrate import solve_ivp

SLIP = {"+": 1.0, "-": -1.0}
AT_REST, LEAST = 1e-9, 1e-10  # m/s; rounding of what must not be negative
TOUCHING = 1e-12  # m: gaps that close together
EARLY = 1e-7  # s after an event, in which what has just come to zero isn't watched


def arm(x, xd, turned, lifted=None):
    """A point in a plane: the sum of arms (u, v), each turned by the coordinate of a number, and of a lift along z.

    Returns its place (2,), J (2, n), and J' xd (2,). turned: pairs of a number and (u, v).
    """
    place, J, bias = np.zeros(2), np.zeros((2, len(x))), np.zeros(2)
    if lifted is not None:
        place[1], J[1, lifted] = x[lifted], 1.0
    for i, (u, v) in turned:
        c, s = np.cos(x[i]), np.sin(x[i])
        r = np.array([u * c - v * s, u * s + v * c])
        place, bias = place + r, bias - r * xd[i] ** 2
        J[:, i] += -r[1], r[0]
    return place, J, bias


class PlanarContacts:
    """M xdd = h, and contacts that slide along one direction each: J_N, J_T of gaps and slips.

    Parameters
    ----------
    equations : function
        Of x, xd; returns M (n, n) and h (n,).
    contacts : function
        Of x, xd; returns gaps (k,), J_N and J_T (k, n), and J_N' xd and J_T' xd (k,).
    e, mu : array_like (k,)

    A mode is a string, a letter a contact: "o" open, "s" sticks, "+" and "-" slide.
    """

    def __init__(self, equations, contacts, e, mu):
        self.equations, self.contacts = equations, contacts
        self.e, self.mu = np.asarray(e, float), np.asarray(mu, float)
        self.phases, self.impacts = [], []  # (begin, mode); (t, number, normal impulse)

    def _solved(self, M, given, J_N, J_T, normal, slip, mode):
        """What `given` (n,) becomes by loads of a mode that make J_N x = normal, J_T x = slip; and the loads (k, 2)."""
        closed, sticks = [i for i, m in enumerate(mode) if m != "o"], [i for i, m in enumerate(mode) if m == "s"]
        ways = [J_N[i] - self.mu[i] * SLIP.get(mode[i], 0.0) * J_T[i] for i in closed] + [J_T[i] for i in sticks]
        rows = [J_N[i] for i in closed] + [J_T[i] for i in sticks]
        loads = np.zeros((len(mode), 2))
        if not closed:
            return given, loads
        moved = np.linalg.solve(M, np.array(ways).T)
        wanted = np.append(normal[closed], slip[sticks]) - rows @ given
        p = np.linalg.lstsq(rows @ moved, wanted)[0]  # two that stick on one body share it
        loads[closed, 0], loads[sticks, 1] = p[: len(closed)], p[len(closed) :]
        return given + moved @ p, loads

    def _within(self, mode, loads):
        """Whether contacts push, and those that stick are within the cone."""
        bound, least = self.mu * loads[:, 0] - np.abs(loads[:, 1]), LEAST * (np.abs(loads).max() or 1.0)
        parts = zip(mode, loads[:, 0], bound, strict=True)
        return all(m == "o" or (p > -least and (m != "s" or b > -least)) for m, p, b in parts)

    def accelerations(self, x, xd, mode):
        """xdd, and the loads."""
        M, h = self.equations(x, xd)
        _, J_N, J_T, b_N, b_T = self.contacts(x, xd)
        return self._solved(M, np.linalg.solve(M, h), J_N, J_T, -b_N, -b_T, mode)

    def mode(self, x, xd, touching, ended=()):
        """The mode in which the motion goes on; ended: number and letters of a contact that has left this mode."""
        _, J_N, J_T, b_N, b_T = self.contacts(x, xd)
        slip, rate = J_T @ xd, J_N @ xd
        for mode in product(*("o+-s" if i in touching else "o" for i in range(self.e.size))):
            a, loads = self.accelerations(x, xd, mode)
            a_N, a_T, small = J_N @ a + b_N, J_T @ a + b_T, LEAST * np.abs(a).max()
            fits = self._within(mode, loads)
            if ended and mode[ended[0]] in ended[1]:
                continue
            for i in touching:
                moves, m = abs(slip[i]) > AT_REST, mode[i]
                fits &= (rate[i] > AT_REST or a_N[i] > -small) if m == "o" else rate[i] < AT_REST
                fits &= m != "s" or not moves
                fits &= m not in SLIP or SLIP[m] * (slip[i] if moves else a_T[i] + small * SLIP[m]) > 0.0
            if fits:
                return "".join(mode)
        raise ValueError("no mode fits")

    def hit(self, x, xd, touching):
        """Velocities after an impact, Newton's law, and the loads."""
        M, _ = self.equations(x, xd)
        _, J_N, J_T, *_ = self.contacts(x, xd)
        wanted = -self.e * np.minimum(J_N @ xd, 0.0)
        for mode in product(*("o+-s" if i in touching else "o" for i in range(self.e.size))):
            after, loads = self._solved(M, xd, J_N, J_T, wanted, np.zeros(self.e.size), mode)
            v, slip = J_N @ after, J_T @ after
            fits = self._within(mode, loads)
            for i in touching:
                fits &= mode[i] != "o" or v[i] > wanted[i] - AT_REST
                fits &= mode[i] not in SLIP or SLIP[mode[i]] * slip[i] > -AT_REST
            if fits:
                return after, loads
        raise ValueError("no impact fits")

    def run(self, x, xd, end, touching=(), max_step=1e-3):
        """Run to `end`; the state there. touching: contacts that are closed at the start."""
        t, n, y = 0.0, len(x), np.concatenate([x, xd])
        mode = self.mode(y[:n], y[n:], touching)
        while True:
            self.phases.append((t, mode))

            def rates(_, y, mode=mode):
                return np.concatenate([y[n:], self.accelerations(y[:n], y[n:], mode)[0]])

            run = solve_ivp(
                rates, (t, end), y, "DOP853", events=self._events(t, n, mode), max_step=max_step, rtol=1e-12, atol=1e-14
            )
            t, y = run.t[-1], run.y[:, -1].copy()
            if run.status != 1:
                return y
            number, kind = self._owners[next(i for i, times in enumerate(run.t_events) if times.size)]
            closed = [i for i, m in enumerate(mode) if m != "o"]
            if kind == "gap":
                closed += [
                    i for i, gap in enumerate(self.contacts(y[:n], y[n:])[0]) if mode[i] == "o" and gap < TOUCHING
                ]
                y[n:], loads = self.hit(y[:n], y[n:], closed)
                self.impacts += [(t, i, p) for i, (p, _) in enumerate(loads) if p > 0.0]
            mode = self.mode(y[:n], y[n:], closed, {"bound": (number, "s"), "push": (number, "s+-")}.get(kind))

    def _events(self, begun, n, mode):
        """Gaps of open contacts; normal loads of closed ones, slips of those that slide, bounds of those that stick."""
        self._owners, found = [], []
        for i, m in enumerate(mode):
            for kind in ("gap",) if m == "o" else ("push", "bound" if m == "s" else "slip"):

                def value(t, y, i=i, m=m, kind=kind):
                    if t < begun + EARLY:
                        return 1.0
                    x, xd = y[:n], y[n:]
                    if kind == "gap":
                        return self.contacts(x, xd)[0][i]
                    if kind == "slip":
                        return SLIP[m] * (self.contacts(x, xd)[2][i] @ xd)
                    p, q = self.accelerations(x, xd, mode)[1][i]
                    return p if kind == "push" else self.mu[i] * p - abs(q)

                value.terminal, value.direction = True, -1
                found.append(value)
                self._owners.append((i, kind))
        return found
