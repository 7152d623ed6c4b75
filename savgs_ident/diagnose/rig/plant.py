"""The quarter-car rig as a plant: one model that has every effect without states at its null.

An effect without states costs next to nothing at its null, so that one compiled program serves the baseline
and all of them; only an effect with states of its own asks for another. Parameters that are not given are
those of the rig, effects at their null.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.core.free_vector import known_to_tolerance
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.rig import Rig, merge_parameters
from savgs_ident.diagnose.engine.coordinates import Coordinates
from savgs_ident.diagnose.engine.prediction import Prediction, Term
from savgs_ident.diagnose.rig.columns import columns_with_states, rehearse
from savgs_ident.diagnose.rig.coordinates import baseline_coordinate, term_of
from savgs_ident.diagnose.rig.rows import rows_of, slopes_of
from savgs_ident.effects.registry import MODELS
from savgs_ident.fit.problem import used_parameters
from savgs_ident.model.damper import damper_curve
from savgs_ident.model.effect import AbstractEffect, AbstractGrip
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.values import Values, as_values
from savgs_ident.posterior.likelihood import Likelihood
from savgs_ident.simulate.collocation import Trajectory
from savgs_ident.simulate.excitation import Excitation
from savgs_ident.simulate.layout import Layout, layout_for
from savgs_ident.simulate.periodic import (
    PeriodicSettings,
    PeriodicSolution,
    adapt,
    resolve,
    simulate_periodic,
)
from savgs_ident.simulate.stored import placed

WIDTH = 52
"""Directions that are solved for at a time: a program for each number would have to be compiled."""

ITERATIONS = 25
"""Most Newton steps from one point of a search to the next."""


@dataclass(frozen=True)
class RigPlant:
    """The rig, its catalogue and what drives it.

    Attributes:
        rig: the rig as known before the data.
        catalogue: all effects by name.
        baseline: names of those that the baseline has.
        free: names of the parameters that the baseline identifies.
        excitation: road and link of the dwells.
        likelihood: what is compared, as rows.
        shape: tests, channels and orders of the harmonics that the likelihood takes.
        settings: how finely to solve.
        corrections: by terms, what is added to the rows [unit of each], (m,), for the motions that are
            found on finitely many nodes.
    """

    rig: Rig
    catalogue: Mapping[str, AbstractEffect]
    baseline: tuple[str, ...]
    free: tuple[str, ...]
    excitation: Excitation
    likelihood: Likelihood
    shape: tuple[int, int, int]
    settings: PeriodicSettings
    corrections: Mapping[tuple[str, ...], NDArray[np.float64]] = field(default_factory=dict)

    @cached_property
    def layout(self) -> Layout:
        """How nodes share arrays."""
        return layout_for(np.asarray(self.excitation.frequency), self.settings.nodes, self.settings.slow)

    @property
    def orders(self) -> int:
        """Highest order of the harmonics."""
        return self.shape[2] - 1

    @property
    def channel(self) -> NDArray[np.intp]:
        """The channel of each row, an index of RESPONSE_CHANNELS, (m,)."""
        tests, channels, orders = self.shape
        every = np.broadcast_to(np.arange(channels)[None, :, None, None], (tests, channels, orders, 2))
        return np.asarray(every.ravel()[self.likelihood.place])

    @cached_property
    def table(self) -> ParameterTable:
        """All parameters, effects that the baseline does not have at their null."""
        brought = (ParameterTable(effect.parameters) for effect in self.catalogue.values())
        table = merge_parameters(self.rig.parameters, *brought)
        absent = [each for name, each in self.catalogue.items() if name not in self.baseline]
        return table.with_values({name: null for each in absent for name, null in each.null.items()})

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all parameters, sorted."""
        return tuple(sorted(self.table))

    @cached_property
    def nuisances(self) -> Coordinates:
        """The free parameters of the baseline, then those known to a tolerance that matter.

        What is identified and known to a tolerance all the same, as the damping is, is held against it.
        """
        used = used_parameters(self.model(()), self.table)
        known = [name for name in known_to_tolerance(self.table, self.free) if name in used]
        return tuple(baseline_coordinate(self.table[name]) for name in (*self.free, *known))

    @cached_property
    def candidates(self) -> tuple[Term, ...]:
        """All effects that the baseline does not have."""
        terms = [term_of(effect) for name, effect in self.catalogue.items() if name not in self.baseline]
        return tuple(term for term in terms if term.amplitudes)

    @property
    def known(self) -> tuple[tuple[str, ...], ...]:
        """What models of the paper have beyond the baseline, if more than one effect."""
        mine, can = set(self.baseline), {term.name for term in self.candidates}
        beyond = (
            tuple(name for name in each if name not in mine) for each in MODELS.values() if mine < set(each)
        )
        return tuple(each for each in beyond if len(each) > 1 and can >= set(each))

    def model(self, terms: Sequence[str]) -> QuarterCar:
        """The baseline with ``terms``.

        With all effects without states too, at their null, unless a term with states asks for a program of its own
        anyway: then the smaller model is the sooner compiled. The rail's anchor is a state of all models or of none.
        """
        special = [name for name in terms if self.catalogue[name].states and name not in self.baseline]
        wanted = {
            name
            for name, effect in self.catalogue.items()
            if name in self.baseline or (not effect.states and (not special or name in terms))
        }
        grips = [name for name, effect in self.catalogue.items() if isinstance(effect, AbstractGrip)]
        if not wanted.intersection(grips):
            wanted.update(grips[:1])
        model = QuarterCar(damper_curve(self.rig))
        for name, effect in self.catalogue.items():
            if name in wanted:
                model = model + effect
        for name in special:
            model = model + self.catalogue[name]
        return model

    def complete(self, terms: Sequence[str]) -> QuarterCar:
        """The baseline with ``terms`` and all effects without states, those at their null."""
        model = self.model(())
        for name in terms:
            if self.catalogue[name].states and name not in self.baseline:
                model = model + self.catalogue[name]
        return model

    def values(self, given: Mapping[str, float]) -> Values:
        """All parameters, SI, with the given ones."""
        return as_values(self.table.as_dict() | dict(given))

    def start(self, values: Mapping[str, float]) -> PeriodicSolution:
        """Periodic motions of the baseline from a cold start at ``values`` [SI].

        Raises :class:`InputError` if there are none.
        """
        model, p = self.model(()), self.values(values)
        solution = simulate_periodic(model, p, self.excitation, self.settings, self.layout)
        if not all(status.ok for status in solution.status()):
            lost = [
                f"{f:.4g} Hz"
                for f, status in zip(np.asarray(self.excitation.frequency), solution.status(), strict=True)
                if not status.ok
            ]
            raise InputError(
                "the baseline has no periodic motion at " + ", ".join(lost),
                remedy="leave these dwells out with --max-frequency, or mend the rig file",
            )
        return solution

    def rehearse(self) -> None:
        """Have compiled what scores of candidates with states will ask for."""
        with_states = [
            self.catalogue[term.name] for term in self.candidates if self.catalogue[term.name].states
        ]
        rehearse(self.values({}), with_states, self.shape[0])

    def refined(
        self, terms: tuple[str, ...], values: Mapping[str, float], near: PeriodicSolution
    ) -> PeriodicSolution:
        """The same motions on nodes that follow them. ``values`` are in SI."""
        return adapt(self.model(terms), self.values(values), near, near.mesh.layout, self.settings.iterations)

    def predict(
        self, terms: tuple[str, ...], values: Mapping[str, float], names: Sequence[str], near: Any
    ) -> Prediction:
        """Rows with ``terms`` at ``values`` [SI], with slopes in ``names``, on the nodes of ``near``."""
        model, p = self.model(terms), placed(self.values(values))
        solution = resolve(model, p, near, ITERATIONS, self._fitting(model, near))
        rows = np.asarray(rows_of(model, self.likelihood, p, solution, self.orders))
        rows = rows + self.corrections.get(terms, 0.0)
        solved = all(status.ok for status in solution.status())
        return Prediction(rows, self._slopes(model, p, solution, names), solved, solution)

    def corrected(
        self, terms: tuple[str, ...], values: Mapping[str, float], near: PeriodicSolution
    ) -> "RigPlant":
        """The plant with rows as they would be on nodes without end, about ``values`` [SI].

        The rule of the collocation is of second order: four thirds of what twice the nodes change. The plant as it
        is where they do not lead to a motion.
        """
        model, p, layout = self.model(terms), placed(self.values(values)), near.mesh.layout
        doubled = Layout(tuple(2 * count for count in layout.counts))
        coarse = resolve(model, p, near, ITERATIONS)
        fine = adapt(model, p, coarse, doubled, self.settings.iterations)
        if not all(status.ok for each in (coarse, fine) for status in each.status()):
            return self
        less, more = (
            np.asarray(rows_of(model, self.likelihood, p, each, self.orders)) for each in (coarse, fine)
        )
        return replace(self, corrections={**self.corrections, terms: 4.0 / 3.0 * (more - less)})

    def columns(
        self, terms: tuple[str, ...], values: Mapping[str, float], near: Any, candidates: Sequence[Term]
    ) -> list[NDArray[np.float64]]:
        """First-order change of the rows per unit of each candidate's amplitudes, (tries, m, amplitudes)."""
        model = self.complete(terms)
        found: dict[str, list[NDArray[np.float64]]] = {term.name: [] for term in candidates}
        for one in range(max((len(term.tried) for term in candidates), default=0)):
            some = [term for term in candidates if len(term.tried) > one]
            shapes = {name: value for term in some for name, value in term.tried[one].items()}
            p = placed(self.values(dict(values) | shapes))
            for term, columns in self._columns(model, p, near, some).items():
                found[term].append(columns)
        return [np.stack(found[term.name]) for term in candidates]

    def _columns(
        self, model: QuarterCar, p: Values, near: PeriodicSolution, candidates: Sequence[Term]
    ) -> dict[str, NDArray[np.float64]]:
        """The same for the shapes in ``p``, by name, (m, amplitudes)."""
        without = [term for term in candidates if not self.catalogue[term.name].states]
        names = [each.name for term in without for each in term.amplitudes]
        slopes = self._slopes(model, p, near, names)
        found = {
            term.name: slopes[:, [names.index(each.name) for each in term.amplitudes]] for term in without
        }
        with_states = [term for term in candidates if self.catalogue[term.name].states]
        typical = [
            {each.name: each.centre + 0.5 * each.scale for each in term.amplitudes} for term in with_states
        ]
        effects = [self.catalogue[term.name] for term in with_states]
        moved = columns_with_states(model, self.likelihood, self.orders, p, near, effects, typical)
        for term, rows in zip(with_states, moved, strict=True):
            found[term.name] = rows[:, None] / (0.5 * term.amplitudes[0].scale)
        return found

    def _slopes(
        self, model: QuarterCar, p: Values, solution: PeriodicSolution, names: Sequence[str]
    ) -> NDArray[np.float64]:
        """Slopes of the rows in the named parameters, (m, n)."""
        parts = [np.zeros((0, self.likelihood.measured.size))]
        for first in range(0, len(names), WIDTH):
            some = names[first : first + WIDTH]
            directions = np.zeros((WIDTH, len(self.names)))
            directions[np.arange(len(some)), [self.names.index(name) for name in some]] = 1.0
            (slopes,) = slopes_of(
                model, self.likelihood, p, solution, placed(jnp.asarray(directions)), self.names, self.orders
            )
            parts.append(np.asarray(slopes)[: len(some)])
        return np.concatenate(parts).T

    def _fitting(self, model: QuarterCar, near: PeriodicSolution) -> Trajectory:
        """The motions of ``near`` with as many states as ``model`` has, further ones at rest."""
        x, y = near.trajectory
        lacking = 4 + len(model.states) - x.shape[0]
        if lacking == 0:
            return near.trajectory
        if lacking < 0:
            return Trajectory(x[:lacking], y[:lacking])
        rest = jnp.zeros((lacking, x.shape[1]))
        return Trajectory(jnp.concatenate([x, rest]), jnp.concatenate([y, rest]))
