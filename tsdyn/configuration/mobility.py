"""`scene.mobility`: degrees of freedom, rank, redundant rows by name, singular configurations; conflicts."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..calls import fitting
from ..constraints.distance import Distance
from ..constraints.dot1 import Dot1
from ..constraints.dot2 import Dot2
from ..constraints.euler_normalization import EulerNormalization
from ..constraints.spherical import Spherical
from ..drawing import html_table
from ..elements.bodies import rotation_matrix
from ..errors import InconsistentState, InvalidArgument, RedundantConstraints
from ..jit.interrupts import CollectionsDeferred
from ..maths.dense_linalg import farthest_first, rank_of, singular_values, unit_rows
from ..maths.tolerances import RANK_TOL
from ..model.handles import has_rates, of_rates
from ..motions.prescribed import Motion
from ..rows.constraint_graph import coordinate_scales
from ..validation import counted, finite_vector, number
from .continuation import Metric, close, unit_tangent
from .motor_starts import demand_finite, demand_small, refuse_vanished
from .tolerances import DEPENDENCE, FIRM, INITIAL_TOL, MOST_NODES, NEIGHBOURHOOD, PROVED, SHOWN_CONSTRAINTS

if TYPE_CHECKING:
    from ..hints import ArrayLike, Attachment, Scene


# Linear dependence of constraint rows, joint by joint in the order in which the joints were added.


def divide(A, groups):
    """Return kept and redundant rows of A (rows, x), by groups: redundant rows depend on rows before them.

    groups is a list of index arrays. Within a group, pivoted QR chooses the rows to keep.
    """
    from scipy.linalg import qr  # imported here: it would double the time of `import tsdyn`

    unit, rank = unit_rows(A), rank_of(A)
    basis, kept, redundant = np.zeros((0, A.shape[1])), [], []
    for rows in groups:
        left = unit[rows]
        for _ in range(2):
            left = left - (left @ basis.T) @ basis
        Q, R, order = qr(left.T, mode="economic", pivoting=True)
        size = np.abs(np.diagonal(R))
        count = int((size > RANK_TOL * np.sqrt(max(len(unit), 1))).sum())
        basis = np.vstack((basis, Q.T[:count]))
        kept += sorted(rows[order[:count]].tolist())
        redundant += sorted(rows[order[count:]].tolist())
    if len(kept) != rank:  # the rank is ambiguous: choose among all rows at once
        order, _ = farthest_first(unit)
        kept, redundant = sorted(order[:rank].tolist()), sorted(order[rank:].tolist())
    return kept, redundant


def partners(A, kept, redundant):
    """Return, for each redundant row, the kept rows of which it is a combination."""
    unit = unit_rows(A)
    if not (kept and redundant):
        return [[] for _ in redundant]
    weights = np.linalg.lstsq(unit[kept].T, unit[redundant].T, rcond=None)[0]
    return [[row for row, weight in zip(kept, column, strict=True) if abs(weight) > DEPENDENCE] for column in weights.T]


def put_aside(A, owners):
    """Remove rows of a sparse A that are certainly independent; return the remaining rows.

    owners (x,) is the body of each column. If the rows of a body are independent in its columns alone, they are
    independent of all other rows, and the body is removed with them, as the links of an open chain are from its end.
    """
    from scipy.sparse import csr_array

    A = csr_array(A)
    of_row = [np.unique(owners[A.indices[A.indptr[i] : A.indptr[i + 1]]]) for i in range(A.shape[0])]
    rows_of = [set() for _ in range(int(owners.max(initial=-1)) + 1)]
    for row, bodies in enumerate(of_row):
        for body in bodies:
            rows_of[body].add(row)
    columns = [np.flatnonzero(owners == body) for body in range(len(rows_of))] if len(rows_of) < 2 else _columns(owners)
    left, queue = set(range(A.shape[0])), list(range(len(rows_of)))
    while queue:
        body = queue.pop()
        rows = sorted(rows_of[body])
        if not 0 < len(rows) <= len(columns[body]):
            continue
        block = unit_rows(A[rows].toarray())[:, columns[body]]
        size = singular_values(block)
        if size[-1] <= FIRM * size[0]:
            continue
        near = {int(other) for row in rows for other in of_row[row]} - {body}
        for row in rows:
            for other in of_row[row]:
                rows_of[other].discard(row)
        left -= set(rows)
        queue += sorted(near)
    return np.array(sorted(left), int)


def _columns(owners):
    order = np.argsort(owners, kind="stable")
    cuts = np.searchsorted(owners[order], np.arange(1, owners.max() + 1))
    return np.split(order, cuts)


# Redundant rows of Phi_q: detection, and their names.


def check_rank(scene, Phi_q):
    """Refuse dependent rows of Phi_q, by name."""
    Phi_q = Phi_q * coordinate_scales(scene.packed)
    m = Phi_q.shape[0]
    if m == 0:
        return
    lengths = np.linalg.norm(Phi_q, axis=1)
    if not lengths.all():
        refuse_vanished(scene.row_names()[int(np.argmin(lengths))])
    rank = rank_of(Phi_q)
    if rank == m:
        return
    names, order = scene.row_names(), _pivots(scene, unit_rows(Phi_q))
    kept, dropped = order[:rank].tolist(), sorted(order[rank:].tolist())
    stories = [
        f"  {names[row]} depends on " + (", ".join(names[i] for i in sorted(others)[:8]) or "nothing else")
        for row, others in zip(dropped, partners(Phi_q, kept, dropped), strict=True)
    ]
    raise RedundantConstraints(
        f"{m - rank} of the {m} constraint rows are redundant, Phi_q has rank {rank}:\n"
        + "\n".join(stories)
        + "\nRemove the redundant rows, or use a joint with fewer rows. If the rows are independent elsewhere, this is "
        "a singular configuration: start from another one."
    )


def weakest_row(scene, Phi_q, redundant=0):
    """Return the name of the row of Phi_q nearest to dependence, and the smallest singular value over the largest.

    `redundant` rows, those nearest to dependence, are skipped.
    """
    if not (Phi_q.size and np.isfinite(Phi_q).all()):
        return "", 1.0
    scaled = unit_rows(Phi_q * coordinate_scales(scene.packed))
    size = singular_values(scaled)
    last = len(scaled) - 1 - redundant  # there are fewer values where rows are more than coordinates
    return scene.row_names()[_pivots(scene, scaled)[last]], size[last] / size[0]


def _pivots(scene, rows):
    """Return the rows ordered by pivoted QR, normalisations first.

    Normalisations belong to the bodies, so dependence on them is attributed to the user's constraints.
    """
    own = np.array([type(c) is EulerNormalization for c in scene.constraints for _ in range(c.all_rows)])
    rest, first = np.flatnonzero(~own), np.flatnonzero(own)
    basis = unit_rows(rows[first])  # of different bodies
    left = rows[rest] - (rows[rest] @ basis.T) @ basis
    return np.concatenate((first, rest[farthest_first(left)[0]])).astype(int)


TRIES = 3
MOST_ROWS = 3000  # of closed loops, which take a dense factorisation


class RedundantRow(NamedTuple):
    """A row of Phi_q that depends on others."""

    name: str
    depends_on: tuple[str, ...]  # names of rows
    constraint: Attachment  # whose row it is


@dataclass(frozen=True, repr=False)
class Mobility:
    """How a scene can move at one configuration.

    Attributes
    ----------
    degrees_of_freedom : int
        Coordinates less rank: of the velocities that the constraints leave, here.
    position_degrees_of_freedom : int
        The same without rows on velocities (rolling, knife edges): of the positions that can be reached.
    generic_degrees_of_freedom : int
        The same at configurations near this one; it is smaller where this one is singular.
    coordinates, rows, rank : int
        Of Phi_q, normalisations included: n, m and the rank.
    redundant : tuple of RedundantRow
        Rows that depend on others here and nearby: what constrains too much. Never a normalisation.
    dependent_here : tuple of RedundantRow
        Rows that depend on others in this configuration only.
    singular : bool
        Whether the rank is lower here than nearby.
    """

    degrees_of_freedom: int
    position_degrees_of_freedom: int
    generic_degrees_of_freedom: int
    coordinates: int
    rows: int
    rank: int
    redundant: tuple[RedundantRow, ...]
    dependent_here: tuple[RedundantRow, ...]
    singular: bool

    def _facts(self):
        freedom = f"{self.degrees_of_freedom}"
        if self.singular:
            freedom += f" here, {self.generic_degrees_of_freedom} nearby: this configuration is singular"
        if self.position_degrees_of_freedom != self.degrees_of_freedom:
            freedom += f" of velocities, {self.position_degrees_of_freedom} of positions"
        facts = {
            "degrees of freedom": freedom,
            "coordinates": f"{self.coordinates}",
            "rows": f"{self.rows}, of rank {self.rank}",
        }
        for title, found in (("redundant rows", self.redundant), ("dependent just here", self.dependent_here)):
            if found or title.startswith("redundant"):
                facts[title] = f"{len(found) or 'none'}"
        return facts

    def _stories(self):
        """(rows of a constraint, what they depend on), joint by joint."""
        for found, ending in ((self.redundant, ""), (self.dependent_here, " (just here)")):
            groups = {}
            for row in found:
                groups.setdefault(id(row.constraint), []).append(row)
            for rows in groups.values():
                whole = len(rows) == rows[0].constraint.all_rows
                title = rows[0].constraint.title
                said = f"all of {title}" if whole and len(rows) > 1 else ", ".join(row.name for row in rows)
                on = dict.fromkeys(name for row in rows for name in row.depends_on)
                heads = list(dict.fromkeys(map(_head, on)))
                yield said + ending, sorted(on, key=lambda name: heads.index(_head(name)))

    def __repr__(self) -> str:
        more = ", singular here" if self.singular else ""
        n, r = self.degrees_of_freedom, len(self.redundant)
        return (
            f"<Mobility: {counted(n, 'degree')} of freedom, rank {self.rank} of {self.rows} rows, "
            f"{r or 'no'} redundant row{'' if r == 1 else 's'}{more}>"
        )

    def __str__(self) -> str:
        facts = self._facts()
        width = max(map(len, facts))
        lines = [f"  {name:{width}}  {fact}" for name, fact in facts.items()]
        lines += [f"  {said} depend{'s' if _single(said) else ''} on {_listed(on)}" for said, on in self._stories()]
        return "\n".join(["Mobility", *lines])

    def _repr_html_(self):
        """The same in a notebook."""
        facts = self._facts() | {said: f"on {_listed(on)}" for said, on in self._stories()}
        return html_table(facts.items(), "Mobility", named=True)


@fitting
@CollectionsDeferred()
def mobility(scene: Scene, q: ArrayLike | None = None, t: float = 0.0) -> Mobility:
    """Count degrees of freedom, and name the rows that are redundant.

    Parameters
    ----------
    q : array_like (n,), optional
        Positions, which must meet the constraints to 1e-9; default the start values of the bodies.
    t : float, s
        The time at which constraints that depend on time are evaluated.

    Returns
    -------
    Mobility
        Print it for a table: `.degrees_of_freedom`, `.redundant`, `.singular` and more.

    Raises
    ------
    InvalidArgument
        If q is not n finite numbers, t is not finite, or closed loops have more than 3000 rows.
    InconsistentState
        If q breaks a constraint, for dependent rows look independent there; it names the rows.

    Notes
    -----
    The rank is that of Phi_q with rows of unit length, rotations times the longest arm of the body's joints: singular
    values above 1e-7 of the largest. Masses don't matter. A row is called redundant if it depends on those of its
    joint and of joints added before it, so they gather in few joints. Whether a configuration is singular is decided by
    consistent ones beside it. Above 1000 coordinates, what hangs in open chains is put aside first and costs O(N);
    closed loops cost the cube of their rows.

    Examples
    --------
    A door needs one hinge; a second one on the same axis adds five redundant rows:

    >>> import tsdyn as ts
    >>> door = (scene := ts.Scene()).add_body(mass=20.0, inertia=(4, 5, 1))
    >>> for height in (-1, 1):
    ...     hinge = ts.constraints.Revolute.at(scene.ground, door, point=(0.5, 0, height), axis=(0, 0, 1))
    ...     print(scene.add(hinge))
    <Revolute(ground, body1): 5 rows>
    <Revolute(ground, body1) #2: 5 rows>
    >>> report = scene.mobility()
    >>> report.degrees_of_freedom, len(report.redundant)
    (1, 5)
    """
    start = scene.start[0]
    q = finite_vector(start if q is None else q, start.size, "q").copy()
    if not np.isfinite(number(t)):
        raise InvalidArgument(f"t must be a finite time in s, got {t!r}.")
    return mobility_at(scene, q, float(t))


def mobility_at(scene, q, t, system=None):
    """As `mobility`, of arguments that are checked; system: in place of the scene's, with what a run remembers."""
    packed = scene.packed if system is None else scene.packed._replace(system=system)
    metric = Metric(packed, None, t, lengths=True, rates=True)
    Phi, Phi_q, Phi_t = metric.arrays(q)
    demand_finite(scene, Phi, Phi_q, Phi_t)
    demand_small(scene, Phi, INITIAL_TOL * (1.0 + np.abs(q).max()), "position", "Phi", (float(t), q))
    rows, A = _core(metric, q, None)
    here = rank_of(A)
    beside, generic = A, here
    if here < min(A.shape):
        for other in _neighbours(metric, q, A):
            found = _core(metric, other, rows)[1]
            rank = rank_of(found)
            if rank > generic:
                beside, generic = found, rank
    groups = _groups(packed, metric, rows)
    _, redundant = divide(beside, groups)
    rest = [np.array([row for row in group if row not in set(redundant)], int) for group in groups]
    kept, dependent = divide(A, [group for group in rest if group.size]) if generic > here else (None, [])
    always = sorted(set(range(len(rows))) - set(redundant))
    names, owners = (
        scene.row_names(),
        [member.constraint for member in packed.members for _ in range(member.constraint.all_rows)],
    )

    def described(found, among, matrix):
        for row, others in zip(found, partners(matrix, among, found), strict=True):
            place = metric.own[rows[row]]
            yield RedundantRow(names[place], tuple(names[metric.own[rows[i]]] for i in others), owners[place])

    n, aside = q.size, len(packed.system.segments) - len(rows)
    free = n - aside - here
    return Mobility(
        degrees_of_freedom=free,
        position_degrees_of_freedom=_of_positions(packed, q, t, free),
        generic_degrees_of_freedom=n - aside - generic,
        coordinates=n,
        rows=len(packed.system.segments),
        rank=aside + here,
        redundant=tuple(described(redundant, always, beside)),
        dependent_here=tuple(described(dependent, kept, A)) if dependent else (),
        singular=generic > here,
    )


