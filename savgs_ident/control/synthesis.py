"""H-infinity synthesis, and the check of what it promises.

The least gamma is found first, by bisection with every step verified on the loop that it closes; the controller is
the central one at a gamma 2 % above it. At the least gamma itself
the Riccati equations are as good as singular and poles of the controller run off, which no computer follows.
The check is independent of the synthesis: the largest singular value of the closed loop over frequency, refined
around its peaks, may not pass gamma.
"""

from dataclasses import dataclass

import control
import numpy as np
import slycot
from numpy.typing import NDArray
from scipy.linalg import matrix_balance
from scipy.optimize import minimize_scalar
from slycot.exceptions import SlycotError

from savgs_ident.control.generalised_plant import COMMAND, MEASUREMENTS
from savgs_ident.core.errors import InputError

SLACK = 1.02
"""Gamma of the controller over the least one."""

LOWER, UPPER = 1e-3, 1e4
"""Where the least gamma is looked for [1]."""

PRECISION = 1e-3
"""Relative precision of the least gamma."""

HELD = 1e-6
"""By how much, relatively, rounding may carry a closed loop beyond its gamma."""

GRID = np.logspace(-4.0, 4.0, 2001)
"""Frequencies at which closed loops are examined [Hz]."""


@dataclass(frozen=True)
class Synthesis:
    """A controller and how good it is.

    Attributes:
        controller: continuous, from :data:`MEASUREMENTS` to :data:`COMMAND`.
        gamma: bound that it was made for [1].
        gamma_least: the least bound that any controller reaches [1].
        closed: the closed loop from disturbances to penalties.
        peak: the largest singular value of the closed loop [1], found by sweeping the frequency.
        peak_frequency: where [Hz].
    """

    controller: control.StateSpace
    gamma: float
    gamma_least: float
    closed: control.StateSpace
    peak: float
    peak_frequency: float

    @property
    def holds(self) -> bool:
        """Whether the closed loop is stable and the sweep confirms gamma."""
        stable = bool(np.all(self.closed.poles().real < 0.0))
        return stable and self.peak <= self.gamma * (1.0 + HELD)


def synthesise_hinf(plant: control.StateSpace) -> Synthesis:
    """The H-infinity controller of a generalised plant with three measurements and one command.

    Raises :class:`InputError` if the plant admits none: a weight that leaves D12 or D21 without full rank, or an
    integrator that no disturbance reaches.
    """
    most = UPPER
    best = _controller(plant, most)
    if best is None:
        raise InputError(
            f"no controller reaches gamma = {most:g} with these weights",
            remedy="give every measurement noise and every weight a bound; larger bounds ask for less",
        )
    least = LOWER
    while most / least > 1.0 + PRECISION:
        middle = float(np.sqrt(most * least))
        most, least = (middle, least) if _controller(plant, middle) is not None else (most, middle)
    gamma = SLACK * most
    controller = _controller(plant, gamma)
    if controller is None:
        raise InputError(
            f"the Riccati equations cannot be solved at gamma = {gamma:.4g}",
            remedy="bring the bounds of the weights nearer to the sizes of the signals",
        )
    closed = plant.lft(controller)
    peak, at = largest_gain(closed)
    return Synthesis(controller, gamma, most, closed, peak, at)


def _controller(plant: control.StateSpace, gamma: float) -> control.StateSpace | None:
    """The central controller for ``gamma``; None if there is none, or the loop that it closes does not hold it.

    Signals are taken in the units in which D12 and D21 have size one, and the states are balanced: with noises of
    0.1 mm beside weights of 50 s/m the equations would lose half of their digits.
    """
    seen, penalties = len(MEASUREMENTS), plant.noutputs - len(MEASUREMENTS)
    noise = np.linalg.norm(plant.D[penalties:, :-1], axis=1)
    weight = np.linalg.norm(plant.D[:penalties, -1])
    if not (np.all(noise > 0.0) and weight > 0.0):
        return None
    balanced, (states, _) = matrix_balance(plant.A, permute=False, separate=True)
    rows = np.concatenate([np.ones(penalties), 1.0 / noise])
    columns = np.append(np.ones(plant.ninputs - 1), 1.0 / weight)
    b = plant.B / states[:, None] * columns
    c = plant.C * states * rows[:, None]
    d = plant.D * rows[:, None] * columns
    try:
        a_k, b_k, c_k, d_k, _ = slycot.sb10fd(
            plant.nstates, plant.ninputs, plant.noutputs, 1, seen, gamma, balanced, b, c, d
        )
    except SlycotError:
        return None
    found = control.ss(
        a_k,
        b_k / noise,
        c_k / weight,
        d_k / noise / weight,
        inputs=MEASUREMENTS,
        outputs=[COMMAND],
        name="controller",
    )
    closed = plant.lft(found)
    stable = bool(np.all(closed.poles().real < 0.0))
    return found if stable and control.linfnorm(closed)[0] <= gamma * (1.0 + HELD) else None


def largest_gain(system: control.StateSpace) -> tuple[float, float]:
    """Largest singular value over frequency, and the frequency [Hz] of it: a fine sweep, then its highest peaks."""

    def gain(log_frequency: float) -> float:
        value = np.atleast_2d(system(2j * np.pi * 10.0**log_frequency, squeeze=False))
        return float(np.linalg.norm(value, 2))

    logs = np.log10(GRID)
    swept = singular_values(system, GRID)[:, 0]
    best, at = float(swept.max()), float(GRID[swept.argmax()])
    for place in np.argsort(swept)[-3:]:
        low, high = logs[max(place - 1, 0)], logs[min(place + 1, logs.size - 1)]
        found = minimize_scalar(
            lambda log: -gain(log), bounds=(low, high), method="bounded", options={"xatol": 1e-9}
        )
        if -found.fun > best:
            best, at = -float(found.fun), 10.0 ** float(found.x)
    return best, at


def singular_values(system: control.StateSpace, frequency: NDArray[np.float64]) -> NDArray[np.float64]:
    """Singular values (F, min(outputs, inputs)) at frequencies [Hz], the largest first."""
    response = np.moveaxis(system(2j * np.pi * frequency, squeeze=False), -1, 0)
    return np.linalg.svd(response, compute_uv=False)
