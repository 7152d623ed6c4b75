"""One mode: its poles, its static deflection, and that it carries rail and plate along."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.core.rig import Rig
from savgs_ident.effects.frame_mode import FrameMode
from savgs_ident.model.effect import Load

from .laws import in_the_rig, instant, typical

FRAME = FrameMode()


@pytest.mark.parametrize(("frequency", "ratio"), [(12.0, 0.05), (40.0, 0.3)])
def test_its_poles_and_its_static_deflection_are_those_of_a_mode(frequency: float, ratio: float) -> None:
    """-zeta w +- i w sqrt(1 - zeta^2) and beta F / w^2."""
    p = typical(FRAME, frame_frequency=frequency, frame_damping_ratio=ratio, frame_mobility=2e-3)
    none = jnp.zeros(2)

    def rates(state: jax.Array, force: jax.Array) -> jax.Array:
        return -FRAME.balance(p, Load(force - 3600.0, jnp.asarray(-3600.0)), state, none)

    matrix = np.asarray(jax.jacfwd(rates)(none, jnp.zeros(())))
    omega = 2.0 * np.pi * frequency
    poles = sorted(np.linalg.eigvals(matrix), key=lambda pole: pole.imag)
    turn = omega * np.sqrt(1.0 - ratio**2)
    assert poles == pytest.approx([-ratio * omega - 1j * turn, -ratio * omega + 1j * turn], rel=1e-9)
    bent = np.linalg.solve(matrix, -np.asarray(rates(none, jnp.asarray(500.0))))
    assert bent == pytest.approx([2e-3 * 500.0 / omega**2, 0.0], abs=1e-15)


def test_a_frame_that_is_higher_lifts_plate_and_rail(rig: Rig, numbers: dict[str, float]) -> None:
    """The tyre feels a higher road; the rail's carriages feel the body that much lower."""
    up = 2e-3
    effects = ("rail_coulomb", "frame_mode")
    residual, loads = in_the_rig(rig, numbers, effects, instant(), (0.0, up, 0.0))
    plain = in_the_rig(rig, numbers, ("rail_coulomb",), instant(road=up), (up,))[1]
    assert float(loads.vertical) == pytest.approx(float(plain.vertical), rel=1e-12)
    assert float(loads.ports["rail"].displacement) == -up
    assert float(loads.carried["frame"].total) == -float(loads.vertical) - float(loads.rail)
    assert np.isfinite(residual).all()