def _of_positions(packed, q, t, free):
    """Degrees of freedom of positions; `free` are those of velocities."""
    if not has_rates(packed):
        return free
    metric = Metric(packed, None, t, lengths=True)
    rows, A = _core(metric, q, None)
    normals = sum(constraint.normalises for constraint in packed.constraints)
    return q.size - normals - (len(metric.own) - len(rows)) - rank_of(A)


def _core(metric, q, rows):
    """Return the indices (normalisations not counted) of rows that may be dependent, and the rows, dense."""
    _, A = metric.linear(q)
    if not metric.sparse:
        return (np.arange(A.shape[0]), A) if rows is None else (rows, A[rows])
    if rows is None:
        owners = np.repeat(np.arange(len(metric.at)), np.where(metric.rigid, 6, 3))
        rows = put_aside(A, owners)
        if len(rows) > MOST_ROWS:
            raise InvalidArgument(
                f"mobility: the closed loops of this scene have {len(rows)} constraint rows; the limit is "
                f"{MOST_ROWS}. Analyse a smaller scene of the same kind."
            )
    left = A[rows]
    used = np.unique(left.indices) if len(rows) else np.zeros(0, int)
    return rows, left[:, used].toarray()


def _neighbours(metric, q, A):
    """Yield consistent configurations near q, along random tangent directions."""
    rng = np.random.default_rng(0)
    for _ in range(TRIES):
        step = unit_tangent(metric, q, rng)
        if step is None:
            return
        other, Phi, _ = close(metric, metric.moved(q, NEIGHBOURHOOD * step))
        if np.abs(Phi).max(initial=0.0) <= INITIAL_TOL * (1.0 + np.abs(q).max()):
            yield other


