"""A heavier wheel: a point mass at the upright's centre of gravity."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.core.rig import Rig
from savgs_ident.model.kinematics import linkage
from savgs_ident.model.values import Values

from ..model.instants import as_values, draw_instants
from .laws import in_the_rig


@jax.jit
def _slope_and_bend(p: Values, theta: jax.Array) -> tuple[jax.Array, jax.Array]:
    """First and second derivative of the place of the upright's cg in the wishbone's angle."""
    slope = jax.jacfwd(lambda angle: linkage(p, angle).cg_K)
    return slope(theta), jax.jacfwd(slope)(theta)


@pytest.mark.parametrize("seed", range(3))
def test_it_is_a_point_mass_that_the_upright_carries(rig: Rig, numbers: dict[str, float], seed: int) -> None:
    """-dm a . dr/dq with a and r of that point, the weight included."""
    at, change = draw_instants(seed, 1)[0], 8.0
    p = as_values(numbers)

    slope, bend = (np.asarray(each) for each in _slope_and_bend(p, jnp.asarray(at[1])))
    acceleration = slope * at[5] + bend * at[3] ** 2 + np.array([0.0, at[4] + numbers["g"]])
    heavy = in_the_rig(rig, numbers | {"unsprung_mass_change": change}, ("unsprung_mass",), at)[0]
    plain = in_the_rig(rig, numbers, (), at)[0]
    expected = -change * np.array([acceleration[1], acceleration @ slope])
    assert heavy - plain == pytest.approx(expected, rel=1e-8)
