"""The problem of a diagnosis on dwells, and on roads: a plant, what may be missing in it, what drives it.

Tests that do not repeat stand beside the dwells as windows (:mod:`savgs_ident.responses.windows`). These have no
cycle, no harmonics and no frequency: what is said by those is said of the dwells, and nothing where there are none.

A problem is made of a response, and so are the data:

    problem, data = dwell_problem(measured, TwoMass(), PARAMETERS, generic_effects(TwoMass.ports), free=("k", "c"))
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.status import joint_status
from savgs_ident.core.threads import side_by_side
from savgs_ident.core.values import Values
from savgs_ident.diagnosis.effect_sensitivities import alike_tests, rehearse, secants_of_terms
from savgs_ident.diagnosis.gap import CyclePosition, MapCell, cycle_positions, gap_map
from savgs_ident.diagnosis.localisation import Localisation
from savgs_ident.diagnosis.loops import force_loops
from savgs_ident.diagnosis.next_test import next_tests
from savgs_ident.diagnosis.problem import AbstractProblem, DrawnLaw, largest_with_margin, spans_of_force
from savgs_ident.diagnosis.regimes import dwell_cycles, find_regimes
from savgs_ident.diagnosis.result import ForceLoop, NextTest, Regime, Responses
from savgs_ident.diagnosis.shared_programs import SharedPrograms
from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.effects.base import Port, PortKind, PortSignals
from savgs_ident.effects.effect import Effect
from savgs_ident.inference.background.imposed import node_loads, rows_of, slopes_in
from savgs_ident.inference.background.locations import Linearisation, input_locations
from savgs_ident.inference.background.port_functions import InputLocation
from savgs_ident.inference.background.shared_errors import background_about, without_drifts
from savgs_ident.inference.initial_states import FreeInitialStates
from savgs_ident.inference.laplace_fit import LaplaceFit, Search
from savgs_ident.inference.likelihood import Likelihood, likelihood_of
from savgs_ident.inference.likely_mistake import likely_mistake
from savgs_ident.inference.observations import Data, Prediction, Term
from savgs_ident.inference.targets import harmonic_target
from savgs_ident.plants.at_rest import require_return
from savgs_ident.plants.base import AbstractPlant, Excitation
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.excitation import measured_excitation
from savgs_ident.simulate.held_states import ITERATIONS, resolve_with_states, with_states_of
from savgs_ident.simulate.mesh import Layout
from savgs_ident.simulate.periodic import (
    PeriodicSettings,
    PeriodicSolution,
    adapt,
    blank_solution,
    layout_of,
    resolve,
    simulate_periodic,
)
from savgs_ident.simulate.program_cache import done_once, placed


@dataclass(frozen=True)
class DwellProblem(AbstractProblem):
    """A plant in dwells, and in windows of tests that do not repeat.

    Attributes:
        excitation: the plant's inputs in the tests.
        likelihood: what is compared, as rows.
        shape: tests, channels and orders of the harmonics that the likelihood takes.
        settings: how finely to solve.
        corrections: by terms, what is added to the rows [unit of each], (m,), for the motions that are
            found on finitely many nodes.
        recorded: when each test was recorded, in any unit of time; the tests are in that order where empty.
        beyond: what drifts do to all rows beyond first order [unit of each], (m,); None where nothing drifts.
        beside: what else was recorded in each test [its unit], (D,) by name; NaN where it was not.
        initial_states: the states with which tests begin that do not begin at rest; None where all do.
    """

    excitation: Excitation = field(kw_only=True)
    likelihood: Likelihood = field(kw_only=True)
    shape: tuple[int, int, int] = field(kw_only=True)
    settings: PeriodicSettings = field(kw_only=True)
    corrections: Mapping[tuple[str, ...], NDArray[np.float64]] = field(default_factory=dict, kw_only=True)
    recorded: tuple[float, ...] = field(default=(), kw_only=True)
    beyond: NDArray[np.float64] | None = field(default=None, kw_only=True)
    beside: Mapping[str, NDArray[np.float64]] = field(default_factory=dict, kw_only=True)
    initial_states: FreeInitialStates | None = field(default=None, kw_only=True)

    @cached_property
    def layout(self) -> Layout:
        """How nodes share arrays."""
        return layout_of(self.excitation, self.settings, self.model(()))

    @cached_property
    def dwells(self) -> NDArray[np.intp]:
        """Places of the tests that repeat."""
        return np.setdiff1d(np.arange(self.shape[0]), self.excitation.windows)

    @property
    def orders(self) -> int:
        """Highest order of the harmonics."""
        return self.shape[2] - 1

    def seeing(self, rows: NDArray[np.float64]) -> "DwellProblem":
        """The same where other rows (m,) were measured [unit of each]: its tests begin as these say."""
        if self.initial_states is None:
            return self
        measured = self.likelihood.harmonics(rows[None], self.shape)[0]
        return replace(self, initial_states=self.initial_states.seeing(measured))

    @property
    def channel(self) -> NDArray[np.intp]:
        """The channel of each row, an index of the plant's channels, (m,)."""
        return self.likelihood.channel

    def start(self, values: Mapping[str, float]) -> PeriodicSolution:
        """Periodic motions of the baseline from a cold start at ``values`` [SI].

        Raises :class:`InputError` if there are none.
        """
        model, p = self.model(()), placed(self.values(values))
        self._have_compiled(model, p)
        solution = simulate_periodic(model, p, self.excitation, self.settings, self.layout)
        lost = [d for d, each in enumerate(solution.status()) if not each.ok]
        dwells = [f"{float(self.excitation.frequency[d]):.4g} Hz" for d in lost if d in self.dwells]
        if dwells:
            require_return(model, p)
            raise InputError(
                "the baseline has no periodic motion at " + ", ".join(dwells),
                remedy="leave these dwells out with --max-frequency, or mend the parameters",
            )
        if lost:
            raise InputError(
                f"the baseline has no motion in {len(lost)} of the windows of tests that do not repeat",
                remedy="mend the parameters, or leave these tests out",
            )
        return solution

    def rehearse(self) -> None:
        """Have compiled what scores of candidates with states will ask for."""
        with_states = [
            self.catalogue[term.name] for term in self.candidates if self.catalogue[term.name].states
        ]
        rehearse(self.values({}), with_states, alike_tests(self.layout, self.excitation.windows))

    def refined(
        self, terms: tuple[str, ...], values: Mapping[str, float], warm_start: PeriodicSolution
    ) -> PeriodicSolution:
        """The same motions on nodes that follow them. ``values`` are in SI."""
        model, p = self._model_with(terms, values)
        return adapt(model, p, warm_start, warm_start.mesh.layout, self.settings.iterations)

    def predict(
        self, terms: tuple[str, ...], values: Mapping[str, float], names: Sequence[str], warm_start: Any
    ) -> Prediction:
        """Rows with ``terms`` at ``values`` [SI], with slopes in ``names``, on the nodes of ``warm_start``."""
        model, p, solution = self.motions_with(terms, values, warm_start)
        rows = np.asarray(rows_of(model, self.likelihood, p, solution, self.orders))
        rows = rows + self.corrections.get(terms, 0.0) + (0.0 if self.beyond is None else self.beyond)
        status = joint_status(solution.status())
        slopes = partial(self.slopes, model, p, solution, self._shared.names(terms, names))
        return Prediction(rows, slopes, status, solution)

    def motions_with(
        self, terms: tuple[str, ...], values: Mapping[str, float], known: PeriodicSolution
    ) -> tuple[AbstractPlant, Values, PeriodicSolution]:
        """The model with ``terms`` at ``values`` [SI], its parameters, and its motions from those ``known``.

        Under their excitation, on their nodes, in tests that do not begin at rest from where they miss least; look at
        ``status()`` of the motions.
        """
        model, p = self._model_with(terms, values)
        self._have_compiled(model, p)
        found = resolve_with_states(model, p, known, partial(self._signals_along, p=p))
        if (
            self.initial_states is not None
            and found.excitation.moving.size
            and joint_status(found.status()).ok
        ):
            found = self.initial_states.best(model, p, found)
        return model, p, found

    def corrected(
        self, terms: tuple[str, ...], values: Mapping[str, float], warm_start: PeriodicSolution
    ) -> "DwellProblem | None":
        """The problem with rows as they would be on nodes without end, about ``values`` [SI].

        The rule of the collocation is of second order: four thirds of what twice the nodes change. None where they do
        not lead to a motion.
        """
        (model, p), layout = self._model_with(terms, values), warm_start.mesh.layout
        coarse = resolve(model, p, warm_start, ITERATIONS)
        fine = adapt(model, p, coarse, layout.finer(2), self.settings.iterations)
        if not all(status.ok for each in (coarse, fine) for status in each.status()):
            return None
        less, more = (
            np.asarray(rows_of(model, self.likelihood, p, each, self.orders)) for each in (coarse, fine)
        )
        return replace(self, corrections={**self.corrections, terms: 4.0 / 3.0 * (more - less)})

    def uncorrected(self) -> "DwellProblem":
        """The problem with rows as they are on finitely many nodes."""
        return replace(self, corrections={})

    def sensitivities(
        self, terms: tuple[str, ...], values: Mapping[str, float], warm_start: Any, candidates: Sequence[Term]
    ) -> list[NDArray[np.float64]]:
        """First-order change of the rows per unit of each candidate's amplitudes, (tries, m, amplitudes)."""
        model = self.complete(terms)
        without = [term for term in candidates if not self.catalogue[term.name].states]
        with_states = [term for term in candidates if self.catalogue[term.name].states]
        found = self._without_states(model, values, warm_start, without)
        p, size = self.values(values), self.constants.typical_coordinate
        effects = [self.catalogue[term.name] for term in with_states]
        found |= secants_of_terms(
            model, self.likelihood, self.orders, p, warm_start, effects, with_states, size
        )
        return [found[term.name] for term in candidates]

    def _without_states(
        self,
        model: AbstractPlant,
        values: Mapping[str, float],
        warm_start: PeriodicSolution,
        candidates: Sequence[Term],
    ) -> dict[str, NDArray[np.float64]]:
        """The same of candidates that are in ``model`` at their nulls, by name."""
        found: dict[str, list[NDArray[np.float64]]] = {term.name: [] for term in candidates}
        for one in range(max((len(term.tried) for term in candidates), default=0)):
            some = [term for term in candidates if len(term.tried) > one]
            shapes = {name: value for term in some for name, value in term.tried[one].items()}
            names = [each.name for term in some for each in term.amplitudes]
            slopes = self.slopes(model, placed(self.values(dict(values) | shapes)), warm_start, names)
            for term in some:
                found[term.name].append(slopes[:, [names.index(each.name) for each in term.amplitudes]])
        return {name: np.stack(each) for name, each in found.items()}

    def slopes(
        self, model: AbstractPlant, p: Values, solution: PeriodicSolution, names: Sequence[str]
    ) -> NDArray[np.float64]:
        """Slopes of the rows in the named parameters of ``model`` [units of the rows per SI unit], (m, n)."""
        return slopes_in(model, self.likelihood, self.orders, p, solution, names)

    def locations(
        self, terms: tuple[str, ...], values: Mapping[str, float], warm_start: PeriodicSolution
    ) -> list[InputLocation]:
        """What an unknown signal at each location could do to the harmonics, about a motion with ``terms``."""
        return input_locations(self._about(self.complete(terms), values, warm_start), self.constants)

    def with_background(self, data: Data, values: Mapping[str, float], warm_start: PeriodicSolution) -> Data:
        """The data with errors at every location and input, of the dampers' curves, and drifts of what is free."""
        about = self._about(self.complete(()), values, warm_start)
        drifts = about.slopes(self.free) * [float(about.p[name]) for name in self.free]
        return background_about(data, about, drifts, self.times, self.constants)

    def _about(
        self, model: AbstractPlant, values: Mapping[str, float], warm_start: PeriodicSolution
    ) -> Linearisation:
        return Linearisation(
            model, self.complete(()), self.likelihood, self.orders, self.values(values), warm_start
        )

    @property
    def times(self) -> NDArray[np.float64]:
        """When each test was recorded, in any unit of time, (d,)."""
        return np.array(self.recorded or range(self.shape[0]), np.float64)

    def port_signals(
        self, values: Mapping[str, float], warm_start: PeriodicSolution
    ) -> Mapping[str, PortSignals]:
        """What laws see at the force ports at the nodes of the baseline's motions."""
        return node_loads(self.model(()), self.values(values), warm_start)[0]

    def learned_spans(
        self, port: Port, values: Mapping[str, float], warm_start: PeriodicSolution
    ) -> Mapping[str, float] | None:
        """The range of what is seen at a force, of the load of what gives way, of the speed of an input."""
        if port.kind is PortKind.SENSOR:
            return {}
        if port.kind is PortKind.INPUT:
            fastest = float(2.0 * np.pi * np.max(np.asarray(self.excitation.frequency)))
            return {f"learned_{port.name}_fastest": fastest}
        signals, loads = node_loads(self.model(()), self.values(values), warm_start)
        if port.kind is PortKind.FORCE:
            return spans_of_force(port, signals[port.name], self.constants)
        if port.kind is PortKind.SERIES and not port.resonant:
            beyond = np.asarray(loads[port.name].beyond_rest)
            return {f"learned_{port.name}_carried": largest_with_margin(beyond, self.constants.motion_margin)}
        return None

    def gap_map(self, data: Data, rows: NDArray[np.float64]) -> tuple[MapCell, ...]:
        """The gap of every harmonic that is compared."""
        return gap_map(self, data, rows)

    def cycle_positions(self, data: Data, rows: NDArray[np.float64]) -> tuple[CyclePosition, ...]:
        """The gap of the waveforms at reversal, in mid-stroke and between."""
        return cycle_positions(self, data, rows)

    def regimes(self, data: Data, fit: LaplaceFit) -> tuple[Regime, ...]:
        """In which regimes the baseline misses: of the cycle, of the dwells, over time; nothing without dwells."""
        if not self.dwells.size:
            return ()
        steady = without_drifts(data, len(self.free))
        return find_regimes(dwell_cycles(self, fit), data, fit, self.free, steady, constants=self.constants)

    def loops(
        self,
        values: Mapping[str, float],
        warm_start: PeriodicSolution,
        found: Localisation,
        law: DrawnLaw | None,
        nearest: DrawnLaw | None,
    ) -> tuple[ForceLoop, ...]:
        """Loops at a location for a slow, a middle and a fast dwell."""
        return force_loops(self, self.values(values), warm_start, found, law, nearest)

    def next_tests(self, search: Search, one: LaplaceFit, other: LaplaceFit) -> tuple[NextTest, ...]:
        """Dwells under other conditions that separate two hypotheses best; none are proposed beside a road."""
        return () if self.excitation.windows.size else next_tests(search, self, one, other)

    def mistaken(self, given: NDArray[np.float64]) -> str:
        """A channel with another unit or sign than its header's, or two that were exchanged, in words."""
        rows = np.stack([np.asarray(self.likelihood.measured), given])
        measured, predicted = self.likelihood.harmonics(rows, self.shape)
        return likely_mistake(measured, predicted, measured != 0.0, self.plant)

    def responses(self, data: Data, *rows: NDArray[np.float64]) -> Responses:
        """The harmonics of three models."""
        del data
        return Responses(*(self.likelihood.harmonics(each[None], self.shape)[0] for each in rows))

    def complete(self, terms: Sequence[str]) -> AbstractPlant:
        """The baseline with ``terms`` and all effects without states, in programs that serve others with states."""
        return self._shared.with_effects(terms) or super().complete(terms)

    def _model_with(self, terms: Sequence[str], values: Mapping[str, float]) -> tuple[AbstractPlant, Values]:
        """The same, or the smallest model with ``terms`` where these have a program of their own; its parameters."""
        p = self.values(values)
        model, there = self._shared.with_force(terms, p) or (self._shared.with_effects(terms), p)
        return model or self.model(terms), placed(there)

    @cached_property
    def _shared(self) -> SharedPrograms:
        """Models whose programs serve several hypotheses."""
        return SharedPrograms(self.model(()), self.catalogue, self.baseline)

    @cached_property
    def _names_of_baseline(self) -> tuple[str, ...]:
        """Names of all parameters but those of laws that hold their states and that the baseline does not have."""
        lacking = [
            each for name, each in self.catalogue.items() if each.holds_states and name not in self.baseline
        ]
        gone = {parameter.name for each in lacking for parameter in each.parameters}
        return tuple(name for name in self.names if name not in gone)

    def _have_compiled(self, model: AbstractPlant, p: Values) -> None:
        """Have compiled what solves a model beside what gives its slopes, unless that was done.

        On all cores: those who ask for the same model meanwhile wait.
        """

        def compile_both() -> None:
            blank, some = blank_solution(model, self.excitation, self.layout), sorted(p)[:1]
            side_by_side(lambda: resolve(model, p, blank, 1), lambda: self.slopes(model, p, blank, some))

        shapes = self.layout, self.shape, self.likelihood.measured.shape
        done_once((jax.tree.structure(model), shapes), compile_both)

    def _signals_along(self, solution: PeriodicSolution, p: Values) -> Mapping[str, PortSignals]:
        """What laws see at the force ports along a motion, of any states beyond the baseline's."""
        bare = self.model(())
        blank = blank_solution(bare, self.excitation, solution.mesh.layout)
        at = with_states_of(bare, solution.trajectory)
        # With the parameters of a law that is learned it would be compiled anew for each of them.
        known = {name: p[name] for name in self._names_of_baseline}
        return node_loads(bare, known, replace(blank, mesh=solution.mesh, trajectory=at))[0]


