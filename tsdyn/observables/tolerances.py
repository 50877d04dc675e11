"""Limits of evaluation and of reactions, as shares of what is named."""

# Of a row's diagonal entry, tried in turn: rows with smaller pivots are left out, as redundant.
REDUNDANT_SHARES = 3e-2, 1e-3, 1e-6, 1e-9
# Of the largest motion that the rows left out allow: a row that moves more is independent of the others left out.
INDEPENDENT = 1e-3
# Coordinates from which on matrices are sparse (a dense solution takes 0.1 s there).
LARGE = 1000
# Floats of a workspace of rows, of a start, or of a reader of dense output, up to which it is kept for the next call (8
# MB): a thousand bodies.
KEPT_FLOATS = 1 << 20
