"""Recurrences of Taylor coefficients, of which `series` kernels are made; the polar angle as an analytic function."""

import numpy as np

from ..jit.kernels import kernel

# Recurrences of Taylor coefficients: the building blocks of `series` kernels of constraints and forces.
#
# A series is a row of coefficients, a[k] that of t^k. Each function returns coefficient k of its result from the rows
# of its arguments up to k and the row of the result up to k - 1. Fill rows of the scratch array in order:
#
#     s[2, k] = product(s[0], s[1], k)
#     s[3, k] = root(s[2], s[3], k)
#
#     product          c = a b                 c_k = sum_j a_j b_{k-j}
#     square           c = a a                 the same in half the operations
#     dot, cross       of three rows each; scaled: of three rows and one
#     rotation         A(p) by columns, nine rows; rotated, rotated_back: A v and A^T v
#     quotient         q = a / b               b_0 q_k = a_k - sum_{j>0} b_j q_{k-j}                         (1)
#     root             r = sqrt(a)             2 r_0 r_k = a_k - sum_{0<j<k} r_j r_{k-j}                     (2)
#     power            u = a^n                 k a_0 u_k = sum_{j>0} (n j - (k - j)) a_j u_{k-j}             (3)
#     exponential      e = exp(a)              k e_k = sum_j j a_j e_{k-j}                                   (4)
#     sine_cosine      s, c of a               k s_k = sum_j j a_j c_{k-j},  k c_k = -sum_j j a_j s_{k-j}    (5)
#     angle            theta of (x, y)         theta' (x^2 + y^2) = x y' - y x'                              (6)
#
# (1)-(6) are the product rule applied to q b = a, r r = a, a u' = n a' u, e' = a' e, s' = a' c, c' = -a' s and (6).


@kernel
def product(a, b, k):
    """Coefficient k of a b."""
    even, odd = a[0] * b[k], 0.0  # two sums: each addition waits for the one before
    for j in range(1, k, 2):
        odd += a[j] * b[k - j]
        even += a[j + 1] * b[k - j - 1]
    return even + odd + (a[k] * b[0] if k % 2 == 1 else 0.0)


