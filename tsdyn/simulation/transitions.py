"""From one phase of a run to the next one: impacts, and which contacts close, frictions stick or slide."""

from functools import partial

import numpy as np

from ..analyses.contact_friction import Cones, at_turn, halted, solve_rough_contacts
from ..analyses.contact_problem import Inertia, NoSolution, solve_contacts
from ..analyses.friction_problem import NoRest, RestProblem, free_motions, gradients, values_of
from ..analyses.frictions import Hold
from ..analyses.tolerances import EVENT_ERROR, KEPT_WAY, LEVEL, PIVOTS, RESTS, STOPPED
from ..elements.bodies import largest_of_kind
from ..elements.tolerances import SLIP
from ..errors import (
    SingularConfiguration,
    Status,
)
from ..jit.kernels import twin
from ..maths.dense_solve import product
from ..maths.tolerances import EPS, NEGLIGIBLE, RANK_TOL
from ..model.handles import handles_of
from ..observables.generalised_forces import force_loads
from ..observables.state import begin_memory
from ..runs.tolerances import START_ZERO
from ..validation import listed
from .flights import is_pushed
from .grips import gripped, stopping_time
from .impacts import along_normals, held, impact_of, impulse_of, jumped
from .phase_scenes import NAMED, gaps_of
from .phases import Impulse, UnitModes
from .scene_cache import prepared
from .tolerances import ACCUMULATED, CREEPING, EVENTS_JUDGED, FLIGHT, LATER, MOST_AT_AN_INSTANT, PRESSED, ROUNDED


def contact_state(inertia, resting, qd, fired=()):
    """The `ContactState`, with friction or without; arguments as of `solve_contacts`."""
    solve = solve_rough_contacts if inertia.gaps.rough[resting].any() else solve_contacts
    return solve(inertia, resting, qd, fired)