def _groups(packed, metric, rows):
    """Return the indices of `rows`, one array for each constraint; those on velocities come last."""
    count = len(packed.members)
    owner = np.repeat(np.arange(count), [member.constraint.all_rows for member in packed.members])
    owner += count * of_rates(packed)
    whose = owner[metric.own[rows]] if len(rows) else np.zeros(0, int)
    return [np.flatnonzero(whose == member) for member in np.unique(whose)]


def _listed(names):
    """Return the names of rows, grouped by constraint."""
    if not names:
        return "nothing else: it vanishes"
    heads = Counter(map(_head, names))
    if len(names) > 8:
        return ", ".join(f"{head} ({count})" if count > 1 else head for head, count in heads.items())
    return ", ".join(names)


def _head(name):
    """A row's name without its label."""
    head, _, label = name.rpartition(" ")
    return name.partition("[")[0] if "'" in label or not head else head


def _single(said):
    return "," not in said and not said.startswith("all of")


# Constraints that can't be met together: the fewest of which inequalities prove it, or those that were left open.
#
# Distances of points, and angles of directions, obey the triangle inequality. On a body they are known; constraints
# give bounds of them:
#
#     Spherical, Distance    d(x_a, x_b) = 0, L       Dot2    d(x_a, x_b) >= |c|
#     Dot1                   angle(a, b) = arccos c    directions that a joint aligns    angle = 0
#
# Two points that are further apart than a way over other bounds is long are a conflict; of the ways with a violation
# that over the fewest constraints is found first.


