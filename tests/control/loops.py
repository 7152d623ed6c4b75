"""What the tests of the closed loop share: one length of test, so that one program serves all, and readings of it."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.control.closed_loop.laws import hold_law, ideal_instruments
from savgs_ident.control.closed_loop.programme import LoopTest, harmonic_test
from savgs_ident.control.closed_loop.run import ClosedLoopRun, Loop, Signals, run_loop
from savgs_ident.core.values import Values, as_values
from savgs_ident.plants.quarter_car.forces import Road
from savgs_ident.plants.quarter_car.inputs import RoadMotion
from savgs_ident.plants.quarter_car.plant import QuarterCar

CAM = 0.0275
"""The cam of the rig, peak to peak [m]."""

LASTS = 8.0
"""End of every test [s]: whole periods of 0.25, 0.5, ... Hz from the fourth second on, and one program for all."""

NO_FRICTION = {"mu_r": 0.0, "mu_t": 0.0, "motor_static_friction": 0.0, "motor_gear_efficiency": 1.0}
"""Numbers that take the friction of rail, tyre, motor and gear away and leave the program as it is."""


def cam(frequency: float, peak_to_peak: float = CAM) -> LoopTest:
    """A steady cam at a multiple of 0.25 Hz."""
    return harmonic_test(peak_to_peak, frequency, LASTS)


def passive(loop: Loop, p: Values) -> Loop:
    """The same with the link held."""
    return loop._replace(law=hold_law(p["psi_nominal"], loop.rate))


def ideal(loop: Loop) -> Loop:
    """The same with ideal instruments."""
    return loop._replace(instruments=ideal_instruments())


def with_changed(p: Values, **changed: float) -> Values:
    """The numbers with some of them changed."""
    return {**p, **as_values(changed)}


def ran(model: QuarterCar, p: Values, test: LoopTest, loop: Loop) -> ClosedLoopRun:
    """A run of a test that ended well."""
    run = run_loop(model, p, test.road, loop, test.duration)
    assert run.status.ok
    return run


def evaluated(signals: Signals, test: LoopTest) -> Signals:
    """What happened while the test was evaluated."""
    inside = (np.asarray(signals.time) >= test.start - 1e-9) & (np.asarray(signals.time) < test.end - 1e-9)
    return Signals(*(np.asarray(each)[inside] for each in signals))


def harmonics_of(
    values: NDArray[np.float64], time: NDArray[np.float64], frequency: float, orders: int
) -> NDArray[np.complex128]:
    """Complex harmonics 0..orders of values over whole periods, x = X_0 + Re sum X_k exp(2 pi i k f t)."""
    turns = np.exp(-2j * np.pi * frequency * np.outer(np.arange(orders + 1), time))
    found = 2.0 * turns @ values / time.size
    found[0] /= 2.0
    return found


@eqx.filter_jit
def _along(road: RoadMotion, times: Array) -> Road:
    return jax.vmap(road.at)(times)


def along(road: RoadMotion, times: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Height [m] and velocity [m/s] of the plate at times [s]."""
    found = _along(road, jnp.asarray(times))
    return np.asarray(found.height), np.asarray(found.velocity)
