"""From a generalised plant to a controller that a computer runs: synthesis, its check, sampling, stability margins.

The least gamma is found by bisection, every step verified on the loop that it closes; the controller is the central
one at a gamma 2 % above the least. At the least gamma itself the Riccati equations are nearly singular and poles of
the controller diverge, which no computer could follow. The check is independent of the synthesis: the largest
singular value of the closed loop over frequency, refined around its peaks, must not exceed gamma.

For the computer the controller is discretised, its command is held, and its order is reduced where that is asked for.
The margins are those of the loop broken at the controller's command: on one rig, and of one controller on many rigs.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import control
import numpy as np
import slycot
from numpy.typing import NDArray
from scipy.linalg import matrix_balance
from scipy.optimize import minimize_scalar
from slycot.exceptions import SlycotError

from savgs_ident.control.generalised_plant import COMMAND, MEASUREMENTS, design_loop, generalised_plant
from savgs_ident.control.linear_equivalent import TwoMasses, quarter_car_space
from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import ParameterTable

SLACK = 1.02
"""Gamma of the controller over the least one."""
LOWER, UPPER = 1e-3, 1e4
"""Search range of the least gamma [1]."""
PRECISION = 1e-3
"""Relative precision of the least gamma."""
GAMMA_TOLERANCE = 1e-6
"""Relative tolerance of the bound gamma for rounding [1]."""
GRID = np.logspace(-4.0, 4.0, 2001)
"""Frequencies at which closed loops are examined [Hz]."""


@dataclass(frozen=True)
class Synthesis:
    """A controller with the bound it reaches.

    Attributes:
        controller: continuous, from :data:`MEASUREMENTS` to :data:`COMMAND`.
        gamma: bound of the synthesis [1].
        gamma_least: the least bound of any controller [1].
        closed: the closed loop from disturbances to penalties.
        peak: the largest singular value of the closed loop [1], found by sweeping the frequency.
        peak_frequency: its frequency [Hz].
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
        return stable and self.peak <= self.gamma * (1.0 + GAMMA_TOLERANCE)


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
    """The central controller for ``gamma``; None if there is none, or the closed loop exceeds ``gamma``.

    Signals are scaled so that D12 and D21 have size one, and the states are balanced: with noises of 0.1 mm beside
    weights of 50 s/m the equations would lose half of their digits.
    """
    measured, penalties = len(MEASUREMENTS), plant.noutputs - len(MEASUREMENTS)
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
            plant.nstates, plant.ninputs, plant.noutputs, 1, measured, gamma, balanced, b, c, d
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
    return found if stable and control.linfnorm(closed)[0] <= gamma * (1.0 + GAMMA_TOLERANCE) else None


def largest_gain(system: control.StateSpace) -> tuple[float, float]:
    """Largest singular value over frequency, and its frequency [Hz]: a fine sweep, refined at the highest peaks."""

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


RATE = 1000.0
"""Default rate of the controller [1/s]."""


def discretise(controller: control.StateSpace, rate: float = RATE) -> control.StateSpace:
    """The controller by the bilinear rule at ``rate`` [1/s]; it keeps stability and maps zero frequency exactly."""
    sampled = control.sample_system(controller, 1.0 / rate, method="bilinear")
    return control.ss(
        sampled.A,
        sampled.B,
        sampled.C,
        sampled.D,
        1.0 / rate,
        inputs=controller.input_labels,
        outputs=controller.output_labels,
        name=controller.name,
    )


def sampled_plant(plant: control.StateSpace, rate: float) -> control.StateSpace:
    """The plant of a computer of ``rate`` [1/s]: its command is held, and acts one sample after the measurement."""
    held = control.sample_system(plant, 1.0 / rate, method="zoh")
    delay = control.ss(0.0, 1.0, 1.0, 0.0, 1.0 / rate)
    found = held * delay
    found.update_names(inputs=held.input_labels, outputs=held.output_labels)
    return found


def reduce_order(controller: control.StateSpace, order: int) -> control.StateSpace:
    """The controller with ``order`` states, by balanced truncation with its static gain kept.

    Raises :class:`InputError` if ``order`` is not between 1 and the present order, or the controller is unstable.
    """
    if not 1 <= order <= controller.nstates:
        raise InputError(
            f"a controller of order {controller.nstates} cannot be reduced to {order}",
            remedy=f"choose an order between 1 and {controller.nstates}",
        )
    if np.any(controller.poles().real >= 0.0):
        raise InputError("the controller itself is unstable and cannot be reduced", remedy="keep its order")
    reduced = control.balred(controller, order, method="matchdc")
    return control.ss(
        reduced.A,
        reduced.B,
        reduced.C,
        reduced.D,
        inputs=controller.input_labels,
        outputs=controller.output_labels,
        name=controller.name,
    )


