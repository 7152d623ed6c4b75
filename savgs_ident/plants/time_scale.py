"""How fast a plant is, beside the quarter car whose seconds all constants of this package are in.

Windows of roads and sweeps, nodes of motions and lags of laws are given in seconds and hertz for a plant that moves
as a quarter car does: its body at 1 Hz, its wheel at 10 Hz. A small mechanism may be ten times as fast, a tall
building ten times as slow. A plant's *time scale* [1] says by what its times are multiplied, and its frequencies
divided: 1 where its fastest natural frequency lies between :data:`SLOWEST_HZ` and :data:`FASTEST_HZ`, else the power
of two that brings it there, a slow one beyond :data:`SLOW_HZ`; a fast one no further than its slowest natural
frequency stays above :data:`BODY_HZ`, for a stiff part must not hide what swings slowly. A power of two, because the
frequency that a plant is declared with is not the one that is fitted, and a program is compiled for each scale.
"""

from collections.abc import Mapping
from math import ceil, floor, log2

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from savgs_ident.core.values import Values, as_values
from savgs_ident.plants.at_rest import nominal_inputs, standing
from savgs_ident.plants.base import AbstractPlant, Motion

FASTEST_HZ = 15.0
"""Above this a natural frequency [Hz] is that of a faster plant. Origin: a wheel swings at 9 to 14 Hz, and windows
are compared up to here."""

SLOWEST_HZ = 1.5
"""Below this the fastest natural frequency [Hz] is that of a slower one. Origin: a seat swings at 1.5 to 3 Hz, and
windows that suit a quarter car still suit it."""

BODY_HZ = 0.8
"""The slowest natural frequency of a fast plant comes to lie above this [Hz]. Origin: a body swings at 1 to 1.5 Hz,
and windows are compared from 0.4 Hz on."""

SLOW_HZ = 3.0
"""The fastest natural frequency of a slow plant comes to lie between this and twice it [Hz]. Origin: by choice: four
times as much is compared, so that a friction shows its harmonics, and a window has a tenth of the nodes."""


def time_scale_of(plant: AbstractPlant, p: Mapping[str, float]) -> float:
    """The time scale of a plant [1] with its parameters ``p`` [SI]; 1 for one that swings nowhere near its origin."""
    found = natural_frequencies(plant, p)
    if not found.size or SLOWEST_HZ <= found[-1] <= FASTEST_HZ:
        return 1.0
    slowest, fastest = float(found[0]), float(found[-1])
    if fastest > FASTEST_HZ:
        wanted, most = ceil(log2(fastest / FASTEST_HZ)), floor(log2(slowest / BODY_HZ))
        return 2.0 ** -max(min(wanted, most), 0)
    return 2.0 ** ceil(log2(SLOW_HZ / fastest))


def natural_frequencies(plant: AbstractPlant, p: Mapping[str, float]) -> Float[np.ndarray, " k"]:
    """Those of the plant's own coordinates near its origin [Hz], without damping and effects; (k,), k <= n.

    States of its own stand still, as the current of a motor does. None where its equations give no number there.
    """
    stiffness, mass = (np.asarray(each) for each in _stiffness_and_mass(plant, as_values(p)))
    try:
        squares = np.linalg.eigvals(np.linalg.solve(mass, stiffness))
    except np.linalg.LinAlgError:
        return np.zeros(0)
    return np.sort(np.sqrt(squares.real[squares.real > 0.0])) / (2.0 * np.pi)


@eqx.filter_jit
def _stiffness_and_mass(plant: AbstractPlant, p: Values) -> tuple[Float[Array, "n n"], Float[Array, "n n"]]:
    """By what the equations change with coordinates and accelerations, one coordinate a column."""
    n, u = len(plant.coordinates), nominal_inputs(plant, p)
    states = jnp.zeros(len(plant.states))

    def balance(q: Array, qdd: Array) -> Array:
        rest = standing(plant, plant.coordinate_type(*jnp.unstack(q)))
        motion = Motion(rest.q, rest.qd, plant.coordinate_type(*jnp.unstack(qdd)))
        return plant.residual(p, motion, states, jnp.zeros_like(states), u)[:n]

    still = jnp.zeros(n)
    stiffness, mass = jax.jacfwd(balance, argnums=(0, 1))(still, still)
    return stiffness, mass
