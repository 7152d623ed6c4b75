"""Stability margins of a loop broken at the controller's command, and of one controller on many rigs."""

from collections.abc import Iterable
from dataclasses import dataclass

import control
import numpy as np
from numpy.typing import NDArray

from savgs_ident.control.generalised_plant import design_loop, generalised_plant
from savgs_ident.control.linear_equivalent import TwoMasses, quarter_car_space
from savgs_ident.core.parameter import ParameterTable

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
