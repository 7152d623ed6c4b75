"""What the samples tell about the parameters, from the solved program.

The constraints fix the motions once the parameters are given: J_z dz = -J_u du. So the objective's curvature,
taken along, is the information on parameters and sensors' zeros; the latter are eliminated.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from savgs_ident.fit.collocation.program import Program
from savgs_ident.fit.covariance import Spread, spread_of


def information(program: Program, w: NDArray[np.float64]) -> NDArray[np.float64]:
    """Information matrix (n, n) of the parameters' coordinates at the solution ``w`` [1], (m,), priors included.

    Raises :class:`RuntimeError` where the constraints do not fix the motions.
    """
    unknowns = program.unknowns
    n, first_zero = unknowns.parameters, unknowns.size - unknowns.zeros.size
    found = program.jacobian(w)
    colind, row = found.sparsity().get_ccs()
    jacobian = csc_array((np.array(found.nonzeros()), row, colind), shape=found.shape)
    motion = splu(csc_array(jacobian[:, n:first_zero]))
    follow = motion.solve(-jacobian[:, :n].toarray())
    along = np.zeros((unknowns.size, n + unknowns.zeros.size))
    along[:n, :n] = np.eye(n)
    along[n:first_zero, :n] = follow
    along[first_zero:, n:] = np.eye(unknowns.zeros.size)
    whole = along.T @ (program.quadratic.curvature @ along)
    coupling, of_zeros = whole[:n, n:], whole[n:, n:]
    reduced: NDArray[np.float64] = whole[:n, :n] - coupling @ np.linalg.solve(of_zeros, coupling.T)
    return reduced


def spread_at(program: Program, w: NDArray[np.float64]) -> Spread:
    """The spread of the parameters' coordinates; directions that the samples do not tell as in a fit.

    ``w`` [1], (m,), are the scaled unknowns of the solution.
    """
    values, axes = np.linalg.eigh(information(program, w))
    return spread_of((axes * np.sqrt(np.maximum(values, 0.0))).T)
