"""How accelerations and velocities of a body depend on its chart coordinates, for implicit methods.

    omega'  = C etad                                        C = d0 I - d~ + d d^T / d0, its inverse d0 I + d~
    etadd   = C^-1 omega'd - |omega'|^2 d / 2

With dpi' = C deta and d = eta / 2,

    domega' = B dpi' + C detad                              B = C_d etad C^-1 / 2
    C detadd = domega'd + E dpi' - (d / d0) omega'^T domega'
    E       = -C (omega'd d^T / d0 + omega'd~ + |omega'|^2 I / 2) C^-1 / 2
"""

from ..jit.kernels import kernel, stack, stack2


@kernel
def _cross_matrix(v, i, scale, diagonal, out):
    """out (3, 3) = scale v~ + diagonal I, v being v[i : i + 3]."""
    x, y, z = scale * v[i], scale * v[i + 1], scale * v[i + 2]
    out[0, 0], out[0, 1], out[0, 2] = diagonal, -z, y
    out[1, 0], out[1, 1], out[1, 2] = z, diagonal, -x
    out[2, 0], out[2, 1], out[2, 2] = -y, x, diagonal


@kernel
def _multiply(A, B, scale, out):
    """out = scale A B, all (3, 3)."""
    for i in range(3):
        for j in range(3):
            out[i, j] = scale * (A[i, 0] * B[0, j] + A[i, 1] * B[1, j] + A[i, 2] * B[2, j])


@kernel
def rate_by_turn(d, i, etad, j, out):
    """out (3, 3) = B at d[i : i + 4] = (d, d0 - 1), etad[j : j + 3]."""
    X, inverse, d0 = stack2(3, 3), stack2(3, 3), 1.0 + d[i + 3]
    # C_d etad = etad~ + (d.etad / d0) I + (d (etad + (d.etad / d0^2) d)^T - etad d^T) / d0
    along = d[i] * etad[j] + d[i + 1] * etad[j + 1] + d[i + 2] * etad[j + 2]
    _cross_matrix(etad, j, 1.0, along / d0, X)
    for r in range(3):
        for c in range(3):
            X[r, c] += (d[i + r] * (etad[j + c] + along * d[i + c] / (d0 * d0)) - etad[j + r] * d[i + c]) / d0
    # C^-1 = d0 I + d~;  B = C_d etad C^-1 / 2
    _cross_matrix(d, i, 1.0, d0, inverse)
    _multiply(X, inverse, 0.5, out)


@kernel
def acceleration_by_turn(d, i, omega, j, omegad, k, out):
    """out (3, 3) = E at d[i : i + 4], omega'[j : j + 3], omega'd[k : k + 3]."""
    X, Y, C, d0 = stack2(3, 3), stack2(3, 3), stack2(3, 3), 1.0 + d[i + 3]
    # X = omega'd d^T / d0 + omega'd~ + |omega'|^2 I / 2
    square = omega[j] * omega[j] + omega[j + 1] * omega[j + 1] + omega[j + 2] * omega[j + 2]
    _cross_matrix(omegad, k, 1.0, 0.5 * square, X)
    for r in range(3):
        for c in range(3):
            X[r, c] += omegad[k + r] * d[i + c] / d0
    # C = d0 I - d~ + d d^T / d0
    _cross_matrix(d, i, -1.0, d0, C)
    for r in range(3):
        for c in range(3):
            C[r, c] += d[i + r] * d[i + c] / d0
    # E = -C X C^-1 / 2
    _multiply(C, X, 1.0, Y)
    _cross_matrix(d, i, 1.0, d0, C)
    _multiply(Y, C, -0.5, out)


@kernel
def _add_weighted(mass, i, X, scale, out):
    """out[21 + 6 r + c] += scale J' X, the columns of J' being at mass[i + 4 c]."""
    for r in range(3):
        for c in range(3):
            total = 0.0
            for a in range(3):
                total += mass[i + 4 * a + r] * X[a, c]
            out[21 + 6 * r + c] += scale * total


@kernel
def add_gyroscopic(mass, i, omega, j, C):
    """Add the derivative of -omega' x J' omega' to a block C."""
    momentum, turned, Jw, w = stack2(3, 3), stack2(3, 3), stack(3), stack2(3, 3)
    # (-omega' x J' omega')_omega' = (J' omega')~ - omega'~ J'
    for r in range(3):
        Jw[r] = mass[i + r] * omega[j] + mass[i + 4 + r] * omega[j + 1] + mass[i + 8 + r] * omega[j + 2]
    _cross_matrix(Jw, 0, 1.0, 0.0, momentum)
    _cross_matrix(omega, j, 1.0, 0.0, w)
    for r in range(3):
        for c in range(3):
            turned[r, c] = momentum[r, c]
            for a in range(3):
                turned[r, c] -= w[r, a] * mass[i + 4 * c + a]
            C[21 + 6 * r + c] += turned[r, c]


@kernel
def add_inertia(mass, i, E, B, d, j, omega, k, K, C):
    """Add J' times what a motion changes of C etadd at constant omega'd to the blocks K and C of a body.

    Ten arguments: where J', the two matrices, d and omega' are, and the blocks.
    """
    X, Y, d0 = stack2(3, 3), stack2(3, 3), 1.0 + d[j + 3]
    # X = -(d / d0) omega'^T, the derivative of C etadd by omega'
    for r in range(3):
        for c in range(3):
            X[r, c] = -d[j + r] * omega[k + c] / d0
    # K += J' (E + X B),  C += J' X
    _multiply(X, B, 1.0, Y)
    for r in range(3):
        for c in range(3):
            Y[r, c] += E[r, c]
    _add_weighted(mass, i, Y, 1.0, K)
    _add_weighted(mass, i, X, 1.0, C)