class Transitions:
    """Mixed into `_ContactRun`: what it does between two phases."""

    def _transit(self, fired, measured=True, sunk=()):
        """From one phase to the next one, after events of the units `fired`; the Status if there is no way on.

        measured: whether the energy that impacts take is noted; sunk: gaps that a start has taken below zero.
        """
        self.reason, qd = "", self.qd
        if self._has_fallen(fired) or self._is_deep(sunk) or self._is_stuck():
            return Status.CONTACT_FAILED
        count, own, before = self.gaps.count, self.frictions.count, self.modes
        if self.slowing is not None:
            before.turning = self.slowing.turning
        # What was to rise by less than rounding, and has risen by more, is open
        hit = [i for i in fired if i < count and (i not in before.lifted or i in self.near)]
        low = FLIGHT * self.gaps.lengths(self.length)
        idle = [i for i in before.idle if self.gap[i] <= low[i]]  # the others have opened
        touching = {*self.near, *hit, *before.closed, *idle}.intersection(self.able)
        slips = [i - count - own for i in fired if i >= count + own]
        broken = [i - count for i in fired if count <= i < count + own]
        status = self._settle(sorted(touching), hit, broken, slips)
        if measured and self.qd is not qd:
            self.phases.gain(self.gaps.workspace.gain(self.q, qd, self.qd))
        return status

    def _has_fallen(self, fired):
        """Whether gaps among the units `fired` have fallen that others were to hold; says so."""
        fallen = [self.gaps.names[i] for i in fired if i in self.modes.idle]
        if fallen:
            self.reason = (
                f"At t = {self.t:.9g} s other contacts no longer hold {listed(fallen, NAMED)}, as they did where the "
                "phase began: which of them carry the load was not determined there, and those chosen may have "
                "turned bodies. One contact at the middle of an edge in place of both ends determines the load."
            )
        return bool(fallen)

    def _is_stuck(self):
        """Whether events no longer let time go on; says so."""
        since, count = self.judged
        self.at_once = self.at_once + 1 if any(map(self._is_now, self.phases.starts[-1:])) else 0
        self.judged = since, count + 1
        if self.at_once > MOST_AT_AN_INSTANT + self.gaps.count + self.frictions.count:
            self.reason = f"There are {self.at_once} events at t = {self.t:.9g} s."
            return True
        if count + 1 >= EVENTS_JUDGED * (1 + self.gaps.count + self.frictions.count):
            if (self.span[1] - self.t) > CREEPING * (self.t - since):
                self.reason = f"The last {count + 1} events took {self.t - since:.3g} s: they accumulate."
                return True
            self.judged = self.t, 0
        return False

    def _largest(self, qd):
        """The largest size of rates of its kind, in place of each of qd (n,)."""
        return largest_of_kind(self.scene.system.bodies, qd)

    def _is_now(self, t):
        """Whether a time before the present one is the same instant, to rounding."""
        return self.t - t <= 16.0 * EPS * max(abs(self.t), EPS)

    def _settle(self, *which):
        """As `_decide_modes`; rows of frictions that don't hold remember zeros."""
        status = self._decide_modes(*which)
        if not self.frictions.count:
            return status
        memory, held = self.remembered[self.count :], self.frictions.held
        known = {**self.modes.sticking, **self.modes.sharing}
        ranks = [known.get(i, 0) for i in range(self.frictions.count)]
        left = [slot for rank, slots in zip(ranks, held, strict=True) for slot in slots[rank:].ravel().tolist()]
        if memory[left].any():
            self.remembered = self.remembered.copy()
            self.remembered[self.count :][left] = 0.0
        return status

    def _decide_modes(self, touching, fired, broken, slips=()):
        """Impact, then which gaps stay closed, which frictions stick; the Status if there is no way on, else None.

        fired, broken: gaps and frictions whose events have come; slips: gaps whose slips have begun, ended or turned.
        """
        slots, qd = self.remembered[self.count :], self.qd
        before, self.modes, self.rest = self.modes, UnitModes(), self.t
        turned = list(filter(before.slides, slips))
        if not touching:
            return self._decide_frictions(before, broken, self._rounding(before))
        try:
            if len(touching) == 1 and self._bounces(touching[0], before, slots):
                return None
            near = self._low_flights(touching)
            inertia = Inertia(self.gaps, self.t, self.q, slots, [*touching, *near], before.closed, broken=slips)
            rates = inertia.rates(self.qd)
            # Rows have held the rates of closed gaps at zero, beside the velocities of all bodies; rates that are
            # rounding of these are of no sign, and no start of a flight
            small, unstruck = NEGLIGIBLE * inertia.sizes(self._largest(self.qd)), self._is_unstruck()
            rates[[i for i in touching if abs(rates[i]) <= small[i] or (unstruck and i in before.closed)]] = 0.0
            # What rounding of the time leaves open is no rate: gaps close, or reach the tops of flights, at once
            none = RESTS * EPS * abs(self.t) * inertia.accelerations(self.qd)[1]
            rates[np.abs(rates) <= none] = 0.0
            grazing = [i for i in fired if i not in before.closed and rates[i] >= 0.0 and i not in self.gaps.following]
            ratchets = [i for i in fired if i not in before.closed and i in self.gaps.following]
            if ratchets:  # they take hold
                p, self.qd, rates = held(inertia, self.qd, ratchets, rates)
                self._note_impulses(inertia, ratchets, along_normals(p), qd)
            if (rates[touching] < 0.0).any():
                rates = self._hit(inertia, touching, near, rates)
            resting = [i for i in touching if rates[i] == 0.0]
            if self.qd is not qd and resting:  # rounding of the velocities before an impact is left
                _, self.qd, left = held(inertia, self.qd, resting, inertia.rates(self.qd))
                rates[np.abs(left) <= none] = 0.0  # of rows that depend on these, too
                resting = [i for i in touching if rates[i] == 0.0]
            opening = [i for i in touching if rates[i] > 0.0]
            # What grazes without a reaction has left: its gap was rounding. What has left at this instant doesn't come
            # back by rounding: contacts that leave together would take turns
            left = [i for i, (at, _, rate, _) in before.opened.items() if rate == 0.0 and self._is_now(at)]
            leaving = [*(i for i in fired if i in before.closed or i in grazing), *left]
            broken = broken if self.qd is qd else ()  # an impact has given them other velocities
            struck = self._largest(self.qd - qd)
            rounding = self._rounding(before) + NEGLIGIBLE * self.frictions.sizes(self.q, struck, self.length)
            self.modes, struck = UnitModes(), self.qd
            rough = self.gaps.rough[resting].any()

            def settled(leaving):
                if rough:
                    return at_turn(inertia, resting, struck, leaving, turned, opening)
                return struck, solve_contacts(inertia, resting, struck, leaving)

            self.qd, contacts = settled(leaving)
            if unloaded := self._unloaded(inertia, contacts, resting, leaving):
                found = settled([*leaving, *unloaded])
                if not {*found[1].closed, *found[1].idle}.intersection(unloaded):
                    leaving, (self.qd, contacts) = [*leaving, *unloaded], found
            if rough:
                if self.qd is not struck and np.array_equal(struck, self.ended):
                    self.rest = self.t + stopping_time(inertia, resting, struck, self.qd, self.qdd, contacts.slow)
                if self.qd is not struck and opening:
                    rates = inertia.rates(self.qd)
            rounding += self.frictions.sizes(self.q, self.qd - struck, self.length)
            if opening:
                self._open(inertia, opening, rates, -contacts.accelerations)
            self._take_contacts(contacts, before)
            status = self._decide_all(before, inertia, touching, resting, leaving, broken, rounding)
            kept = {*self.modes.closed, *self.modes.idle}
            self.modes.opened |= {i: self._opened(i) for i in resting if i not in kept}
            self._begin_memory([i for i in self.modes.closed if i not in before.closed])
            return status
        except SingularConfiguration as error:
            self.reason = str(error)
            return Status.SINGULAR
        except NoSolution:
            names = listed(list(dict.fromkeys(self.gaps.names[i] for i in touching)), NAMED)
            self.reason = f"No reactions keep these contacts from penetrating at t = {self.t:.9g} s: {names}."
            if self.gaps.rough[touching].any():
                self.reason += (
                    " With much friction rigid bodies that slide may have none, or several (Painleve's paradox): lower "
                    "kinetic, or use a compliant contact."
                )
            return Status.CONTACT_FAILED

    def _unloaded(self, inertia, contacts, resting, leaving):
        """Gaps without reactions that open at once, though at this instant they have no acceleration.

        Reactions that are rounding of zero rise or fall: which of them do follows from the complementarity problem a
        little later. Where two of four corners have carried a body, the others have had no reaction that could vanish;
        when those of the two do, nothing presses them, either.
        """
        kept = [i for i in resting if i not in leaving]
        most = inertia.accelerations(self.qd)[1].max()
        if not contacts.slack or most == 0.0:
            return []
        dt, slots = LATER * np.sqrt(self.length / most), self.remembered[self.count :]
        q, qd = self.q + dt * self.qd, self.qd + dt * inertia.motion(self.qd, contacts.push)
        later = Inertia(self.gaps, self.t + dt, q, slots, inertia.which.tolist(), contacts.closed)
        sticks = [i for i in contacts.closed if contacts.grips.get(i, ()) is None]
        try:
            qd = halted(later, qd, contacts.closed, sticks)[0]
            found, least = contact_state(later, kept, qd), PRESSED * LEVEL * later.accelerations(qd)[1]
        except NoSolution:
            return []
        finally:
            inertia.free(inertia.J[:0].T)  # the factors are those of the present state again
        stays, light = {*found.closed, *found.idle}, {*contacts.slack, *contacts.idle}
        return [i for i in kept if i in light and i not in stays and found.accelerations[i] > least[i]]

    def _open(self, inertia, which, rates, a):
        """Open the gaps `which`, with these rates and decelerations a (count,).

        Flights below rounding of the gap end at their tops; of a rate that is no more without a deceleration, rounding
        of the gap is no end.
        """
        rounding, modes = self._heights(inertia), self.modes
        below = rates**2 < 2.0 * rounding * np.maximum(a, 0.0)
        grazes = rates**2 < 2.0 * rounding * inertia.accelerations(self.qd)[1]
        rises = below & (inertia.rates(self.qd) > 0.0)
        modes.lifted = [i for i in which if rises[i]]
        none = grazes & (below | (a <= 0.0))
        for i in which:
            if not rises[i]:
                modes.opened[i] = self._opened(i) if none[i] else self._opened(i, rates[i], 0.25 * rounding[i])

    def _opened(self, i, rate=0.0, rounding=None):
        """What `UnitModes.opened` has of a gap that opens now."""
        if rounding is None:
            rounding = START_ZERO * self.gaps.lengths(self.length)[i]
        return self.t, self.gap[i], rate, rounding

    def _heights(self, inertia):
        """Rounding of the gaps (count,), m or rad: lower flights are none."""
        return EPS * np.maximum(self.gaps.lengths(self.length), ROUNDED * inertia.sizes(self.q))

    def _take_contacts(self, contacts, before):
        """Take over a `ContactState`."""
        self.remembered, modes = self.remembered.copy(), self.modes
        modes.closed, modes.slack = sorted([*contacts.closed, *contacts.dependent]), dict(contacts.slack)
        modes.idle = [i for i in contacts.idle if i not in contacts.dependent]
        modes.spread, modes.dependent = dict(contacts.spread), list(contacts.dependent)
        stuck = {i for i in before.closed if not before.slides(i) and contacts.grips.get(i) is not None}
        modes.rising = {i: (self.t, contacts.begun.get(i, 0.0)) for i in sorted(stuck | contacts.begun.keys())}
        modes.grips = gripped(self.gaps, before, contacts, self.q, self.remembered[self.count :])

    def _begin_memory(self, closed):
        """Rows that come remember nothing of a time when they held: a rope may have turned over since."""
        items = [item for i in closed for item in (self.gaps.list[i].contact, self.gaps.list[i].side.row)]
        if items and self.scene.system.memory.size:
            self.remembered, packed = self.remembered.copy(), self.scene.packed
            angles, memory = self.remembered[: self.count], self.remembered[self.count :]
            begin_memory(packed, handles_of(packed), angles, memory, items)

    def _decide_all(self, before, unheld, touching, resting, leaving, broken, rounding):
        """Frictions beside the contacts at rest, and the rows that hold these then; as of `_decide_modes`.

        unheld: the `Inertia` without frictions; rounding: as of `_decide_frictions`. Again where other gaps close: the
        ways of frictions end there.
        """
        cones = Cones(unheld, resting, self.qd) if self.frictions.count and resting else None
        for _ in range(PIVOTS):
            status = self._decide_frictions(before, broken, rounding, cones)
            if status is not None or not (self.frictions.count and resting):
                return status
            holds = [self._hold(i, rank) for i, rank in self.modes.sticking.items()]
            slots, gaps = self.remembered[self.count :].copy(), self._gaps_with(holds)
            for unit in self.frictions.units:
                slots[unit.way] = 0.0  # their loads are known
            inertia = Inertia(gaps, self.t, self.q, slots, touching, self.modes.closed, self.friction, unheld.broken)
            dead = [i for i in resting if inertia.G[i, i] <= RANK_TOL * unheld.G[i, i]]  # frictions hold these
            contacts = contact_state(inertia, [i for i in resting if i not in dead], self.qd, leaving)
            a = contacts.accelerations
            small = LEVEL * np.maximum(*(each.accelerations(self.qd)[1] for each in (inertia, unheld)))
            if (a[dead] < -small[dead]).any():
                raise NoSolution
            idle, known = [i for i in dead if a[i] <= small[i]], {*self.modes.closed, *self.modes.idle}
            grips = {**contacts.grips, **{i: None for i in idle if self.gaps.rough[i]}}
            self._take_contacts(contacts._replace(idle=sorted([*contacts.idle, *idle]), grips=grips), before)
            if known == {*self.modes.closed, *self.modes.idle}:
                return None
        names = listed([*(self.gaps.names[i] for i in resting), *self.frictions.names], NAMED)
        self.reason = f"No set of closed contacts and sticking frictions is consistent at t = {self.t:.9g} s: {names}."
        return Status.CONTACT_FAILED

    def _gaps_with(self, holds):
        """The `Gaps` of the scene in which these rows hold frictions."""
        key = frozenset(hold.key for hold in holds)
        if key not in self.held_gaps:
            free = self._scene_of([], holds)
            start = (self.q.copy(), self.qd.copy()), self.t, self._tol(), self.remembered
            prepared(free).start(free, *start, True)  # finds redundant rows
            self.held_gaps[key] = gaps_of(self.scene, self.without, holds)
        return self.held_gaps[key]

    def _rounding(self, before):
        """Speeds (units,) at which frictions rest for sure: any of those that stick, but after an impact."""
        found = np.zeros(self.frictions.count)
        if self._is_unstruck():
            found[list(before.sticking)] = np.inf
        return found

    def _is_unstruck(self):
        """Whether velocities are those with which the phase before has ended: what has held still does."""
        return np.array_equal(self.qd, self.ended)

    def _decide_frictions(self, before, fired, rounding, cones=None):
        """Which frictions stick, and what the others exert on contacts; the Status if there is no way on, else None.

        rounding: of speeds (units,), beside that of the bodies' velocities; cones: the `Cones` of contacts at rest.
        """
        frictions, count = self.frictions, self.count
        if not frictions.count:
            return None
        v, _, _ = frictions.motions(self.q[None], self.qd[None])
        # Velocities that change within rounding of the time are at rest, too, and those that come to rest at
        # once: where loads vanish along a chain events would follow each other ever faster
        sizes, rates, paces = self._slip_terms_of_frictions()
        place = frictions.at(self.q, paces, self.length)
        least = np.maximum(NEGLIGIBLE * sizes + rounding, RESTS * EPS * abs(self.t) * rates)
        least = np.maximum(least, EVENT_ERROR * np.minimum(sizes, (self.t - self.span[0]) * rates))
        self.remembered, resting, guess, turned, turning = self.remembered.copy(), [], {}, {}, {}
        memory = self.remembered[count:]  # a part of it
        self.modes.blocked = self.off
        self.modes.limits = {i: x for i, x in before.limits.items() if i not in (*fired, *before.sticking)}
        for i, unit in enumerate(frictions.units):
            if i in self.off:
                continue
            speed, signed = np.linalg.norm(v[0, i]), frictions.signed[i]
            slides = memory[unit.way].any()
            if i in before.blocked and slides:
                guess[i] = place.read(i, memory)
            idle = i in before.blocked and not slides  # until a motor begins to move it
            if idle or not signed:
                least[i] = max(least[i], STOPPED * paces[i])
            if speed <= least[i] or (signed and i in fired and not idle):
                resting.append(i)
                if signed and slides:
                    turned[i] = -place.read(i, memory)
                memory[unit.way] = 0.0
            else:
                memory[unit.way] = place.written(i, v[0, i] / speed)
                if speed < before.turning.get(i, 0.0):
                    turning[i] = before.turning[i]
        self._keep_ways(turning)
        if not resting and cones is None:
            return None
        try:
            rest, ranks, packed = self._rest(place, before, resting, (guess, turned), fired, cones)
        except NoRest as error:
            names = listed(list(dict.fromkeys(frictions.names[i] for i in error.units)), NAMED)
            self.reason = f"No reactions are consistent with the friction at t = {self.t:.9g} s: {names}."
            return Status.CONTACT_FAILED
        for i, way in rest.ways.items():
            memory[frictions.units[i].way] = place.written(i, way)
        self._keep_ways({i: KEPT_WAY * SLIP * paces[i] for i in rest.turning})
        self.modes.sticking = {i: rest.partial.get(i, (ranks[i],))[0] for i in rest.sticking}
        self.modes.blocked = sorted([*self.off, *rest.blocked, *(i for i in resting if not ranks[i])])
        self.modes.begun, self.modes.limits = {i: (self.t, rate) for i, rate in rest.rates.items()}, rest.limits
        self.modes.sharing = {i: ranks[i] for i in rest.sharing}
        if cones is not None:
            self.friction = self._load(packed, rest.loads)
        return None

    def _keep_ways(self, turning):
        """Have frictions keep the directions of slips that begin, by units, up to these velocities."""
        self.modes.turning |= turning
        for i in turning:
            self.remembered[self.count :][self.frictions.units[i].way] *= KEPT_WAY

    def _slip_terms_of_frictions(self):
        """Terms of the slips of frictions, those of their accelerations before, and their `paces`, (units,) each."""
        sizes, rates = (self.frictions.sizes(self.q, each, self.length) for each in (self.qd, self.qdd))
        return sizes, rates, self.frictions.paces(sizes, rates, np.linalg.norm(self.scene.system.gravity), self.length)

    def _load(self, packed, N):
        """What frictions exert (n,) that slide, by their normal loads (frictions,)."""
        known = {id(unit.force) for unit in self.frictions.units}
        forces = [load.alone for load in packed.loads if id(load.force) in known]
        forces = np.concatenate([packed.system.forces[:0], *forces])
        system, motion = packed.system._replace(forces=forces), (self.q[None], self.qd[None])
        memory = np.concatenate([self.remembered[self.count :], N])[None]
        found = force_loads(system, np.array([self.t]), *motion, memory)
        memory[0, [slot for unit in self.frictions.units for slot in range(unit.way.start, unit.way.stop)]] = 0.0
        return (found - force_loads(system, np.array([self.t]), *motion, memory))[0]

    def _rest(self, place, before, resting, guesses, fired, cones):
        """The `FrictionAtRest`, how many rows hold each at rest, and the packed phase with open contacts."""
        units, memory, ranks = self.frictions.units, self.remembered[self.count :], {}
        finders = partial(self._motions_of, place), partial(self._mobility, place)
        for i in resting:
            ranks[i] = -1 if i in before.sharing else before.sticking.get(i, -1)
            if ranks[i] < 0:
                ranks[i] = self._write_rows(place, i, place.basis(i, *finders))
        free = [i for i in resting if ranks[i]]
        phase = self._scene_of([], self.every, self.every)  # rows of those that slide don't count: it is packed once
        rows = {i: phase.packed.derived.holds[units[i].slot][: ranks[i]] for i in free}
        fresh = [i for i in free if i not in before.sticking]
        self._hold_here(phase.packed, {i: rows[i] for i in free if i in fresh or i in before.sharing})
        bases = {i: place.directions(i, self._hold(i, ranks[i]).numbers) for i in free}
        problem = RestProblem(place, self.gaps, phase.packed, rows, bases, self.t, self.q, self.qd, memory, cones)
        guess, turned = ({i: way for i, way in each.items() if i in free} for each in guesses)
        rest = problem.pivot(guess, fired, turned)
        for i, (_, basis) in rest.partial.items():
            self._write_rows(place, i, basis)
        self._hold_here(phase.packed, {i: rows[i] for i in rest.partial})
        # In a plane slips end where they are slow; elsewhere where they are more than a start may leave
        ends = [i for i in rest.sticking if i in fresh and not self.frictions.signed[i]]
        if problem.slip([i for i in rest.sticking if i in fresh], self.qd) > 0.5 * self.options.initial_tol:
            ends = rest.sticking
        if self._is_unstruck():
            self.rest = max(self.rest, self.t + problem.stopping_time(ends, self.qd))
        self.qd = problem.stopped(ends, self.qd)
        return rest, ranks, phase.packed

    def _write_rows(self, place, i, basis):
        """Have rows that hold a friction in directions (r, 3) among what the run remembers; their number."""
        memory, unit = self.remembered[self.count :], self.frictions.units[i]
        for k, numbers in enumerate(place.numbers(i, basis)):
            memory[np.array(unit.held(k))] = numbers
        return len(basis)

    def _hold_here(self, packed, rows):
        """Have rows (r,) of frictions, by units, hold to the last bit where they are."""
        if not rows:
            return
        memory = self.remembered[self.count :]
        Phi = values_of(packed, self.t, self.q, memory)
        for i, own in rows.items():
            for k, row in enumerate(own):
                memory[self.frictions.units[i].held(k)[-1]] = Phi[row]

    def _mobility(self, place, i, basis):
        """Accelerations (r, r) of a friction along directions (r, 3) by unit forces where bilateral rows hold."""
        unit, packed = self.frictions.units[i], self._scene_of([], self.every, self.every).packed
        memory = self.remembered[self.count :].copy()
        for k, numbers in enumerate(place.numbers(i, basis)):
            memory[np.array(unit.held(k))] = numbers
        rows = gradients(packed, self.t, self.q, memory)[packed.derived.holds[unit.slot]]
        return product(rows, self.gaps.workspace.respond(self.t, self.q, memory, rows).T)

    def _motions_of(self, place, i):
        """Velocities (3, motions) of a friction, ground frame, of the motions that bilateral and closed rows leave."""
        unit = self.frictions.units[i]
        hold = Hold(unit, 3, place.numbers(i, np.eye(3)))
        phase = self._scene_of(
            [self.gaps.list[k].side.gap for k in self.modes.closed if k not in self.modes.dependent], [hold]
        )
        memory = self.remembered[self.count :].copy()
        for k in range(3):
            memory[np.array(unit.held(k))] = hold.numbers[k]
        return free_motions(phase.packed, self.t, self.q, memory, phase.packed.derived.holds[unit.slot])

    def _bounces(self, i, before, slots):
        """Whether gap i, the only one that touches, is hit without friction and opens: then that has happened.

        As `_hit` has it, of several gaps: here by one kernel, since balls bounce often.
        """
        gaps, e = self.gaps, float(self.gaps.restitution[i])
        if self.frictions.count or gaps.rough[i] or i in gaps.following or before.closed or before.idle or e == 0.0:
            return False
        given = i, float(gaps.sign[i]), e, FLIGHT * self.length
        found = gaps.workspace.bounce(self.t, self.q, self.qd, slots, *given)
        if found is None:
            return False
        impact, after = found
        if self._is_pushed(i, impact.rate / e, e):
            return False
        self.hits[i], self.qd = (self.t, impact.rate / e), after
        rounding = EPS * max(self.length, ROUNDED * impact.length)
        self.phases.impulses.append((self.t, gaps.names[i], Impulse(impact.p)))
        self.modes = UnitModes(opened={i: self._opened(i, impact.rate, 0.25 * rounding)})
        return True

    def _is_pushed(self, i, rate, e):
        """As `is_pushed`, of gap i."""
        low = ACCUMULATED * self.gaps.lengths(self.length)[i]
        return i in self.hits and twin(is_pushed)(*self.hits[i], self.t, low, rate, e)

    def _low_flights(self, touching):
        """Open gaps that have flown low since an impact."""
        low, able = ACCUMULATED * self.gaps.lengths(self.length), {*self.able}.difference(touching)
        flown = [i for i, (t, v) in self.hits.items() if i in able and v * (self.t - t) <= low[i]]
        return sorted(i for i in flown if self.gap[i] <= low[i])

    def _hit(self, inertia, touching, near, rates):
        """Jump of velocities at an impact; the rates (count,) afterwards.

        Contacts of a tower that are hit in turn end each other's flights ever sooner: impacts accumulate. A contact
        that is pushed back from a low flight is as good as closed: it has no restitution. So are those `near`, where
        the impact would push them together: they take part in it.
        """
        which, e, before = touching, self.gaps.restitution[touching].copy(), rates[touching]
        e[[k for k, i in enumerate(touching) if self._is_pushed(i, -before[k], e[k])]] = 0.0
        p, qd, after = self._jump(inertia, which, before, e)
        if near:
            rounding = NEGLIGIBLE * np.abs(inertia.G[np.ix_(near, which)]) @ p[:, 0]
            if (after[near] < np.minimum(rates[near], 0.0) - rounding).any():
                which, e, before = [*touching, *near], np.append(e, np.zeros(len(near))), rates[[*touching, *near]]
                p, qd, after = self._jump(inertia, which, before, e)
        # Impacts that are followed by flights that are none are the last ones
        a = self._lowering(inertia, touching, qd, after)
        last = [k for k, i in enumerate(touching) if a[i] > 0.0 and before[k] < 0.0 and e[k] > 0.0]
        if last:
            flights = [2.0 * after[touching[k]] / (a[touching[k]] * (1.0 - e[k])) for k in last if e[k] < 1.0]
            self.rest = float(max([self.rest, *(self.t + T for T in flights)]))
            e[last] = 0.0
            p, qd, after = self._jump(inertia, which, before, e)
            a = self._lowering(inertia, touching, qd, after)
        # Contacts that another impact lifts by rounding, of its impulses or of the time, stay closed
        rounding = NEGLIGIBLE * np.abs(inertia.G[:, which]) @ p[:, 0]
        after[after <= np.maximum(rounding, RESTS * EPS * abs(self.t) * a)] = 0.0
        still = NEGLIGIBLE * inertia.sizes(self._largest(self.qd)) * (rates == 0.0)  # lifted by impulses of rounding
        after[after <= still] = 0.0
        self._note_impulses(inertia, which, p, self.qd)
        self.hits |= {i: (self.t, -rate) for i, rate in zip(which, before.tolist(), strict=True) if rate < 0.0}
        self.hits = {i: (t, max(v, float(after[i]))) for i, (t, v) in self.hits.items()}
        self.qd = qd
        return after

    def _note_impulses(self, inertia, which, p, qd):
        """Note the impulses (k, 3) of the gaps `which`, but those that change rates at qd by less than rounding.

        Rounding of the rates is a share of their terms, of those of all impulses, and of what the time leaves open.
        """
        small = NEGLIGIBLE * (inertia.sizes(qd) + np.abs(inertia.G[:, which]) @ np.abs(p[:, 0]))
        small += RESTS * EPS * abs(self.t) * inertia.sizes(self.qdd)
        self.phases.impulses += [
            (self.t, self.gaps.names[i], impulse_of(inertia, i, own))
            for i, own in zip(which, p, strict=True)
            if abs(own[0]) * inertia.G[i, i] > small[i]
        ]

    def _jump(self, inertia, touching, before, e, qd=None):
        """Impulses (k, 3) of an impact, velocities (n,) and rates (count,) after it."""
        qd, law = self.qd if qd is None else qd, self.options.law
        p, change, share = impact_of(inertia, touching, qd, before, e, law)
        if share < 1.0:
            self.lowered.add(self.t)
        return p, *jumped(inertia, qd, change, touching, before, share * e, p, law)

    def _lowering(self, inertia, touching, qd, rates):
        """Decelerations (count,) of the gaps that open to flights that are none and close again; zero of others."""
        opening = np.zeros(self.gaps.count, bool)
        opening[touching] = rates[touching] > 0.0
        if not opening.any():
            return np.zeros(self.gaps.count)
        resting = [i for i in touching if rates[i] == 0.0]
        a = -contact_state(inertia, resting, qd).accelerations
        height = FLIGHT * self.gaps.lengths(self.length)
        return np.where(opening & (a > 0.0) & (rates * rates < 2.0 * a * height), a, 0.0)
