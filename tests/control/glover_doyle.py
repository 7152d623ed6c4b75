"""Whether a controller for gamma exists, by the Hamiltonian matrices of Glover and Doyle (1988).

A second way to the least gamma: no synthesis, no closed loop, only invariant subspaces.
"""

import control
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, matrix_balance, schur

Matrix = NDArray[np.float64]


def _stabilising(hamiltonian: Matrix) -> Matrix | None:
    """The stabilising solution of a Riccati equation; None if there is none, or it is indefinite."""
    n = hamiltonian.shape[0] // 2
    _, basis, stable = schur(hamiltonian, sort="lhp")
    if stable != n:
        return None
    found = np.linalg.solve(basis[:n, :n].T, basis[n:, :n].T).T
    found = (found + found.T) / 2.0
    return found if np.min(np.linalg.eigvalsh(found)) > -1e-7 * np.max(np.abs(found)) else None


def _riccati(a: Matrix, b: Matrix, c: Matrix, d: Matrix, gamma: float, free: int) -> Matrix | None:
    """For z = C x + D u with the last inputs the command; ``free`` inputs are the adversary's."""
    weight = block_diag(-(gamma**2) * np.eye(free), d[:, free:].T @ d[:, free:])
    gain = np.vstack([b, -c.T @ d]) @ np.linalg.solve(weight, np.hstack([d.T @ c, b.T]))
    zero = np.zeros_like(a)
    return _stabilising(np.block([[a, zero], [-c.T @ c, -a.T]]) - gain)


def exists(plant: control.StateSpace, gamma: float, measured: int) -> bool:
    """Whether a plant with ``measured`` outputs last and one command last admits a controller for gamma."""
    seen, driven = plant.noutputs - measured, plant.ninputs - 1
    a, (scale, _) = matrix_balance(plant.A, permute=False, separate=True)
    b, c, d = plant.B / scale[:, None], plant.C * scale, plant.D
    # A command and measurements in other units are another plant with the same least gamma.
    command = np.linalg.norm(d[:seen, driven])
    units = np.linalg.norm(d[seen:, :driven], axis=1)
    full_b = np.hstack([b[:, :driven], b[:, driven:] / command])
    full_c = np.vstack([c[:seen], c[seen:] / units[:, None]])
    d12 = np.hstack([np.zeros((seen, driven)), d[:seen, driven:] / command])
    d21 = np.vstack([np.zeros((seen, driven)), d[seen:, :driven] / units[:, None]])
    x = _riccati(a, full_b, c[:seen], d12, gamma, driven)
    y = _riccati(a.T, full_c.T, b[:, :driven].T, d21.T, gamma, seen)
    if x is None or y is None:
        return False
    return float(np.max(np.abs(np.linalg.eigvals(x @ y)))) < gamma**2
