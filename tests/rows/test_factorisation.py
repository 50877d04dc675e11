"""The sparse factorisation against numpy on random graphs; fill, counts and types of its symbolic part."""

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.helpers.tolerances import CLOSE, EPS
from tsdyn.rows.factorisation import factor, factor_and_solve, factor_lu, solve, solve_lu
from tsdyn.rows.symbolic import Pattern, analyse

ROOT = Path(__file__).parents[2]


def chain(n):
    """Joints of n bodies in a row, the first on ground."""
    return n, [[i, i + 1] for i in range(n - 1)]


def ring(n):
    return n, [[i, (i + 1) % n] for i in range(n)]


def tree(parents):
    """Joint i holds body i on body parents[i] - 1 < i, or on ground."""
    bodies = [[i] for i in range(len(parents))]
    for i, parent in enumerate(parents):
        if parent:
            bodies[parent - 1].append(i)
    return len(parents), bodies


def grid(rows, columns):
    """Bodies on a grid, joined to their neighbours."""
    bodies, joints = [[[] for _ in range(columns)] for _ in range(rows)], 0
    for r in range(rows):
        for c in range(columns):
            for other in [(r + 1, c), (r, c + 1)]:
                if other[0] < rows and other[1] < columns:
                    bodies[r][c].append(joints)
                    bodies[other[0]][other[1]].append(joints)
                    joints += 1
    return joints, [body for line in bodies for body in line]


def side_by_side(one, other):
    return one[0] + other[0], [*one[1], *([one[0] + i for i in clique] for clique in other[1])]


def crossed(n, pairs):
    """A chain and more coupled pairs: any graph."""
    return n, [*chain(n)[1], *([a % n, b % n] for a, b in pairs)]


simple = st.one_of(
    st.integers(0, 30).map(chain),
    st.integers(1, 24).map(ring),
    st.tuples(st.integers(1, 5), st.integers(1, 5)).map(lambda n: grid(*n)),
    st.integers(1, 25).flatmap(lambda n: st.tuples(*(st.integers(0, i) for i in range(n)))).map(tree),
    st.integers(1, 12).map(lambda n: (n, [range(n)])),
    st.builds(crossed, st.integers(1, 20), st.lists(st.tuples(st.integers(0, 19), st.integers(0, 19)), max_size=12)),
)
graphs = st.one_of(simple, st.builds(side_by_side, simple, simple))


def matrices(sizes, cliques, rng, skew=0.0):
    """A matrix that is a sum over cliques, as bodies give it, and which of its node blocks are not zero."""
    starts = np.concatenate([[0], np.cumsum(sizes)]).astype(int)
    A = np.diag(rng.uniform(0.1, 1.0, starts[-1]))
    pairs = {(i, i) for i in range(len(sizes))}
    for clique in cliques:
        at = np.concatenate([np.arange(starts[i], starts[i + 1]) for i in clique]) if len(clique) else np.zeros(0, int)
        J = rng.normal(size=(len(at), 6))
        other = J + skew * rng.normal(size=J.shape)
        A[np.ix_(at, at)] += J @ other.T
        pairs |= {(i, j) for i in clique for j in clique}
    return A, starts, pairs


def fill(A, starts, pairs, where, pattern):
    """Value arrays of a matrix; what elimination must not read holds nan."""
    lower, upper = np.full((2, pattern.shape[2]), math.nan)
    lower[: pattern.shape[1]] = upper[: pattern.shape[1]] = 0.0
    for i, j in pairs:
        offset, stride, transposed = where(i, j)
        block = A[starts[i] : starts[i + 1], starts[j] : starts[j + 1]]
        for r in range(block.shape[0]):
            for c in range(block.shape[1]):
                if transposed:
                    lower[offset + c * stride + r] += block[r, c]
                else:
                    upper[offset + r * stride + c] += block[r, c]
                if i == j:
                    lower[offset + c * stride + r] += block[r, c]
    return lower, upper


def permutation(sizes, rows):
    """Where each original row stands in the eliminated vector."""
    return np.concatenate([np.arange(first, first + size) for first, size in zip(rows, sizes, strict=True)] or [[]])


def bound(A, x):
    """Backward error of elimination without pivoting: growth is 1 for a definite matrix."""
    n = len(A)
    return 20 * (n + 1) * EPS * np.linalg.norm(A) * np.linalg.norm(x) if n else 0.0


def with_sizes(graph):
    n = graph[0]
    return st.tuples(st.just(graph), st.lists(st.integers(0, 6), min_size=n, max_size=n))


def draw_sizes():
    same = st.tuples(graphs, st.sampled_from([1, 2, 3, 5, 6])).map(lambda g: (g[0], [g[1]] * g[0][0]))
    return st.one_of(same, graphs.flatmap(with_sizes))