class Bounds:
    """Nodes (points, or directions) on bodies, and bounds of their distances from each other."""

    def __init__(self, distance, most=np.inf):
        self.distance, self.most, self.edges = distance, most, []
        self.nodes = {}  # number by (body, *coordinates in its frame)

    def node(self, owner, place):
        """The number of a node."""
        return self.nodes.setdefault((owner, *np.asarray(place, float).tolist()), len(self.nodes))

    def add(self, member, one, other, lower, upper):
        """Bounds of the distance of two nodes by a member."""
        self.edges.append((member, one, other, lower, upper))

    def violation(self):
        """(members, lower, upper) of a contradiction of the fewest constraints; None where there is none."""
        if not 0 < len(self.nodes) <= MOST_NODES:
            return None
        table = np.array(list(self.nodes))
        owners, places = table[:, 0], table[:, 1:]
        inner = np.full(2 * owners.shape, np.inf)
        groups = [np.flatnonzero(owners == owner) for owner in np.unique(owners)]
        for group in groups:
            inner[np.ix_(group, group)] = self.distance(places[group][:, None], places[group][None])
        known = np.where(inner < self.most, inner, 0.0)  # at least; opposite directions are those of other edges, too
        allowed = PROVED * max(1.0, float(known.max()))
        ways = [inner]  # of up to so many constraints
        while True:
            for i, j in np.argwhere(known > ways[-1] + allowed)[:1]:
                return self._found(self._way(ways, inner, i, j), known[i, j], ways[-1][i, j])
            for k, (_, i, j, lower, _) in enumerate(self.edges if len(ways) > 1 else ()):
                if lower > ways[-2][i, j] + allowed:
                    return self._found({k} | self._way(ways[:-1], inner, i, j), lower, ways[-2][i, j])
            if len(ways) > 1 and not (ways[-1] < ways[-2]).any():
                return None
            ways.append(self._longer(ways[-1], inner, groups))

    def _found(self, used, lower, upper):
        return list({id(self.edges[k][0]): self.edges[k][0] for k in sorted(used)}.values()), float(lower), float(upper)

    def _longer(self, way, inner, groups):
        """The shortest ways over one constraint more."""
        found = way.copy()
        for _, i, j, _, upper in self.edges:
            if np.isfinite(upper):
                found[:, j] = np.minimum(found[:, j], way[:, i] + upper)
                found[:, i] = np.minimum(found[:, i], way[:, j] + upper)
        reached = found.copy()
        for group in groups:
            for node in group:
                found[:, group] = np.minimum(found[:, group], reached[:, node, None] + inner[node, group])
        return found

    def _way(self, ways, inner, i, j):
        """The numbers of the edges on the shortest way from i to j."""
        used = set()
        for before, now in zip(ways[-2::-1], ways[:0:-1], strict=True):
            if now[i, j] < before[i, j]:
                _, k, j = min(
                    (before[i, a] + upper + inner[b, j], k, a)
                    for k, (_, one, other, _, upper) in enumerate(self.edges)
                    for a, b in ((one, other), (other, one))
                )
                used.add(k)
        return used


