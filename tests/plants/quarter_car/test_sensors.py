"""What the instruments show: gains, and dynamics of sensors against responses known in closed form."""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import AbstractSensorLaw, Family, Port, Role
from savgs_ident.effects.effect import effect_at
from savgs_ident.plants.quarter_car.plant import QuarterCar, Readings, read_sensors
from savgs_ident.plants.quarter_car.ports import ACCEL
from savgs_ident.simulate.transient import through_sensors

from .instants import as_values

LAG = 0.02
RATE = 2000.0
FREQUENCY = np.array([0.0, 0.7, 3.0, 40.0])


def _lag(frequency: Array, time: float) -> Array:
    """Reading over truth of a first-order lag [s]."""
    return jnp.reciprocal(jax.lax.complex(jnp.ones_like(frequency), 2.0 * jnp.pi * frequency * time))


class _GainAndLag(AbstractSensorLaw):
    """A gain and a first-order lag."""

    name: ClassVar[str] = "gain_and_lag"
    family: ClassVar[Family] = Family.DYNAMICS
    roles: ClassVar[tuple[Role, ...]] = ()
    gain: float = eqx.field(static=True)
    lag: float = eqx.field(static=True)

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        return {}

    def transfer(self, v: Values, frequency: Array) -> Array:
        return self.gain * _lag(frequency, self.lag)


def _lagging(times: NDArray[np.float64], omega: float) -> NDArray[np.float64]:
    """Response of a first-order lag to sin(omega t) that begins at t = 0."""
    inertia = omega * LAG
    decay = np.exp(-np.maximum(times, 0.0) / LAG)
    steady = np.sin(omega * times) - inertia * np.cos(omega * times)
    return np.where(times > 0.0, (steady + inertia * decay) / (1.0 + inertia**2), 0.0)


def _shown(times: NDArray[np.float64], *seen: NDArray[np.float64]) -> Readings:
    """Through a lag in the acceleration and a delay of 5 ms with a gain in the deflection."""

    def transfer(frequency: Array) -> Array:
        phase = -2.0 * jnp.pi * frequency * 5e-3
        delay = 0.9 * jax.lax.complex(jnp.cos(phase), jnp.sin(phase))
        return jnp.stack([_lag(frequency, LAG), delay])

    return Readings(*through_sensors(transfer, jnp.asarray(times), jnp.stack([jnp.asarray(s) for s in seen])))


@pytest.mark.parametrize("seconds", [1.0, 1.1])
def test_a_lag_is_the_exact_one(seconds: float) -> None:
    """From rest, in a record of an odd and an even number of instants, up to its very end."""
    times = np.arange(round(seconds * RATE) + 1) / RATE - 0.2
    omega = 2.0 * np.pi * 3.0
    wave = np.where(times > 0.0, np.sin(omega * times), 0.0)
    error = np.asarray(_shown(times, wave, wave).sprung_accel) - _lagging(times, omega)
    assert np.max(np.abs(error)) < 2e-4
    coarse = np.asarray(_shown(times[::4], wave[::4], wave[::4]).sprung_accel)
    # What the kink in the wave and the finite rate cost falls with the square of the rate.
    assert np.max(np.abs(coarse - _lagging(times[::4], omega))) > 8.0 * np.max(np.abs(error))


def test_a_delay_is_a_shift() -> None:
    """Of a pulse that is nought at both ends."""
    times = np.arange(2001) / RATE
    pulse = np.exp(-(((times - 0.5) / 0.05) ** 2))
    late = np.exp(-(((times - 0.505) / 0.05) ** 2))
    np.testing.assert_allclose(_shown(times, pulse, pulse).susp_deflection, 0.9 * late, atol=1e-12)


@pytest.mark.parametrize("count", [1, 2, 7])
def test_what_stands_still_is_shown_with_the_gain_alone(count: int) -> None:
    """However short the record is: before and after it the truth was what it is at its ends."""
    times, still = np.arange(count) / RATE, np.full(count, -3.7)
    shown = _shown(times, still, still)
    np.testing.assert_allclose(shown.sprung_accel, still, atol=1e-13)
    np.testing.assert_allclose(shown.susp_deflection, 0.9 * still, atol=1e-13)


def test_faults_of_a_channel_multiply_and_leave_the_other_alone(simqc: QuarterCar) -> None:
    model = simqc + effect_at("slow", ACCEL, _GainAndLag(1.0, LAG), {})
    model = model + effect_at("weak", ACCEL, _GainAndLag(0.8, 0.0), {})
    found = np.asarray(model.transfers({}, jnp.asarray(FREQUENCY)))
    np.testing.assert_allclose(found[0], 0.8 / (1.0 + 2j * np.pi * FREQUENCY * LAG), rtol=1e-14)
    assert np.array_equal(found[1], np.ones(4))
    assert model.sensors_have_dynamics
    assert not simqc.sensors_have_dynamics
    grid = jnp.asarray(FREQUENCY.reshape(2, 2))
    assert np.array_equal(np.asarray(model.transfers({}, grid)), found.reshape(2, 2, 2))


def test_sensors_show_acceleration_and_deflection_times_their_gains(numbers: dict[str, float]) -> None:
    p = as_values(numbers | {"accel_gain": 1.02, "deflection_gain": 0.98})
    angle, acceleration = np.float64(0.03), np.float64(-2.5)
    read = jax.jit(read_sensors)
    true, seen = read(as_values(numbers), angle, acceleration), read(p, angle, acceleration)
    assert float(true.sprung_accel) == -2.5
    assert float(true.susp_deflection) == pytest.approx(0.03 * 0.37, rel=0.01)
    assert float(seen.sprung_accel) == pytest.approx(-2.5 * 1.02, rel=1e-15)
    assert float(seen.susp_deflection) == pytest.approx(0.98 * float(true.susp_deflection), rel=1e-15)
    rest = read(as_values(numbers), np.float64(0.0), np.float64(0.0))
    assert float(rest.susp_deflection) == pytest.approx(0.0, abs=1e-15)
