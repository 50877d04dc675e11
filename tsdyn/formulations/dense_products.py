"""Products of dense matrices, over the nonzero entries of the first factor."""

from ..jit.kernels import kernel


@kernel
def clear_matrix(out):
    """out = 0."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = 0.0


@kernel
def add_product(scale, A, B, out):
    """out += scale A B."""
    for i in range(A.shape[0]):
        for c in range(A.shape[1]):
            f = scale * A[i, c]
            if f != 0.0:
                for j in range(B.shape[1]):
                    out[i, j] += f * B[c, j]


@kernel
def add_transposed_product(scale, A, B, out):
    """out += scale A^T B."""
    for c in range(A.shape[0]):
        for i in range(A.shape[1]):
            f = scale * A[c, i]
            if f != 0.0:
                for j in range(B.shape[1]):
                    out[i, j] += f * B[c, j]


@kernel
def multiply(A, B, out):
    """out = A B."""
    clear_matrix(out)
    add_product(1.0, A, B, out)
