"""The rig on which trials are drawn: its model with any effects, and what it answers to the programme.

Effects without states are in every model, those that were not drawn at their null, so that one compiled program
serves nearly all trials; an effect with states of its own asks for another.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.rig import Rig, merge_parameters
from savgs_ident.diagnose.blind.programme import Programme, Sensors
from savgs_ident.effects.registry import CATALOGUE, build_model
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.values import Values, as_values
from savgs_ident.simulate.excitation import Excitation, cam_excitation
from savgs_ident.simulate.harmonics import harmonics
from savgs_ident.simulate.periodic import PeriodicSettings, PeriodicSolution, resolve, simulate_periodic
from savgs_ident.simulate.stored import placed

ORDERS = 9
"""Highest order of the harmonics in which changes are measured."""

ITERATIONS = 40
"""Most Newton steps from a motion that is known to one near it."""


@dataclass(frozen=True)
class Bench:
    """The rig as known beforehand, and what it is put through.

    Attributes:
        rig: the rig's sheet.
        baseline: effects that the model of the diagnosis has.
        free: parameters that the diagnosis identifies in any case.
        programme: the tests.
        sensors: what the sensors add.
        settings: how finely periodic motions are solved.
    """

    rig: Rig
    baseline: tuple[str, ...]
    free: tuple[str, ...]
    programme: Programme = field(default_factory=Programme)
    sensors: Sensors = field(default_factory=Sensors)
    settings: PeriodicSettings = field(default_factory=PeriodicSettings)

    @cached_property
    def table(self) -> ParameterTable:
        """All parameters of rig and catalogue, effects that the baseline does not have at their null."""
        brought = (ParameterTable(effect.parameters) for effect in CATALOGUE.values())
        table = merge_parameters(self.rig.parameters, *brought)
        absent = [each for name, each in CATALOGUE.items() if name not in self.baseline]
        return table.with_values({name: null for each in absent for name, null in each.null.items()})

    @cached_property
    def unknown(self) -> tuple[str, ...]:
        """Parameters of which nothing is known beforehand: identified, and without a tolerance."""
        return tuple(name for name in self.free if self.table[name].tolerance == 0.0)

    @cached_property
    def excitation(self) -> Excitation:
        """The cam in all dwells, and a rigid link."""
        lift, angle = self.table.values_of(("cam_peak_to_peak", "psi_nominal"))
        return cam_excitation(self.programme.dwells, lift, angle)

    def model(self, effects: Sequence[str]) -> QuarterCar:
        """The baseline with ``effects``, and with all that have no states."""
        plain = [name for name, each in CATALOGUE.items() if name in self.baseline or not each.states]
        added = [name for name in CATALOGUE if name in effects and name not in plain]
        return build_model(self.rig, (*plain, *added))

    def values(self, given: Mapping[str, float]) -> Values:
        """All parameters, SI, with the given ones."""
        values: Values = placed(as_values(self.table.as_dict() | dict(given)))
        return values

    def solve(
        self, effects: Sequence[str], given: Mapping[str, float], near: PeriodicSolution | None = None
    ) -> PeriodicSolution | None:
        """Periodic motions in all dwells, from motions of the same effects nearby if there are any.

        None if a dwell has none. ``given`` are parameters in SI.
        """
        model, p = self.model(effects), self.values(given)
        if near is not None:
            solution = resolve(model, p, near, ITERATIONS)
            if all(status.ok for status in solution.status()):
                return solution
        solution = simulate_periodic(model, p, self.excitation, self.settings)
        return solution if all(status.ok for status in solution.status()) else None

    def response(
        self, effects: Sequence[str], given: Mapping[str, float], solution: PeriodicSolution
    ) -> NDArray[np.complex128]:
        """Harmonics 0..ORDERS [unit of the reading] of both response channels, (D, 2, ORDERS + 1)."""
        return np.asarray(harmonics(self.model(effects), self.values(given), solution, ORDERS))


def change_of(there: NDArray[np.complex128], without: NDArray[np.complex128]) -> float:
    """By how much a response differs from the one without an effect, relative; (D, 2, K) each.

    The largest over dwells and channels of two: the complex change of the first harmonic over it, and the rms
    change of the waveform over its rms.
    """
    moved, size = np.abs(there - without)[..., 1:], np.abs(without)[..., 1:]
    first = moved[..., 0] / size[..., 0]
    waveform = np.linalg.norm(moved, axis=-1) / np.linalg.norm(size, axis=-1)
    return float(np.max(np.maximum(first, waveform)))