def proved(metric, q):
    """(members, sentence) of a conflict that no configuration can avoid; None where none is proved."""
    packed, held = metric.packed, metric.held
    index, starts = {id(body): i for i, body in enumerate(packed.bodies)}, metric.at
    points, directions = Bounds(_distance), Bounds(_angle, np.pi - PROVED)

    def node(bounds, body, place, turns):
        """On a body; of one that is held, and of the ground, in the ground frame."""
        i, place = index.get(id(body), -1), np.asarray(place, float)
        if i < 0 or not held[i]:
            return bounds.node(i, place)
        A = rotation_matrix(q[starts[i] + 3 : starts[i] + 7]) if metric.rigid[i] else np.eye(3)
        return bounds.node(-1, A @ place if turns else q[metric.r[i]] + A @ place)

    def angle(member, one, other, value):
        """Directions, and their opposites."""
        pairs = [[node(directions, body, sign * np.asarray(u), True) for sign in (1, -1)] for body, u in (one, other)]
        (a, back_a), (b, back_b) = pairs
        for i, j, size in (
            (a, b, value),
            (back_a, back_b, value),
            (a, back_b, np.pi - value),
            (back_a, b, np.pi - value),
        ):
            directions.add(member, i, j, size, size)

    for member in packed.members:
        for k in range(member.parts.start, member.parts.stop):
            part, places = packed.constraints[k], packed.coordinates[k]
            markers = {
                marker.argument: (part.body_of(marker), s) for marker, s in zip(part.markers, places, strict=True)
            }
            value = [x.value(metric.t)[0] if isinstance(x, Motion) else float(x) for x in packed.parameters[k][:1]]
            if isinstance(part, (Spherical, Distance, Dot2)):
                a, b = (node(points, *markers[name], False) for name in ("point_a", "point_b"))
                size = abs(value[0]) if value else 0.0
                points.add(member, a, b, size, np.inf if isinstance(part, Dot2) else size)
            elif isinstance(part, Dot1):
                angle(member, markers["axis_a"], markers["axis_b"], float(np.arccos(np.clip(value[0], -1.0, 1.0))))
        for pair in getattr(member.constraint, "opposed", ()):
            sides = [(body, u(metric.t) if callable(u) else u) for body, u in pair]
            angle(member, *sides, 0.0)
    for bounds, what in (
        (points, "points at least {:.9g} m and at most {:.9g} m apart"),
        (directions, "directions at least {:.9g} rad and at most {:.9g} rad apart"),
    ):
        found = bounds.violation()
        if found:
            return found[0], f"two {what.format(*found[1:])} are required"
    return _held(metric, q, held, index)


