"""The order of elimination of bodies and rows: fill of trees, and sets of bodies and rows with one anchor."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tsdyn.rows.saddle_matrix import GROUND, order_saddle
from tsdyn.rows.symbolic import lay_out_in_order


@st.composite
def graphs(draw):
    """Bodies, pairs of bodies or ground with rows, pairs with forces, bodies with axis rows."""
    count = draw(st.integers(1, 9))
    body = st.integers(0, count - 1)
    pair = (
        st.tuples(st.integers(GROUND, count - 1), body).filter(lambda p: p[0] != p[1]).map(lambda p: tuple(sorted(p)))
    )
    pairs = draw(st.lists(pair, unique=True, max_size=14))
    joined = draw(st.lists(pair.filter(lambda p: p[0] != GROUND), unique=True, max_size=6))
    return count, pairs, joined, draw(st.lists(body, unique=True, max_size=3))


def anchors(done, rows, pairs, first):
    """Bodies that are not eliminated, or the ground, which eliminated rows join to the set of an eliminated body."""
    reached, found, ways = {first}, set(), [first]
    while ways:
        here = ways.pop()
        for i in rows:
            if here in pairs[i]:
                other = pairs[i][0] if pairs[i][1] == here else pairs[i][1]
                if other in done and other not in reached:
                    reached.add(other)
                    ways.append(other)
                elif other not in done:
                    found.add(other)
    return found


@given(graphs())
def test_rows_follow_a_body_and_sets_have_one_anchor(graph):
    count, pairs, joined, lean = graph
    order = order_saddle([6] * count, pairs, joined, lean)
    assert sorted(order) == list(range(count + len(pairs) + len(lean)))
    done, rows = set(), set()
    for node in order:
        if node < count:
            done.add(node)
        elif node < count + len(pairs):
            assert done.intersection(pairs[node - count])
            rows.add(node - count)
        else:
            body = lean[node - count - len(pairs)]
            assert body in done
            assert all(i in rows for i, pair in enumerate(pairs) if body in pair)
        assert all(len(anchors(done, rows, pairs, body)) < 2 for body in done)


def test_a_tree_has_no_fill():
    """Behind a body's six rows and columns those of its joint and of its parent are all that there is."""
    parents = np.random.default_rng(0).integers(-1, np.arange(40), 40)
    pairs = [(int(parent), i) for i, parent in enumerate(parents)]
    order = order_saddle([6] * 40, pairs, [pair for pair in pairs if pair[0] != GROUND])
    cliques = [{*pair, 40 + i} - {GROUND} for i, pair in enumerate(pairs)]
    _, pattern, _ = lay_out_in_order([6] * 40 + [5] * 40, cliques, order)
    assert pattern.widths.max() <= 24 + 6
    assert pattern.shape[1] < 40 * 2 * 11 * (22 + 6)


def test_a_hub_is_eliminated_last():
    count = 300
    pairs = [(0, i) for i in range(1, count)]
    order = order_saddle([6] * count, pairs, [])
    cliques = [{*pair, count + i} for i, pair in enumerate(pairs)]
    _, pattern, _ = lay_out_in_order([6] * count + [3] * len(pairs), cliques, order)
    assert pattern.shape[1] < 400 * count
