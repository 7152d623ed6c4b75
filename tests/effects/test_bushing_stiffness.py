"""A spring along the suspension's travel, unstrained as drawn."""

import jax
import jax.numpy as jnp
import pytest
from jaxtyping import Array

from savgs_ident.core.rig import Rig
from savgs_ident.model.kinematics import suspension_travel
from savgs_ident.model.values import Values

from ..model.instants import as_values
from .laws import in_the_rig, instant


@jax.jit
@jax.grad
def _slope_of_energy(angle: Array, p: Values) -> Array:
    """Slope of the energy in the wishbone's angle [N m]."""
    return 0.5 * p["bushing_stiffness"] * suspension_travel(p, angle) ** 2


@pytest.mark.parametrize("theta", [-0.12, 0.0, 0.08])
def test_the_wishbone_feels_the_slope_of_its_energy(
    rig: Rig, numbers: dict[str, float], theta: float
) -> None:
    """d/dtheta of k l_s^2 / 2, and nothing on the body: the spring is between the two."""
    at = instant(theta=theta, thetad=0.4)
    with_it, _ = in_the_rig(rig, numbers, ("bushing_stiffness",), at)
    without, _ = in_the_rig(rig, numbers, (), at)
    assert with_it[0] == without[0]
    expected = -float(_slope_of_energy(jnp.asarray(theta), as_values(numbers)))
    assert with_it[1] - without[1] == pytest.approx(expected, rel=1e-9, abs=1e-9)
