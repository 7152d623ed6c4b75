"""Where a plant stands still: its nominal state, and the rest that it comes to under constant inputs."""

from dataclasses import replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.core.small_root import Root, find_root
from savgs_ident.core.values import Values
from savgs_ident.effects.base import InputSignal
from savgs_ident.plants.base import AbstractPlant, Input, Motion, Scalar, input_size

REST_PRECISION = 1e-9
"""Relative precision of a state of rest; forces of 1e7 N/m leave no more."""


NO_STIFFNESS = 1e-12
"""Stiffness over the largest one of a plant, each for typical motions, that is none [1]: what rounding leaves."""


ALONG = 1e-9
"""Change of what is out of balance in an equation, over that, that is none [1]: what rounding leaves."""


class Rest(NamedTuple):
    """Coordinates and internal states (s,) of a plant that stands still [SI], and how they were found."""

    q: Any
    s: Float[Array, " s"]
    root: Root


def nominal_inputs(plant: AbstractPlant, p: Values) -> Any:
    """The inputs of a plant that stands in its nominal state."""

    def still(each: Input) -> InputSignal:
        zero = jnp.zeros((), jnp.float64)
        return InputSignal(jnp.asarray(p[each.rest]) if each.rest else zero, zero)

    return plant.drive(tuple(still(each) for each in plant.inputs))


def standing(plant: AbstractPlant, q: Any) -> Motion:
    """The motion of a plant that stands still at ``q`` (n scalars)."""
    still = plant.coordinate_type(*(jnp.zeros_like(each) for each in q))
    return Motion(q, still, still)


def find_rest(plant: AbstractPlant, p: Values, u: Any, prepared: Any = None) -> Rest:
    """Where the plant stands still under constant inputs ``u``; look at the status of its root.

    It is the root of the residual without velocities and accelerations. Frictions carry nothing then: their internal
    states are among the unknowns. Differentiable in everything, exactly, by the implicit function theorem.
    """
    n = len(plant.coordinates)

    def residual(x: Array) -> Array:
        motion = standing(plant, plant.coordinate_type(*jnp.unstack(x[:n])))
        return plant.residual(p, motion, x[n:], jnp.zeros_like(x[n:]), u, prepared)

    scale = jnp.asarray([*(each.size for each in plant.coordinates), *(each.scale for each in plant.states)])
    # At rest a velocity among the states has nothing on the diagonal: rows have to be exchanged.
    root = find_root(residual, jnp.zeros_like(scale), scale, REST_PRECISION, jnp.linalg.solve)
    return Rest(plant.coordinate_type(*jnp.unstack(root.x[:n])), root.x[n:], root)


def carried_along(plant: AbstractPlant, p: Values) -> tuple[bool, ...]:
    """For each input, whether the plant moves along with it as a whole, as a car does with the height of its road.

    Nothing is out of balance by more or less then where the input and the coordinates that it ``moves`` are shifted
    together: its mean says nothing.
    """
    bare = replace(plant, effects=(), alternatives=())
    n, count = len(bare.coordinates), len(bare.states)
    # Somewhere in the middle of a motion, where no term vanishes by chance.
    somewhere = np.cos(1.0 + np.arange(3 * n + 2 * count + 2 * len(bare.inputs)))
    sizes = [
        *(each.size for each in bare.coordinates),
        *(each.rate_size for each in bare.coordinates),
        *(each.acceleration_size for each in bare.coordinates),
    ]
    q, qd, qdd = np.split(somewhere[: 3 * n] * sizes, 3)
    scales = np.array([float(state.scale) for state in bare.states])
    s, sd = (jnp.asarray(each * scales) for each in np.split(somewhere[3 * n : 3 * n + 2 * count], 2))
    levels = somewhere[-2 * len(bare.inputs) :]

    def balance(place: int, shift: float) -> NDArray[np.float64]:
        moved = q + shift * np.asarray(bare.inputs[place].moves)
        motion = Motion(*(bare.coordinate_type(*jnp.asarray(each)) for each in (moved, qd, qdd)))
        signals = tuple(
            InputSignal(jnp.asarray(value + shift * (here == place)), jnp.asarray(rate))
            for here, (value, rate) in enumerate(zip(levels[::2], levels[1::2], strict=True))
        )
        return np.asarray(bare.residual(p, motion, s, sd, bare.drive(signals)))

    def along(place: int) -> bool:
        known, shifted = balance(place, 0.0), balance(place, input_size(bare, bare.inputs[place]))
        return bool(np.all(np.abs(shifted - known) <= ALONG * np.abs(known)))

    return tuple(along(place) for place in range(len(bare.inputs)))


def nominal_readings(plant: AbstractPlant, p: Values, prepared: Any = None) -> tuple[Scalar, ...]:
    """What the sensors show where the plant stands in its nominal state: recordings count from there."""
    u = nominal_inputs(plant, p)
    rest = find_rest(plant, p, u, prepared)
    still = jnp.zeros_like(rest.s)
    return plant.read(p, standing(plant, rest.q), rest.s, still, u, prepared)


def unrestrained(plant: AbstractPlant, p: Values) -> tuple[str, ...]:
    """The coordinates of a plant that no force brings back to where it stands in its nominal state.

    A periodic motion may be anywhere along them: it cannot be solved for. What holds a friction moves along.
    """
    u, n = nominal_inputs(plant, p), len(plant.coordinates)
    sizes = (*(each.size for each in plant.coordinates), *(each.scale for each in plant.states))
    size = jnp.asarray(sizes, jnp.float64)

    def balance(x: Array) -> Array:
        q, s = (size * x)[:n], (size * x)[n:]
        motion = standing(plant, plant.coordinate_type(*jnp.unstack(q)))
        return plant.residual(p, motion, s, jnp.zeros_like(s), u)

    stiffness = np.asarray(jax.jacfwd(balance)(jnp.zeros_like(size)))
    if not np.isfinite(stiffness).all():
        return ()
    largest = np.abs(stiffness).max(axis=1, keepdims=True)
    _, strength, directions = np.linalg.svd(stiffness / np.where(largest > 0.0, largest, 1.0))
    free = np.abs(directions[strength <= NO_STIFFNESS, :n]).max(axis=0, initial=0.0)
    return tuple(each.name for each, share in zip(plant.coordinates, free, strict=True) if share > 1e-6)


def require_return(plant: AbstractPlant, p: Values) -> None:
    """Raise :class:`InputError` for a plant that may be anywhere: it has no periodic motions to compare."""
    names = unrestrained(plant, p)
    if names:
        raise InputError(
            f"no force brings {', '.join(names)} back to where it was, and a periodic motion may be anywhere",
            remedy="give the plant the spring or the controller that holds it, or `fit` and `diagnose` a recorded "
            "motion with the force of its drive",
        )
