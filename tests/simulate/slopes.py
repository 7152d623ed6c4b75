"""Slopes of harmonics against differences of harmonics that are solved for."""

from collections.abc import Mapping, Sequence

import numpy as np

from savgs_ident.core.values import as_values
from savgs_ident.plants.base import AbstractPlant
from savgs_ident.simulate.periodic import PeriodicSolution, resolve
from savgs_ident.simulate.readings import harmonics
from savgs_ident.simulate.sensitivity import harmonic_sensitivities


def assert_slopes_are_differences(
    plant: AbstractPlant,
    values: Mapping[str, float],
    solution: PeriodicSolution,
    names: Sequence[str],
    orders: int,
    share: float,
    tolerance: float,
) -> None:
    """Slopes in the named parameters, by central differences over a ``share`` of each, to so much of the largest."""
    slopes = np.asarray(harmonic_sensitivities(plant, as_values(values), solution, tuple(names), orders))
    for name, slope in zip(names, slopes, strict=True):
        step = share * values[name]
        ahead, behind = (as_values({**values, name: values[name] + sign * step}) for sign in (1.0, -1.0))
        two = [np.asarray(harmonics(plant, p, resolve(plant, p, solution), orders)) for p in (ahead, behind)]
        difference = (two[0] - two[1]) / (2.0 * step)
        np.testing.assert_allclose(slope, difference, atol=tolerance * np.abs(difference).max())