@kernel
def square(a, k):
    """Coefficient k of a a."""
    total = 0.0
    for j in range((k + 1) // 2):
        total += a[j] * a[k - j]
    return 2.0 * total + (a[k // 2] * a[k // 2] if k % 2 == 0 else 0.0)


@kernel
def dot(s, i, j, k):
    """Coefficient k of the scalar product of the vectors in rows i, i + 1, i + 2 and j, j + 1, j + 2 of s."""
    x, y, z = 0.0, 0.0, 0.0
    for l in range(k + 1):
        x += s[i, l] * s[j, k - l]
        y += s[i + 1, l] * s[j + 1, k - l]
        z += s[i + 2, l] * s[j + 2, k - l]
    return x + y + z


@kernel
def cross(s, i, j, k):
    """Coefficient k of the vector product, a tuple of three, of the vectors in rows i and j on of s."""
    x, y, z, u, v, w = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for l in range(k + 1):
        a0, a1, a2 = s[i, l], s[i + 1, l], s[i + 2, l]
        b0, b1, b2 = s[j, k - l], s[j + 1, k - l], s[j + 2, k - l]
        x += a1 * b2
        u += a2 * b1
        y += a2 * b0
        v += a0 * b2
        z += a0 * b1
        w += a1 * b0
    return x - u, y - v, z - w


@kernel
def scaled(s, i, j, k):
    """Coefficient k of the vector in rows i, i + 1, i + 2 of s times the number in row j, a tuple of three."""
    x, y, z = 0.0, 0.0, 0.0
    for l in range(k + 1):
        f = s[j, k - l]
        x += s[i, l] * f
        y += s[i + 1, l] * f
        z += s[i + 2, l] * f
    return x, y, z


@kernel
def rotation(s, p, a, k):
    """Write coefficient k of A(p) into rows a to a + 8 of s, column after column; p is in rows p to p + 3."""
    aa, bb, cc, dd, ab, ac, ad, bc, bd, cd = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for l in range(k + 1):
        # All ten products of two components of p
        e0, e1, e2, e3 = s[p, l], s[p + 1, l], s[p + 2, l], s[p + 3, l]
        g0, g1, g2, g3 = s[p, k - l], s[p + 1, k - l], s[p + 2, k - l], s[p + 3, k - l]
        aa += e0 * g0
        bb += e1 * g1
        cc += e2 * g2
        dd += e3 * g3
        ab += e0 * g1
        ac += e0 * g2
        ad += e0 * g3
        bc += e1 * g2
        bd += e1 * g3
        cd += e2 * g3
    s[a, k], s[a + 1, k], s[a + 2, k] = aa + bb - cc - dd, 2.0 * (bc + ad), 2.0 * (bd - ac)
    s[a + 3, k], s[a + 4, k], s[a + 5, k] = 2.0 * (bc - ad), aa - bb + cc - dd, 2.0 * (cd + ab)
    s[a + 6, k], s[a + 7, k], s[a + 8, k] = 2.0 * (bd + ac), 2.0 * (cd - ab), aa - bb - cc + dd


@kernel
def rotated(s, a, v, k):
    """Coefficient k of A times the vector in rows v to v + 2, a tuple of three; A is in rows a to a + 8."""
    x, y, z = 0.0, 0.0, 0.0
    for l in range(k + 1):
        v0, v1, v2 = s[v, k - l], s[v + 1, k - l], s[v + 2, k - l]
        x += s[a, l] * v0 + s[a + 3, l] * v1 + s[a + 6, l] * v2
        y += s[a + 1, l] * v0 + s[a + 4, l] * v1 + s[a + 7, l] * v2
        z += s[a + 2, l] * v0 + s[a + 5, l] * v1 + s[a + 8, l] * v2
    return x, y, z


@kernel
def rotated_back(s, a, v, k):
    """Coefficient k of A^T times the vector in rows v to v + 2, a tuple of three; A is in rows a to a + 8."""
    x, y, z = 0.0, 0.0, 0.0
    for l in range(k + 1):
        v0, v1, v2 = s[v, k - l], s[v + 1, k - l], s[v + 2, k - l]
        x += s[a, l] * v0 + s[a + 1, l] * v1 + s[a + 2, l] * v2
        y += s[a + 3, l] * v0 + s[a + 4, l] * v1 + s[a + 5, l] * v2
        z += s[a + 6, l] * v0 + s[a + 7, l] * v1 + s[a + 8, l] * v2
    return x, y, z


@kernel
def quotient(a, b, q, k):
    """Coefficient k of q = a / b, Eq. (1); b[0] is not zero."""
    total = a[k]
    for j in range(1, k + 1):
        total -= b[j] * q[k - j]
    return total / b[0]


@kernel
def root(a, r, k):
    """Coefficient k of r = sqrt(a), Eq. (2); a[0] > 0."""
    if k == 0:
        return np.sqrt(a[0])
    total = 0.0
    for j in range(1, (k + 1) // 2):
        total += r[j] * r[k - j]
    middle = r[k // 2] * r[k // 2] if k % 2 == 0 else 0.0
    return (a[k] - 2.0 * total - middle) / (2.0 * r[0])


@kernel
def power(a, u, n, k):
    """Coefficient k of u = a^n, Eq. (3), n any constant; a[0] is not zero, and positive for fractional n."""
    if k == 0:
        return a[0] ** n
    total, steep = 0.0, n + 1.0
    for j in range(1, k + 1):
        total += (steep * j - k) * a[j] * u[k - j]
    return total / (k * a[0])


@kernel
def inverse_root(a, u, k):
    """Coefficient k of u = 1 / sqrt(a), Eq. (3) with n = -1/2; a[0] > 0."""
    if k == 0:
        return 1.0 / np.sqrt(a[0])
    total = 0.0
    for j in range(1, k + 1):
        total += (0.5 * j - k) * a[j] * u[k - j]
    return total / (k * a[0])


@kernel
def exponential(a, e, k):
    """Coefficient k of e = exp(a), Eq. (4)."""
    if k == 0:
        return np.exp(a[0])
    total = 0.0
    for j in range(1, k + 1):
        total += j * a[j] * e[k - j]
    return total / k


@kernel
def sine_cosine(a, s, c, k):
    """Coefficients k, a tuple, of s = sin(a) and c = cos(a), Eq. (5); the rows of both are needed."""
    if k == 0:
        return np.sin(a[0]), np.cos(a[0])
    sine, cosine = 0.0, 0.0
    for j in range(1, k + 1):
        f = j * a[j]
        sine += f * c[k - j]
        cosine -= f * s[k - j]
    return sine / k, cosine / k


@kernel
def angle(y, x, square, theta, k):
    """Coefficient k of theta = atan2(y, x), Eq. (6), in (-pi, pi] at k = 0; `square` is the row of x^2 + y^2."""
    if k == 0:
        return np.arctan2(y[0], x[0])
    total = 0.0
    for j in range(1, k + 1):
        total += j * (x[k - j] * y[j] - y[k - j] * x[j])
    for j in range(1, k):
        total -= j * theta[j] * square[k - j]
    return total / (k * square[0])


# The polar angle of (x, y) as an analytic function: also for complex numbers, truncated Taylor series and arrays.

TURN_ROUND = 2.0 * np.pi


@kernel
def polar_angle(y, x):
    """The angle atan2(y, x) in (-pi, pi], exact to first order in an imaginary part and to second order of a series.

    The point is rotated back by its real angle; the remainder atan(s / c) with s = 0 is s / c to second order.
    """
    real = np.arctan2(y.real, x.real)
    cosine, sine = np.cos(real), np.sin(real)
    return real + (y * cosine - x * sine) / (x * cosine + y * sine)


@kernel
def angle_near(y, x, near):
    """The angle of (x, y) on the turn that lies nearest to a real angle."""
    principal = polar_angle(y, x)
    return principal + TURN_ROUND * np.floor((near - principal.real) / TURN_ROUND + 0.5)


@kernel
def angle_about(x, near):
    """The angle from f = x[3:6] to g = x[6:9] about u = x[:3], perpendicular to f, on the turn nearest to `near`."""
    w0, w1, w2 = x[1] * x[5] - x[2] * x[4], x[2] * x[3] - x[0] * x[5], x[0] * x[4] - x[1] * x[3]  # u x f
    y = x[6] * w0 + x[7] * w1 + x[8] * w2
    return angle_near(y, x[6] * x[3] + x[7] * x[4] + x[8] * x[5], near)


@kernel
def angle_series(near, k, s):
    """Coefficient k of `angle_about`, in row 18 of s; u, f, g are in rows 0 to 8; 9 to 11 and 15 to 17 are its own."""
    s[9, k], s[10, k], s[11, k] = cross(s, 0, 3, k)
    s[15, k] = dot(s, 6, 9, k)
    s[16, k] = dot(s, 6, 3, k)
    s[17, k] = square(s[15], k) + square(s[16], k)
    if k == 0:
        s[18, 0] = angle_near(s[15, 0], s[16, 0], near)
    else:
        s[18, k] = angle(s[15], s[16], s[17], s[18], k)
