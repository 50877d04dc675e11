"""Rolling bodies on a level plane by Newton's and Euler's equations about the contact point, in SciPy."""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

GRAVITY = 9.81


def radius_to_contact(gamma, squares, tyre):
    """From the centre of the surface to the contact point; gamma is the upward normal, body frame."""
    return -squares * gamma / np.sqrt(squares @ gamma**2) - tyre * gamma


def radius_rate(gamma, rate, squares, tyre):
    """Its rate in the body frame, gamma having one."""
    s = np.sqrt(squares @ gamma**2)
    return -squares * (rate / s - gamma * (squares * gamma @ rate) / s**3) - tyre * rate


def reference(mass, inertia, semi_axes, omega, orientation, times, tyre=0.0, centre=(0.0, 0.0, 0.0)):
    """omega (body frame), gamma and the contact point (k, 2) at some times, from rolling at omega at the origin.

    rho from centroid to contact:  v = rho x omega,  F = m (vd + omega x v + g gamma)
    I omegad + omega x I omega = rho x F,  gammad = gamma x omega,  R' = R [omega]
    """
    squares, inertia, centre = np.square(semi_axes), np.asarray(inertia), np.asarray(centre)
    inertia = np.diag(inertia) if inertia.ndim == 1 else inertia

    def rate(_, y):
        omega, A = y[:3], y[3:12].reshape(3, 3)
        gamma = A[2]
        gammad = np.cross(gamma, omega)
        rho = centre + radius_to_contact(gamma, squares, tyre)
        rhod = radius_rate(gamma, gammad, squares, tyre)
        v = np.cross(rho, omega)
        whole = inertia + mass * (rho @ rho * np.eye(3) - np.outer(rho, rho))
        torque = mass * np.cross(rho, np.cross(rhod, omega) + np.cross(omega, v) + GRAVITY * gamma)
        omegad = np.linalg.solve(whole, torque - np.cross(omega, inertia @ omega))
        cross = np.array([[0, -omega[2], omega[1]], [omega[2], 0, -omega[0]], [-omega[1], omega[0], 0]])
        return np.concatenate((omegad, (A @ cross).ravel(), (A @ rhod)[:2]))

    A = Rotation.as_matrix(orientation)
    start = np.concatenate((omega, A.ravel(), np.zeros(2)))
    found = solve_ivp(rate, (0.0, times[-1]), start, "DOP853", times, rtol=1e-13, atol=1e-13)
    return found.y[:3].T, found.y[9:12].T, found.y[12:].T


def placed(scene, mass, inertia, semi_axes, omega, orientation, tyre=0.0, centre=(0.0, 0.0, 0.0), **body):
    """A body whose surface touches z = 0 at the origin and rolls at omega."""
    A = Rotation.as_matrix(orientation)
    rho = np.asarray(centre) + radius_to_contact(A[2], np.square(semi_axes), tyre)
    return scene.add_body(
        mass, inertia, position=-A @ rho, orientation=orientation, velocity=A @ np.cross(rho, omega),
        angular_velocity=omega, **body,
    )  # fmt: skip


def leaning(lean, heading=0.0):
    """The orientation of a disc about its y axis that leans by so much from upright, rad."""
    return Rotation.from_euler("zx", [heading, lean])
