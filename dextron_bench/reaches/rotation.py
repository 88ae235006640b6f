"""Functions on arrays of unit quaternions (w, x, y, z): products, means, squad interpolation (Dam et al., 1998).

All functions but `mean` use elementary operations on the last axis, so that results do not depend on a BLAS library.
"""

from __future__ import annotations

import numpy as np

TINY = 1e-12


def unit(q: np.ndarray) -> np.ndarray:
    """Quaternions (..., 4) scaled to unit length."""
    return q / np.sqrt((q * q).sum(axis=-1, keepdims=True))


def continuous(q: np.ndarray) -> np.ndarray:
    """The same rotations (n, 4), with signs chosen so that no two neighbours have a negative dot product."""
    flips = np.where((q[1:] * q[:-1]).sum(axis=-1) < 0, -1.0, 1.0)
    return np.concatenate([q[:1], q[1:] * np.cumprod(flips)[:, None]])


def multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Hamilton product of quaternions (..., 4): the rotation b, followed by the rotation a."""
    aw, ax, ay, az = np.moveaxis(a, -1, 0)
    bw, bx, by, bz = np.moveaxis(b, -1, 0)
    return np.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        axis=-1,
    )


def conjugate(q: np.ndarray) -> np.ndarray:
    """Inverse rotations of unit quaternions (..., 4)."""
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def rotate(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Vectors v (..., 3) rotated by unit quaternions q (..., 4)."""
    w, axis = q[..., :1], q[..., 1:]
    v = np.broadcast_to(v, axis.shape)
    t = 2.0 * cross(axis, v)
    return v + w * t + cross(axis, t)


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross product of vectors (..., 3)."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    out[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    out[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    out[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return out


def log(q: np.ndarray) -> np.ndarray:
    """Half rotation vectors (..., 3) of unit quaternions (..., 4)."""
    length = np.sqrt((q[..., 1:] ** 2).sum(axis=-1, keepdims=True))
    angle = np.arctan2(length, q[..., :1])
    return q[..., 1:] * np.where(length > TINY, angle / np.maximum(length, TINY), 1.0)


def exp(half: np.ndarray) -> np.ndarray:
    """Unit quaternions (..., 4) of half rotation vectors (..., 3)."""
    angle = np.sqrt((half**2).sum(axis=-1, keepdims=True))
    ratio = np.where(angle > TINY, np.sin(angle) / np.maximum(angle, TINY), 1.0)
    return np.concatenate([np.cos(angle), half * ratio], axis=-1)


def slerp(a: np.ndarray, b: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Constant-speed rotation from a to b (n, 4) at fractions u (n,)."""
    return multiply(a, exp(log(multiply(conjugate(a), b)) * u[:, None]))


def mean(q: np.ndarray) -> np.ndarray:
    """Mean orientation (4,) of (n, 4): the leading eigenvector of the sum of outer products (Markley, 2007)."""
    vector = np.linalg.eigh((q[:, :, None] * q[:, None, :]).sum(axis=0))[1][:, -1]
    return vector if vector[np.argmax(np.abs(vector))] > 0 else -vector


def squad_controls(q: np.ndarray) -> np.ndarray:
    """Inner control quaternions (n, 4) of squad through nearly evenly timed q (n, 4); each end is its own control."""
    forward = log(multiply(conjugate(q[1:-1]), q[2:]))
    backward = log(multiply(conjugate(q[1:-1]), q[:-2]))
    inner = multiply(q[1:-1], exp(-(forward + backward) / 4.0))
    return np.concatenate([q[:1], inner, q[-1:]])


def squad(times: np.ndarray, q: np.ndarray, controls: np.ndarray, queries: np.ndarray) -> np.ndarray:
    """Quaternions (m, 4), at times `queries` [s] (m,), of the smooth rotation through q (n, 4) at `times` [s] (n,)."""
    i = np.clip(np.searchsorted(times, queries, side="right") - 1, 0, len(times) - 2)
    u = np.clip((queries - times[i]) / (times[i + 1] - times[i]), 0.0, 1.0)
    outer = slerp(q[i], q[i + 1], u)
    inner = slerp(controls[i], controls[i + 1], u)
    return unit(slerp(outer, inner, 2.0 * u * (1.0 - u)))
