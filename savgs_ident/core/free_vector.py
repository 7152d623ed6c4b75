"""The parameters of a table that may move, as one vector of coordinates without bounds.

The parameters of a table that may move form a :class:`FreeVector` of coordinates, each with its map
(:mod:`savgs_ident.core.transforms`). *Identified* ones, which are asked
for, come first, then those *tolerated* ones that are estimated along.

    >>> table = ParameterTable((
    ...     Parameter("mu_r", 0.03, "1", lower=0.0, upper=0.5),
    ...     Parameter("k_t", 275e3, "N/m", tolerance=13.75e3, lower=0.0),
    ... ))
    >>> free = FreeVector(table, identified=("mu_r",), tolerated=("k_t",))
    >>> values = free.to_constrained(jnp.array([0.0, -1.0]))
    >>> [f"{name} = {float(value):.6g}" for name, value in values.items()]
    ['mu_r = 0.03', 'k_t = 261250']
"""

from collections.abc import Callable, Mapping, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import Parameter, ParameterTable
from savgs_ident.core.transforms import (
    AbstractBijection,
    move_inside,
    prior_width,
    tolerated_bijection,
    transform_of,
)


class FreeVector(eqx.Module):
    """Named parameters of a table on unconstrained coordinates, u = 0 at the table's values.

    It holds no arrays: close over it or pass it through any JAX transformation.

    Raises :class:`InputError` for a name that the table does not have, a name given twice, a tolerated
    parameter without tolerance or on its bound, an identified one whose scale nothing gives.
    """

    identified: tuple[str, ...] = eqx.field(static=True)
    tolerated: tuple[str, ...] = eqx.field(static=True)
    parameters: tuple[Parameter, ...] = eqx.field(static=True)

    def __init__(
        self, table: ParameterTable, identified: Sequence[str], tolerated: Sequence[str] = ()
    ) -> None:
        self.identified = tuple(identified)
        self.tolerated = tuple(tolerated)
        _check_names(table, self.names)
        self.parameters = tuple(table[name] for name in self.names)
        self._bijections()  # A parameter that has none is refused here, not at the first use.

    @property
    def names(self) -> tuple[str, ...]:
        """All n names in the order of the vector: identified ones first."""
        return self.identified + self.tolerated

    def to_unconstrained(self, values: Mapping[str, float]) -> Float[Array, " n"]:
        """The vector (n,) [1] of the given SI values; a value on a bound is moved inside a little.

        ``values`` may hold other names too. Raises :class:`InputError` for a missing name or a value outside
        its bounds. Not for use inside a JAX transformation.
        """
        missing = [name for name in self.names if name not in values]
        if missing:
            raise InputError(f"the value of parameter '{missing[0]}' is missing", remedy="give all free ones")
        inside = [move_inside(parameter, float(values[parameter.name])) for parameter in self.parameters]
        pairs = zip(self._bijections(), inside, strict=True)
        u = np.array([bijection.inverse(value) for bijection, value in pairs], float)
        if not np.isfinite(u).all():
            on = self.names[int(np.argmin(np.isfinite(u)))]
            raise InputError(f"parameter '{on}' lies on its bound", remedy="choose a value inside")
        return jnp.asarray(u)

    def coordinates(self, values: Float[Array, " n"]) -> Float[Array, " n"]:
        """The vector [1] of ``values`` (n,) [SI unit of each], in the order of the names, strictly inside the bounds.

        Unlike :meth:`to_unconstrained` it may be traced, and nothing is checked.
        """
        return self._mapped(values, _inverse)

    def to_constrained(self, u: Float[Array, " n"]) -> dict[str, Float[Array, ""]]:
        """Name to SI value, strictly inside the bounds, at the vector ``u`` (n,) [1]."""
        return dict(zip(self.names, jnp.unstack(self._values(u)), strict=True))

    def jacobian_diag(self, u: Float[Array, " n"]) -> Float[Array, " n"]:
        """d value / d u of every parameter at ``u`` (n,) [SI unit of each]; the Jacobian is diagonal."""
        return jax.jvp(self._values, (u,), (jnp.ones_like(u),))[1]

    @property
    def widths(self) -> Float[np.ndarray, " n"]:
        """Standard deviations of the coordinates before the data [1]."""
        return np.array([prior_width(parameter) for parameter in self.parameters])

    def prior_residuals(self, u: Float[Array, " n"]) -> Float[Array, " n"]:
        """The coordinates in their standard deviations before the data [1].

        Half their sum of squares is minus the log prior, but for a constant.
        """
        return u / self.widths

    def _bijections(self) -> list[AbstractBijection]:
        split = len(self.identified)
        return [transform_of(parameter) for parameter in self.parameters[:split]] + [
            transform_of(parameter) if parameter.is_typical else tolerated_bijection(parameter)
            for parameter in self.parameters[split:]
        ]

    def _values(self, u: Float[Array, " n"]) -> Float[Array, " n"]:
        return self._mapped(u, _forward)

    @eqx.filter_jit
    def _mapped(
        self, x: Float[Array, " n"], one: Callable[[AbstractBijection, Array], Array]
    ) -> Float[Array, " n"]:
        # All maps of one kind in one operation: dozens of scalar ones would take a second to compile.
        mapped = jnp.zeros_like(x)
        bijections = self._bijections()
        for kind in dict.fromkeys(type(bijection) for bijection in bijections):
            places = [place for place, bijection in enumerate(bijections) if type(bijection) is kind]
            stacked = jax.tree.map(lambda *leaves: np.array(leaves), *(bijections[place] for place in places))
            mapped = mapped.at[np.array(places)].set(one(stacked, x[np.array(places)]))
        return mapped


def _forward(bijection: AbstractBijection, u: Array) -> Array:
    return bijection.forward(u)


def _inverse(bijection: AbstractBijection, values: Array) -> Array:
    return bijection.inverse(values)


def known_to_tolerance(table: ParameterTable, identified: Sequence[str] = ()) -> tuple[str, ...]:
    """The names in ``table`` that carry a tolerance, or are typical, and are not ``identified``, in its order."""
    known = (entry.name for entry in table.entries if entry.has_prior)
    return tuple(name for name in known if name not in identified)


def _check_names(table: ParameterTable, names: tuple[str, ...]) -> None:
    for position, name in enumerate(names):
        if name not in table:
            raise InputError(f"there is no parameter '{name}'", remedy="choose among: " + ", ".join(table))
        if name in names[:position]:
            raise InputError(f"parameter '{name}' is free twice", remedy="name it once")