@pytest.mark.slow
@given(draw_sizes(), st.integers(0, 1000))
def test_symmetric(problem, seed):
    (_, cliques), sizes = problem
    rng = np.random.default_rng(seed)
    A, starts, pairs = matrices(sizes, cliques, rng)
    rows, pattern, where = analyse(sizes, cliques)
    to = permutation(sizes, rows).astype(int)
    assert sorted(to) == list(range(len(A)))
    _, values = fill(A, starts, {p for p in pairs if not where(*p)[2]}, where, pattern)
    again = values.copy()
    assert factor(pattern, values, 1e-14) == -1
    b = rng.normal(size=len(A))
    x, y = np.empty_like(b), np.empty_like(b)
    x[to] = y[to] = b
    solve(pattern, values, x)
    assert np.linalg.norm(A @ x[to] - b) <= bound(A, x)
    assert factor_and_solve(pattern, again, y, 1e-14) == -1
    assert (again.tobytes(), y.tobytes()) == (values.tobytes(), x.tobytes())
    # The same row fails
    for i in range(min(len(A), 4)):
        A[i, i] = 0.0
        _, values = fill(A, starts, {p for p in pairs if not where(*p)[2]}, where, pattern)
        assert factor_and_solve(pattern, values.copy(), y, 1e-14) == factor(pattern, values, 1e-14) >= 0


@pytest.mark.slow
@given(draw_sizes(), st.integers(0, 1000))
def test_not_symmetric(problem, seed):
    (_, cliques), sizes = problem
    rng = np.random.default_rng(seed)
    A, starts, pairs = matrices(sizes, cliques, rng, 0.02)
    rows, pattern, where = analyse(sizes, cliques)
    to = permutation(sizes, rows).astype(int)
    lower, upper = fill(A, starts, pairs, where, pattern)
    assert factor_lu(pattern, lower, upper, 1e-14) == -1
    b = rng.normal(size=len(A))
    x, z = np.empty_like(b), np.empty_like(b)
    x[to] = z[to] = b
    solve_lu(pattern, lower, upper, x)
    solve_lu(pattern, upper, lower, z)  # of the transposed matrix
    assert np.linalg.norm(A @ x[to] - b) <= 10 * bound(A, x)
    assert np.linalg.norm(A.T @ z[to] - b) <= 10 * bound(A, z)


def reached(pattern):
    """Rows that each block's elimination reaches."""
    return pattern.widths - np.diff(pattern.starts)


@given(st.integers(1, 40).flatmap(lambda n: st.tuples(*(st.integers(0, i) for i in range(n)))))
def test_trees_fill_in_nothing_beyond_their_cliques(parents):
    n, cliques = tree(parents)
    sizes = [13] * n  # too big for blocks of more than one node
    pattern = analyse(sizes, cliques)[1]
    coupled = {(min(i, j), max(i, j)) for clique in cliques for i in clique for j in clique if i != j}
    assert reached(pattern).sum() == 13 * len(coupled)


@pytest.mark.parametrize("size", [1, 2, 3, 5, 6])
def test_chains_cost_the_same_for_each_body(size):
    one, other = (analyse([size] * n, chain(n)[1])[1] for n in (500, 1000))
    for name in ("shape", "starts", "heads", "widths", "segments", "updates", "records"):
        long, short = (getattr(p, name) for p in (other, one))
        grown = long[1] / short[1] if name == "shape" else len(long) / max(len(short), 1)
        assert grown == pytest.approx(2.0, abs=0.05)
    if size >= 3:
        assert len(one.heads) >= 490


@pytest.mark.slow
def test_nothing_but_loops_of_many_nodes_needs_scipy():
    code = """
import sys, tsdyn.rows.symbolic
tsdyn.rows.symbolic.analyse([3] * 1000, [[i, i + 1] for i in range(999)])
tsdyn.rows.symbolic.analyse([3] * 100, [[i, (i + 1) % 100] for i in range(100)])
print("scipy.sparse" in sys.modules)
tsdyn.rows.symbolic.analyse([3] * 1000, [[i, (i + 1) % 1000] for i in range(1000)])
print("scipy.sparse" in sys.modules)
"""
    result = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert result.stdout.split() == ["False", "True"]


def test_nodes_that_are_not_coupled_have_no_place():
    _, _, where = analyse([7] * 9, chain(9)[1])
    with pytest.raises(KeyError, match="not coupled"):
        where(0, 5)


def test_a_small_component_is_one_block():
    sizes, cliques = [3, 1, 2], [[0, 1], [1, 2]]
    pattern = analyse(sizes * 2, [*cliques, *([3 + i for i in clique] for clique in cliques)])[1]
    assert list(np.diff(pattern.starts)) == [6, 6]
    assert len(pattern.segments) == 0


def test_components_never_touch():
    n, cliques = side_by_side(chain(20), grid(4, 4))
    rows, pattern, _ = analyse([3] * n, cliques)
    first = np.zeros(pattern.shape[0], int)
    first[rows[20:, None] + np.arange(3)] = 1
    for j in range(len(pattern.heads)):
        own = first[pattern.starts[j]]
        for e in range(pattern.columns[j], pattern.columns[j + 1]):
            start, count = pattern.segments[2 * e : 2 * e + 2]
            assert set(first[start : start + count]) == {own}