def _held(metric, q, held, index):
    """A constraint between bodies that are held, which isn't met."""
    Phi = np.abs(metric.arrays(q)[0])
    for member in metric.packed.members:
        bodies = {part.body_of(marker) for part in member.constraint.parts for marker in part.markers}
        fixed = all(index.get(id(body), -1) < 0 or held[index[id(body)]] for body in bodies)
        if fixed and bodies and Phi[member.rows].max() > PROVED * (1.0 + np.abs(q).max()):
            return [member], "its bodies are held where it isn't met"
    return None


def _distance(x, y):
    return np.linalg.norm(x - y, axis=-1)


def _angle(u, v):
    return np.arctan2(np.linalg.norm(np.cross(u, v), axis=-1), (u * v).sum(axis=-1))


def refuse(scene, metric, found, conflict, starts, held=()):
    """Raise InconsistentState that names the constraints in conflict, or those left open, also as `.constraints`."""
    members = [member for member in metric.packed.members if not getattr(member.constraint, "normalises", False)]
    left = np.zeros(len(metric.packed.system.segments))
    left[metric.own] = np.abs(found.Phi)
    sizes = np.array([left[member.rows].max() for member in members])
    where = f" with {', '.join(body.name for body in held)} held fixed" if len(held) else ""
    chosen = [member for member, size in zip(members, sizes, strict=True) if size > DEPENDENCE * sizes.max()]
    if conflict:
        chosen, reason = conflict
        alone = "This constraint is infeasible on its own" if len(chosen) == 1 else f"These {len(chosen)} conflict"
        story = f"no configuration satisfies all constraints{where}. {alone}: {reason}"
        remedy = "Change a length, point or axis of one of them, or remove one"
    else:
        tried = (
            f"{starts} starts{where}, the sketch and displacements of its joints"
            if starts > 1
            else f"the sketch{where}"
        )
        story = f"not assembled from {tried}. No conflict is proved; the smallest residuals found are"
        remedy = "Improve the sketch of the bodies, or give values of joints from which to start, joints={name: value}"
    names, lines = scene.row_names(), []
    for member in sorted(chosen, key=lambda member: -left[member.rows].max())[:SHOWN_CONSTRAINTS]:
        row = member.rows.start + int(np.argmax(left[member.rows]))
        lines.append(f"  {member.constraint.title}: |Phi| = {left[row]:.3g} in {names[row]}")
    if len(chosen) > SHOWN_CONSTRAINTS:
        lines.append(f"  ... and {len(chosen) - SHOWN_CONSTRAINTS} more")
    error = InconsistentState(
        f"{story}:\n" + "\n".join(lines) + f"\n{remedy}" + ("; or hold fewer bodies." if len(held) else ".")
    )
    error.constraints = tuple(member.constraint for member in chosen)
    raise error
