"""Loads of contacts between the same two bodies whose rows depend on each other, as those of a box with four feet.

    J_i = sum C_ij J_j,   C: x_i - x_j in the plane, of three points at most whose rows are independent      (1)
    N   = S lam,          S = C (C^T C)^-1                                                                   (2)

Of all loads N of the same resultant as lam of the independent rows these are the least; so are those of points that are
equally compliant. C and S are of the body that has the points: constant as long as the same contacts carry.

Where others hold the rotations about the plane, as one finger of a gripper for both, one row is left, that of the mean
point, and loads are alike.
"""

import numpy as np

from ..elements.sliding import _Sliding
from ..maths.dense_solve import least_squares, null_space
from ..maths.tolerances import RANK_TOL


def groups_of(gaps, which):
    """Lists of those of the gaps `which` that may share loads: points of one body on one plane, with friction."""
    groups = {}
    for i in which:
        if not gaps.rough[i]:
            continue
        law = gaps.list[i].side.grip.sliding
        if type(law) is _Sliding and not (law.balls or law.tyre_radius) and law.a.dimension == 7:
            groups.setdefault((id(law.a), id(law.b), *law.normal_b), []).append(i)
    return list(groups.values())


def rank_of(gaps, which):
    """The number of points of a group, three at most, whose rows are independent where nothing else holds the body."""
    points = _points(gaps, which)
    return points.shape[1] - null_space(points, RANK_TOL).shape[1]


def _points(gaps, which):
    """1 and point_a over the size of the group (k, 4)."""
    places = np.array([gaps.list[i].side.grip.sliding.point_a for i in which])
    size = np.abs(places - places[0]).max(initial=0.0)
    return np.column_stack([np.ones(len(which)), (places - places.mean(axis=0)) / (size if size > 0.0 else 1.0)])


def sharing_groups(gaps, closed, dependent):
    """Yield each group of which some are `dependent`: its gaps (c), and those with rows (r)."""
    for members in groups_of(gaps, closed) if len(dependent) else ():
        own = [i for i in members if i not in dependent]
        if len(own) < len(members):
            yield members, own


def shares_of(gaps, closed, dependent):
    """Yield the same groups, each with S (c, r), Eq. (2)."""
    for members, own in sharing_groups(gaps, closed, dependent):
        if len(own) == 1:
            yield members, own, np.full((len(members), 1), 1.0 / len(members))
        else:
            points = _points(gaps, members)
            C = least_squares(points[[members.index(i) for i in own]].T, points.T, RANK_TOL).T
            yield members, own, least_squares(C.T, np.eye(len(own)), RANK_TOL)


def loads_of(gaps, closed, dependent):
    """Loads of closed gaps by the reactions of their rows, (c, c): those themselves, or Eq. (2)."""
    S = np.eye(len(closed))
    for members, own, shares in shares_of(gaps, closed, dependent):
        at = [closed.index(i) for i in members]
        S[at] = 0.0
        S[np.ix_(at, [closed.index(i) for i in own])] = shares
    return S


def lifts_of(gaps, closed, dependent, idle):
    """Those idle that would carry if they were to pull, of groups, and minus these loads by those of closed ones."""
    light, rows = [], [np.zeros((0, len(closed)))]
    for members in groups_of(gaps, sorted([*closed, *idle])):
        carry, off = [i for i in members if i in closed], [i for i in members if i in idle]
        if off and len(carry) > 1 and rank_of(gaps, carry) == rank_of(gaps, members):
            points = _points(gaps, [*carry, *off])
            row = np.zeros((len(off), len(closed)))
            share = least_squares(points[: len(carry)].T, points[len(carry) :].T, RANK_TOL).T
            row[:, [closed.index(i) for i in carry]] = -share
            light, rows = light + off, [*rows, row]
    return light, np.concatenate(rows) @ loads_of(gaps, closed, dependent)


def rows_of_closed(gaps, closed, dependent, values):
    """Of `values` (count, ...) of gaps those of the rows that hold closed ones: a mean where one row is of several."""
    found = values[[i for i in closed if i not in dependent]]
    for members, own in sharing_groups(gaps, closed, dependent):
        if len(own) == 1:
            found[[i for i in closed if i not in dependent].index(own[0])] = values[members].mean(axis=0)
    return found


def law_of(gaps, i, own, shares):
    """c and h (3,) of sliding.py, Eq. (5), of a contact whose load are such shares (r,) of rows `own`."""
    if len(own) == 1:
        return shares[0], np.zeros(3)
    places = np.array([gaps.list[j].side.grip.sliding.point_a for j in (i, *own)])
    arms = places[1:] - places[0]
    size = np.abs(arms).max(initial=0.0)
    c, *h = least_squares(np.column_stack([np.ones(len(own)), arms / size]), shares, RANK_TOL)
    return c, np.array(h) / size