def dwell_problem(
    measured: HarmonicResponse,
    plant: AbstractPlant,
    parameters: ParameterTable,
    catalogue: Mapping[str, Effect],
    baseline: tuple[str, ...] = (),
    free: tuple[str, ...] = (),
    orders: int = 9,
    settings: PeriodicSettings | None = None,
    models: Iterable[tuple[str, ...]] = (),
    constants: DecisionConstants = DEFAULTS,
) -> tuple[DwellProblem, Data]:
    """The problem of a measured response, of dwells and windows, and the response as data.

    Raises :class:`InputError` for a response that cannot be used.
    """
    target = harmonic_target(measured, plant.channels, orders)
    likelihood = likelihood_of(target)
    tests, channels, kept = (int(count) for count in target.used.shape)
    problem = DwellProblem(
        plant=plant,
        parameters=parameters,
        catalogue=catalogue,
        baseline=baseline,
        free=free,
        excitation=measured_excitation(plant, measured, parameters),
        likelihood=likelihood,
        shape=(tests, channels, kept),
        settings=settings or PeriodicSettings(),
        models=tuple(models),
        constants=constants,
        recorded=tuple(measured.times.tolist()),
        beside=measured.beside,
        initial_states=None
        if measured.initial_states is None
        else FreeInitialStates.of_response(measured, plant, orders),
    )
    return problem, likelihood.data
