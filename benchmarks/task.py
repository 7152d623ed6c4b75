"""The work that every method does: the response of SimTR in the dwells of a campaign.

The road is the rig's cam, the link is rigid at its nominal angle, the parameters are those of the rig file.
Asked for are the complex harmonics 0..9 of the sprung mass's acceleration and of the suspension deflection.
How wrong an answer is, is the largest deviation of an order 1..9 in per cent of the first harmonic of its
dwell and channel.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

from savgs_ident.core.values import as_values
from savgs_ident.plants.base import Excitation
from savgs_ident.plants.quarter_car.catalogue import MODELS, build_model, model_parameters
from savgs_ident.plants.quarter_car.dynamics import SectionCurves, section_curves
from savgs_ident.plants.quarter_car.inputs import cam_excitation
from savgs_ident.plants.quarter_car.plant import QuarterCar, static_equilibrium
from savgs_ident.plants.quarter_car.rig import default_rig_path, read_rig

DWELLS_HZ = (
    0.5, 0.8, 1.1, 1.4, 1.6, 1.75, 1.85, 1.95, 2.0, 2.05, 2.15, 2.25, 2.3, 2.35, 2.4, 2.45, 2.55, 2.65, 2.75,
    2.85, 3.0, 3.25, 3.5, 4.0, 4.5, 5.0, 5.5, 6.0,
)  # fmt: skip
"""The dwells of the shipped campaign (data/README.md) [Hz]."""

QUICK_HZ = (0.5, 1.4, 2.35, 4.5)
"""Dwells of the quick run [Hz]: two that stick long, the resonance, one above it."""

ORDERS = 9
"""Highest order of the response that is asked for."""

TOLERANCE_PERCENT = 0.1
"""What counts as the same accuracy."""

PARAMETERS = ("mu_r", "mu_t", "ydot_Hth", "c_sd")
"""Parameters of the gradient: the four that a fit identifies."""

Harmonics = NDArray[np.complex128]
"""Orders 0..9 of both channels in every dwell, (D, 2, 10), SI."""


@dataclass(frozen=True)
class Task:
    """Model, parameter values [SI], dwells [Hz], half the cam's height [m] and link angle [rad].

    ``curves`` and ``rest`` are what every integration may take as given: the tabulated linkage, and the state
    (z_s, theta_LW, their rates, internal states) in which the rig rests on the cam's highest point.
    """

    model: QuarterCar
    values: dict[str, Float[Array, ""]]
    frequency: NDArray[np.float64]
    amplitude: float
    link_angle: float
    curves: SectionCurves
    rest: NDArray[np.float64]

    @property
    def excitation(self) -> Excitation:
        """The dwells as the package takes them."""
        return cam_excitation(self.frequency, 2.0 * self.amplitude, self.link_angle)


def make_task(frequency: tuple[float, ...] = DWELLS_HZ) -> Task:
    """The task at the given dwells [Hz]."""
    rig, effects = read_rig(default_rig_path()), MODELS["simtr"]
    model, values = build_model(rig, effects), as_values(model_parameters(rig, effects).as_dict())
    amplitude, angle = float(values["cam_peak_to_peak"]) / 2.0, float(values["psi_nominal"])
    curves = section_curves(values)
    place = (jnp.asarray(angle), jnp.asarray(amplitude))
    found = jax.jit(lambda: static_equilibrium(model, values, *place, curves))()
    rest = np.concatenate([np.stack(found.q), np.zeros(2), np.asarray(found.s)])
    return Task(model, values, np.asarray(frequency, dtype=np.float64), amplitude, angle, curves, rest)


def errors_percent(response: Harmonics, reference: Harmonics) -> NDArray[np.float64]:
    """The error of each dwell, (D,), as defined above."""
    first = np.abs(reference[..., 1:2])
    errors: NDArray[np.float64] = (np.abs(response - reference)[..., 1:] / first).max(axis=(-2, -1))
    return 100.0 * errors
