"""Arrays of CasADi scalars.

What is known while translating stays a NumPy array and is computed at once; what depends on the inputs is a
:class:`Grid` of scalar expressions.
"""

from typing import NamedTuple

import numpy as np
from casadi import SX, densify, vertcat
from numpy.typing import NDArray

from savgs_ident.core.errors import SavgsIdentError


class TranslationError(SavgsIdentError):
    """A function that cannot be told to CasADi: ``what`` of it, and the ``place`` in the source, "" if unknown."""

    def __init__(self, what: str, place: str = "") -> None:
        self.what, self.place = what, place
        super().__init__(f"{what} ({place})" if place else what)


class Grid(NamedTuple):
    """Scalar expressions in an array of ``shape``, last index fastest."""

    items: tuple[SX, ...]
    shape: tuple[int, ...]

    @property
    def places(self) -> NDArray[np.int64]:
        """The place of each entry in ``items``, as an array of the same shape."""
        return np.arange(len(self.items)).reshape(self.shape)


Operand = Grid | NDArray[np.generic]
"""What an operation works on: expressions, or numbers that are known already, of any shape and any unit."""


def as_grid(operand: Operand) -> Grid:
    """The operand as expressions, constant ones where it is known."""
    if isinstance(operand, Grid):
        return operand
    return Grid(tuple(SX(float(value)) for value in operand.ravel()), operand.shape)


def as_known(operand: Operand) -> NDArray[np.float64] | None:
    """The values of an operand, of its shape and in its unit, if it does not depend on the inputs.

    None if it does.
    """
    if not isinstance(operand, Grid):
        return np.asarray(operand, np.float64)
    if not all(item.is_constant() for item in operand.items):
        return None
    return np.array([float(item) for item in operand.items]).reshape(operand.shape)


def grid_from_column(column: SX, shape: tuple[int, ...]) -> Grid:
    """The entries of a CasADi column as a grid."""
    return Grid(tuple(column[i] for i in range(column.numel())), shape)


def column_of(operand: Operand) -> SX:
    """A dense CasADi column of all entries, last index fastest."""
    items = as_grid(operand).items
    return densify(vertcat(*items)) if items else SX.zeros(0, 1)
