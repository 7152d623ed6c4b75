"""The dwells of the rig's programme, and shorthand for what tests do with solutions."""

from collections.abc import Mapping
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.values import Values, as_values
from savgs_ident.plants.base import AbstractPlant, Excitation
from savgs_ident.plants.quarter_car.inputs import cam_excitation
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.simulate.mesh import Layout
from savgs_ident.simulate.periodic import PeriodicSettings, PeriodicSolution, adapt
from savgs_ident.simulate.readings import harmonics
from savgs_ident.simulate.transient import TransientSolution

STROKE = 0.0275
LINK = np.pi / 2.0
PROGRAMME = np.array(
    [
        0.5, 0.8, 1.1, 1.4, 1.6, 1.75, 1.85, 1.95, 2.0, 2.05, 2.15, 2.25, 2.3, 2.35,
        2.4, 2.45, 2.55, 2.65, 2.75, 2.85, 3.0, 3.25, 3.5, 4.0, 4.5, 5.0, 5.5, 6.0,
    ]
)  # fmt: skip
"""Frequencies of the 28 dwells [Hz]."""

FEW = np.array([0.5, 1.4, 2.35, 6.0])
"""A slow dwell that sticks for long, the one that is hardest to resolve, the resonance, the fastest [Hz]."""


def cam(frequency: NDArray[np.float64]) -> Excitation:
    """The programme's cam and a rigid link."""
    return cam_excitation(frequency, STROKE, LINK)


def altered(values: Values, changes: Mapping[str, float]) -> Values:
    """``values`` with ``changes`` [SI]."""
    return as_values(dict(values) | dict(changes))


def orders(
    model: QuarterCar, p: Values, solution: PeriodicSolution, highest: int = 9
) -> NDArray[np.complex128]:
    """Harmonics 0..``highest``, (D, 2, ``highest`` + 1)."""
    return np.asarray(harmonics(model, p, solution, highest))


def distance(found: NDArray[np.complex128], wanted: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Largest difference of any order but the mean, relative to the first harmonic wanted, (D, 2)."""
    return np.max(np.abs(found - wanted)[..., 1:], axis=-1) / np.abs(wanted[..., 1])


def loads_along(model: AbstractPlant, p: Values, solution: TransientSolution) -> Any:
    """Forces along a motion, as the plant's ``loads`` arranges them, each (n, ...)."""
    loads = jax.jit(jax.vmap(lambda *at: model.loads(p, *at)))
    return loads(solution.motion, solution.s, solution.sd, solution.inputs)


def finer(model: QuarterCar, p: Values, solution: PeriodicSolution, times: int) -> PeriodicSolution:
    """The solution again on ``times`` as many nodes."""
    layout = Layout(tuple(times * count for count in solution.mesh.layout.counts))
    return adapt(model, p, solution, layout, PeriodicSettings.iterations)