def test_many_joints_at_one_body():
    n = 60
    sizes = [3] * n
    rows, pattern, where = analyse(sizes, [range(n), *([i] for i in range(n))])
    assert len(pattern.heads) <= n // 4  # amalgamated
    assert len(pattern.records) // 6 <= len(pattern.heads) ** 2
    rng = np.random.default_rng(0)
    A, starts, pairs = matrices(sizes, [range(n)], rng)
    _, values = fill(A, starts, {p for p in pairs if not where(*p)[2]}, where, pattern)
    assert factor(pattern, values, 1e-14) == -1
    x = np.ones(3 * n)
    solve(pattern, values, x)
    to = permutation(sizes, rows)
    assert np.linalg.norm(A @ x[to] - 1.0) <= bound(A, x)


def test_a_grid_fills_in_little():
    """Nested dissection of a k x k grid keeps 31/4 k^2 log2 k numbers; minimum degree does about as well."""
    k = 24
    n, cliques = grid(k, k)
    pattern = analyse([1] * n, cliques)[1]
    assert pattern.shape[1] < 31 / 4 * n * math.log2(k)


@pytest.mark.slow
@pytest.mark.parametrize("row", [0, 4, 17, 29])
@pytest.mark.parametrize("value", [-1.0, 1e-17, math.nan])  # 1e-17 is what rounding leaves of a repeated row
def test_failure_names_the_row(row, value):
    n, cliques = chain(10)
    rows, pattern, where = analyse([3] * n, cliques)
    offset, stride, _ = where(row // 3, row // 3)
    values = np.zeros(pattern.shape[2])
    for i in range(n):
        at, step, _ = where(i, i)
        values[at : at + 3 * step : step + 1] = 1.0
        values[at + 1] = 0.1
    here = row % 3
    if value == 1e-17:  # a row that is another one
        here = here or 1
        values[offset + here] = 1.0
        if here == 2:
            values[offset + stride + 2] = 0.1
    else:
        values[offset + here * (stride + 1)] = value
    failed = rows[row // 3] + here
    lower, upper = values.copy(), values.copy()
    assert factor(pattern, values, 1e-14) == failed
    if value != -1.0:
        assert factor_lu(pattern, lower, upper, 1e-14) == failed


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_late_nodes_have_negative_pivots(seed):
    """[A, B; B^T, -C] with A definite and C next to nothing, as bodies without inertia about an axis make it."""
    rng = np.random.default_rng(seed)
    n, cliques = [chain(12), ring(9), grid(4, 3), tree([0, 1, 1, 2, 0, 5, 5, 3])][seed % 4]
    sizes, bodies = rng.integers(1, 5, n).tolist(), [clique for clique in cliques if clique]
    lean = [i for i in range(len(bodies)) if rng.random() < 0.6]
    cliques = [[*clique, *([n + lean.index(i)] if i in lean else [])] for i, clique in enumerate(bodies)]
    A, starts, pairs = matrices(sizes, bodies, rng)
    B = np.zeros((len(A), len(lean)))
    for k, i in enumerate(lean):
        at = np.concatenate([np.arange(starts[j], starts[j + 1]) for j in bodies[i]])
        B[at, k] = rng.normal(size=at.size)
        pairs |= {(j, n + k) for j in bodies[i]} | {(n + k, n + k)}
    C = np.diag(rng.choice((0.0, 1e-9), len(lean)))
    whole = np.block([[A, B], [B.T, -C]])
    starts = np.concatenate((starts, starts[-1] + 1 + np.arange(len(lean))))
    rows, pattern, where = analyse([*sizes, *[1] * len(lean)], cliques, len(lean))
    values = fill(whole, starts, pairs, where, pattern)[1]
    assert factor(pattern, values, 1e-14) == -1
    order, x = permutation([*sizes, *[1] * len(lean)], rows).astype(int), rng.normal(size=len(whole))
    b = np.zeros(len(whole))
    b[order] = whole @ x
    solve(pattern, values, b)
    np.testing.assert_allclose(b[order], x, rtol=0.0, atol=CLOSE)
    assert sorted(pattern.negative.tolist()) == sorted(rows[n:].tolist())


def test_the_type_of_a_pattern_never_changes():
    problems = [([], []), ([0], [[0]]), ([1], []), ([6], [[0]]), ([3] * 40, chain(40)[1]), ([2] * 40, ring(40)[1])]
    for sizes, cliques in problems:
        rows, pattern, _ = analyse(sizes, cliques)
        assert isinstance(pattern, Pattern)
        assert rows.dtype == np.int64
        assert rows.shape == (len(sizes),)
        for array in pattern:
            assert array.dtype == np.int64
            assert array.ndim == 1
            assert array.flags.c_contiguous
