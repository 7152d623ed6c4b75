"""A delay: every frequency late by the same time, none smaller."""

import jax.numpy as jnp
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.effects.deflection_delay import DeflectionDelay

from .laws import typical

DELAY = DeflectionDelay()


@given(delay=st.floats(0.0, 0.2), base=st.floats(0.5, 6.0), seed=st.integers(0, 100))
def test_a_waveform_comes_late_and_unchanged(delay: float, base: float, seed: int) -> None:
    """Any sum of orders, at any instant."""
    rng = np.random.default_rng(seed)
    frequency = base * np.arange(6)
    waves = rng.standard_normal(6) + 1j * rng.standard_normal(6)
    shown = waves * np.asarray(
        DELAY.transfer(typical(DELAY, deflection_delay_time=delay), jnp.asarray(frequency))
    )

    def at(amplitudes: np.ndarray, t: np.ndarray) -> np.ndarray:
        return np.sum(amplitudes * np.exp(2j * np.pi * frequency * t[:, None]), axis=1).real

    t = rng.uniform(0.0, 1.0, 20)
    np.testing.assert_allclose(at(shown, t), at(waves, t - delay), atol=1e-11)
