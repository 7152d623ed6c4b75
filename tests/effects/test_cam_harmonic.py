"""A cam with a second and a third order, and no other."""

import jax.numpy as jnp
import numpy as np

from savgs_ident.effects.cam_harmonic import CamHarmonic
from savgs_ident.model.effect import Cam
from savgs_ident.model.tyre import Road

from .laws import typical

CAM = CamHarmonic()
P = typical(CAM, cam_cos_2=3e-4, cam_sin_2=-1e-4, cam_cos_3=-2e-4, cam_sin_3=5e-5)
NODES = 32
ANGLE = 2.0 * np.pi * np.arange(NODES) / NODES
SPEED = 2.0 * np.pi * 2.35


def _turned() -> Road:
    still = jnp.zeros(NODES)
    return CAM.shift(P, Road(still, still), Cam(jnp.asarray(ANGLE), jnp.full(NODES, SPEED)))


def test_its_orders_have_the_amplitudes_that_its_parameters_say() -> None:
    """a_n - i b_n where the first order is a cosine; so its phase to the cam is fixed, whatever the frequency."""
    orders = 2.0 * np.fft.rfft(np.asarray(_turned().height)) / NODES
    expected = np.zeros(NODES // 2 + 1, complex)
    expected[2], expected[3] = 3e-4 + 1e-4j, -2e-4 - 5e-5j
    np.testing.assert_allclose(orders, expected, atol=1e-18)


def test_its_velocity_is_the_derivative_of_its_height() -> None:
    road = _turned()
    orders = np.fft.rfft(np.asarray(road.height)) * 1j * np.arange(NODES // 2 + 1) * SPEED
    np.testing.assert_allclose(np.asarray(road.velocity), np.fft.irfft(orders, NODES), atol=1e-14)


def test_a_cam_that_stands_does_not_move_the_plate() -> None:
    still = jnp.zeros(NODES)
    assert not np.any(np.asarray(CAM.shift(P, Road(still, still), Cam(jnp.asarray(ANGLE), still)).velocity))