LOWEST, HIGHEST = 1e-3, 1e3
"""Frequencies between which loops are examined [Hz]."""
NO_GAIN = 1e-6
"""RideGain factors below this are rounding: a loop that is zero at zero frequency has no lower gain margin."""
POINTS = 1500
"""Number of frequencies."""


@dataclass(frozen=True)
class Margins:
    """Margins of a loop that is broken at its command.

    Attributes:
        stable: whether the closed loop is stable.
        gain_up: least factor above one of the loop's gain that makes it unstable [1]; infinite if none does.
        gain_down: greatest factor below one that does [1]; 0 if none does.
        phase_deg: least phase shift that does [deg].
        delay: least additional delay that does [s].
        sensitivity: peak of the sensitivity 1/(1 + L) [1]: one over the least distance of L to -1.
    """

    stable: bool
    gain_up: float
    gain_down: float
    phase_deg: float
    delay: float
    sensitivity: float


def open_loop(plant: control.StateSpace, controller: control.StateSpace) -> control.StateSpace:
    """The open loop L, with the sign for which 1 + L is the return difference."""
    return -controller * plant


def sensitivity(loop: control.StateSpace, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
    """The sensitivity 1/(1 + L) [1] at frequencies [Hz], (F,); the result has the same shape."""
    return np.asarray(1.0 / (1.0 + np.ravel(loop(2j * np.pi * frequency))))


def compute_margins(plant: control.StateSpace, controller: control.StateSpace) -> Margins:
    """The margins of a controller with its plant, from command to measurements."""
    loop = open_loop(plant, controller)
    poles = control.feedback(loop, 1.0).poles()
    stable = bool(np.all(np.abs(poles) < 1.0 if loop.isdtime(strict=True) else poles.real < 0.0))
    # On a fine grid, for sampled loops up to half the rate: polynomials of order twenty would lose precision.
    highest = np.pi / loop.dt if loop.isdtime(strict=True) else 2.0 * np.pi * HIGHEST
    swept = control.frd(loop, np.geomspace(2.0 * np.pi * LOWEST, highest, POINTS), smooth=True)
    gains, phases, distances, w_gain, w_phase, _ = control.stability_margins(swept, returnall=True)
    ends = _ends(loop)
    crossed = np.asarray(gains)[np.asarray(w_gain) > 0.0]
    gains = np.concatenate([crossed[crossed > NO_GAIN], -1.0 / ends[ends < 0.0]])
    away = np.abs((np.asarray(phases) + 180.0) % 360.0 - 180.0)
    # A phase lead of x deg is a lag of 360 - x deg.
    lags = np.where(np.asarray(phases) > 0.0, phases, np.asarray(phases) + 360.0)
    delays = np.radians(lags) / np.asarray(w_phase)
    nearest = np.concatenate([np.ravel(distances), np.abs(1.0 + np.ravel(swept.complex)), np.abs(1.0 + ends)])
    return Margins(
        stable,
        float(np.min(gains[gains > 1.0], initial=np.inf)),
        float(np.max(gains[gains < 1.0], initial=0.0)),
        float(np.min(away, initial=180.0)),
        float(np.min(delays, initial=np.inf)),
        float(1.0 / np.min(nearest)),
    )


def _ends(loop: control.StateSpace) -> NDArray[np.float64]:
    """The finite real values of the loop: at zero frequency, and at infinite frequency or half the rate."""
    sampled = loop.isdtime(strict=True)
    lowest = loop(1.0 if sampled else 0.0, warn_infinite=False)
    values = np.array([lowest, loop(-1.0, warn_infinite=False) if sampled else loop.D[0, 0]])
    return values.real[np.isfinite(values)]


@dataclass(frozen=True)
class Robustness:
    """Margins and peak gain of a controller on every rig of a set.

    Attributes:
        margins: of every rig, in order.
        peaks: largest singular value of every closed loop [1]; infinite where it is unstable.
    """

    margins: tuple[Margins, ...]
    peaks: tuple[float, ...]

    @property
    def stable(self) -> bool:
        """Whether every loop is stable."""
        return all(each.stable for each in self.margins)

    @property
    def worst(self) -> int:
        """The rig with the largest peak."""
        return int(np.argmax(self.peaks))


def assess_robustness(
    controller: control.StateSpace, rigs: Iterable[TwoMasses], bandwidth: float, weights: ParameterTable
) -> Robustness:
    """A continuous controller on rigs, with the weights of its design; ``bandwidth`` [Hz] of the actuator."""
    margins, peaks = [], []
    for rig in rigs:
        space = quarter_car_space(rig)
        found = compute_margins(design_loop(space, bandwidth), controller)
        closed = generalised_plant(space, bandwidth, weights).lft(controller)
        margins.append(found)
        peaks.append(float(control.linfnorm(closed)[0]) if found.stable else float("inf"))
    return Robustness(tuple(margins), tuple(peaks))
