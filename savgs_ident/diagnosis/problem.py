"""What a diagnosis asks of a plant: its baseline, what may be missing in it, and how it is held against recordings.

Two kinds of recordings have a problem of their own: dwells (:mod:`savgs_ident.diagnosis.dwell_problem`) and a
measured motion with the force of its drive (:mod:`savgs_ident.diagnosis.motion_problem`). Search, model selection,
hold-out and verdict know :class:`AbstractProblem` alone.

One model has every effect without states at its null: such an effect costs next to nothing there, so that one
compiled program serves the baseline and all of them; only an effect with states of its own asks for another.
Parameters that are not given are those of the plant, effects at their null.

Parameters of the plant have the coordinates and priors that they have in a fit
(:mod:`savgs_ident.inference.prior`). The amplitude of an effect begins at its null, what shapes an effect is
log-normal about its typical value; :class:`~savgs_ident.diagnosis.thresholds.DecisionConstants` has both widths.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.free_vector import known_to_tolerance
from savgs_ident.core.parameter import Parameter, ParameterTable, merge_parameters
from savgs_ident.core.values import Values, as_values
from savgs_ident.diagnosis.gap import CyclePosition, MapCell
from savgs_ident.diagnosis.localisation import Localisation
from savgs_ident.diagnosis.result import DriveForces, ForceLoop, NextTest, Regime, Responses
from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.effects.base import AbstractFrictionLimitLaw, Port, PortSignals
from savgs_ident.effects.effect import Effect
from savgs_ident.effects.learned_functions import SMALLEST
from savgs_ident.inference.background.port_functions import InputLocation
from savgs_ident.inference.laplace_fit import LaplaceFit, Search
from savgs_ident.inference.observations import Data, NumberChange, Prediction, Term
from savgs_ident.inference.prior import (
    Coordinates,
    Linear,
    Logarithmic,
    bounds_of,
    sheet_coordinate,
    values_at,
)
from savgs_ident.inference.problem import used_parameters
from savgs_ident.plants.base import AbstractPlant


def term_of(effect: Effect, constants: DecisionConstants = DEFAULTS) -> Term:
    """An effect as a candidate; what it shares with the plant's sheet (a tolerance) is not its own."""
    amplitude_width, shape_width = constants.amplitude_width, constants.shape_width
    own = [each for each in effect.parameters if each.tolerance == 0.0]
    amplitudes = tuple(
        _amplitude(each, effect.null[each.name], amplitude_width) for each in own if each.name in effect.null
    )
    shapes = tuple(_shape(each, shape_width) for each in own if each.name not in effect.null)
    return Term(effect.name, effect.port.location, amplitudes, shapes, effect.tried)


def _change_of_number(effect: Effect, parameters: ParameterTable) -> NumberChange | None:
    """What an effect does to a number of the plant, where that is all that it does."""
    if effect.number is None:
        return None
    sheet = parameters[effect.number].value
    ((change, null),) = effect.null.items()
    there = effect.changes(as_values({effect.number: sheet, change: null + 1.0}))[effect.number]
    return NumberChange(effect.number, sheet, float(there) - sheet)


def spans_of_force(port: Port, signals: PortSignals, constants: DecisionConstants) -> dict[str, float]:
    """The middle of the displacement, its stroke, the largest velocity and load at a force port [its units]."""
    margin = constants.motion_margin
    displacement, velocity, load = (np.asarray(each) for each in signals[:3])
    middle = float(displacement.mean())
    spans = {
        "middle": middle,
        "stroke": largest_with_margin(displacement - middle, margin),
        "speed": largest_with_margin(velocity, margin),
    }
    if port.loaded:
        spans["carried"] = largest_with_margin(load, margin)
    return {f"learned_{port.name}_{name}": value for name, value in spans.items()}


def largest_with_margin(signal: NDArray[np.float64], margin: float) -> float:
    """So many times the largest size of a signal [unit of the signal]."""
    return max(margin * float(np.abs(signal).max()), SMALLEST)


def _amplitude(each: Parameter, null: float, width: float) -> Linear:
    return Linear(each.name, each.unit, null, width * abs(each.value - null), each.lower, each.upper)


def _shape(each: Parameter, width: float) -> Logarithmic:
    return Logarithmic(each.name, each.unit, each.value, width, each.lower, each.upper)


@dataclass(frozen=True)
class DrawnLaw:
    """A law as it is drawn beside the signal that is inferred.

    Attributes:
        effect: the law at its port.
        values: all parameters [SI], its own among them.
        erring: those with an error of the law's own numbers, one standard deviation large; all independent. Empty
            where errors are not drawn.
    """

    effect: Effect
    values: Mapping[str, float]
    erring: tuple[Mapping[str, float], ...] = ()


def drawn_law(effect: Effect, values: Mapping[str, float], fit: LaplaceFit, search: Search) -> DrawnLaw:
    """The law of an effect with the errors that a ``fit`` leaves its numbers; ``values`` [SI] are all parameters.

    Without errors where the covariance of the fit is none.
    """
    own = {each.name for each in effect.parameters}
    mine = np.array([each.name in own for each in fit.coordinates], bool)
    covariance = search.covariance(fit)[np.ix_(mine, mine)]
    if not np.isfinite(covariance).all():
        return DrawnLaw(effect, values)
    # Of a number that the data do not move the variance may come out as a rounding below zero.
    sizes, axes = np.linalg.eigh(covariance)
    lower, upper = bounds_of(fit.coordinates)
    erring = []
    for error in (axes * np.sqrt(np.maximum(sizes, 0.0))).T:
        x = fit.x.copy()
        x[mine] += error
        moved = values_at(fit.coordinates, np.clip(x, lower, upper))
        erring.append({**values, **{name: value for name, value in moved.items() if name in own}})
    return DrawnLaw(effect, values, tuple(erring))


@dataclass(frozen=True)
class AbstractProblem(ABC):
    """A plant, the effects that it may have, and what it is held against; :class:`Plant` of a search.

    Attributes:
        plant: the plant without any of the effects.
        parameters: its parameters as known before the data.
        catalogue: all effects by name.
        baseline: names of those that the baseline has.
        free: names of the parameters that the baseline identifies.
        models: sets of effects that such plants are known to have together.
        constants: what the diagnosis decides by, the widths of the priors of effects among them.
    """

    plant: AbstractPlant
    parameters: ParameterTable
    catalogue: Mapping[str, Effect]
    baseline: tuple[str, ...] = ()
    free: tuple[str, ...] = ()
    models: tuple[tuple[str, ...], ...] = field(default=(), kw_only=True)
    constants: DecisionConstants = field(default=DEFAULTS, kw_only=True)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the plant's channels."""
        return tuple(each.name for each in self.plant.channels)

    @cached_property
    def table(self) -> ParameterTable:
        """All parameters, effects that the baseline does not have at their null."""
        brought = (ParameterTable(effect.parameters) for effect in self.catalogue.values())
        table = merge_parameters(self.parameters, *brought)
        absent = [each for name, each in self.catalogue.items() if name not in self.baseline]
        return table.with_values({name: null for each in absent for name, null in each.null.items()})

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all parameters, sorted."""
        return tuple(sorted(self.table))

    @cached_property
    def nuisances(self) -> Coordinates:
        """The free parameters of the baseline, then those known to a tolerance that matter.

        What is identified and known to a tolerance all the same, as the damping is, is held against it. Of a contact
        in which something may rub, numbers that are typical alone matter as soon as something does.
        """
        plant = self.model(())
        contacts = {
            name for port in plant.ports for name in port.contact or () if self.table[name].is_typical
        }
        used = contacts.union(used_parameters(plant, self.table))
        known = [name for name in known_to_tolerance(self.table, self.free) if name in used]
        return tuple(sheet_coordinate(self.table[name]) for name in (*self.free, *known))

    @cached_property
    def candidates(self) -> tuple[Term, ...]:
        """All effects that the baseline does not have."""
        absent = [effect for name, effect in self.catalogue.items() if name not in self.baseline]
        terms = [
            replace(term_of(each, self.constants), change=_change_of_number(each, self.parameters))
            for each in absent
        ]
        return tuple(term for term in terms if term.amplitudes)

    @property
    def known(self) -> tuple[tuple[str, ...], ...]:
        """What the known sets of effects have beyond the baseline, if more than one effect."""
        mine, can = set(self.baseline), {term.name for term in self.candidates}
        beyond = (
            tuple(name for name in each if name not in mine) for each in self.models if mine < set(each)
        )
        return tuple(each for each in beyond if len(each) > 1 and can >= set(each))

    def model(self, terms: Sequence[str]) -> AbstractPlant:
        """The baseline with ``terms``.

        With all effects without states too, at their null, unless a term with states asks for a program of its own
        anyway: then the smaller model is the sooner compiled. The anchor of a contact is a state of all models or of
        none.
        """
        special = [name for name in terms if self.catalogue[name].states and name not in self.baseline]
        wanted = {
            name
            for name, effect in self.catalogue.items()
            if name in self.baseline or (not effect.states and (not special or name in terms))
        }
        for limits in self._friction_limits.values():
            if not wanted.intersection(limits):
                wanted.add(limits[0])
        model = self.plant
        for name, effect in self.catalogue.items():
            if name in wanted:
                model = model + effect
        for name in special:
            model = model + self.catalogue[name]
        return model

    @cached_property
    def _friction_limits(self) -> Mapping[str, list[str]]:
        """Names of the effects that load the bristle of a contact, by the name of its port."""
        found: dict[str, list[str]] = {}
        for name, effect in self.catalogue.items():
            if isinstance(effect.law, AbstractFrictionLimitLaw):
                found.setdefault(effect.port.name, []).append(name)
        return found

    def complete(self, terms: Sequence[str]) -> AbstractPlant:
        """The baseline with ``terms`` and all effects without states, those at their null."""
        model = self.model(())
        for name in terms:
            if self.catalogue[name].states and name not in self.baseline:
                model = model + self.catalogue[name]
        return model

    def values(self, given: Mapping[str, float]) -> Values:
        """All parameters, SI, with the given ones."""
        return as_values(self.table.as_dict() | dict(given))

    @property
    @abstractmethod
    def channel(self) -> NDArray[np.intp]:
        """The channel of each row, an index of :attr:`channels`, (m,)."""

    @abstractmethod
    def start(self, values: Mapping[str, float]) -> Any:
        """What the baseline at ``values`` [SI] is solved from; raises :class:`InputError` if it has no solution."""

    @abstractmethod
    def predict(
        self, terms: tuple[str, ...], values: Mapping[str, float], names: Sequence[str], warm_start: Any
    ) -> Prediction:
        """Rows with ``terms`` at ``values`` [SI], with slopes in ``names``, from ``warm_start``."""

    @abstractmethod
    def sensitivities(
        self, terms: tuple[str, ...], values: Mapping[str, float], warm_start: Any, candidates: Sequence[Term]
    ) -> list[NDArray[np.float64]]:
        """First-order change of the rows per unit of each candidate's amplitudes, (tries, m, amplitudes)."""

    def rehearse(self) -> None:
        """Have compiled what scores of candidates will ask for, where that takes time."""
        return None

    def refined(self, terms: tuple[str, ...], values: Mapping[str, float], warm_start: Any) -> Any:
        """What to start from nearby, made as precise as it can be. Values are in SI."""
        return warm_start

    def corrected(self, terms: tuple[str, ...], values: Mapping[str, float], warm_start: Any) -> Self | None:
        """The problem free of discretisation errors about ``values`` [SI]: as it is where it has none.

        None where the finer problem has no solution.
        """
        return self

    def uncorrected(self) -> Self:
        """The problem without the corrections of :meth:`corrected`, which hold for its own catalogue alone."""
        return self

    @abstractmethod
    def locations(
        self, terms: tuple[str, ...], values: Mapping[str, float], warm_start: Any
    ) -> list[InputLocation]:
        """What an unknown signal at each location could do to the rows, about a solution with ``terms``."""

    def with_background(self, data: Data, values: Mapping[str, float], warm_start: Any) -> Data:
        """The data with small errors that every model has, about a solution of the baseline; as they are if none."""
        return data

    @abstractmethod
    def port_signals(self, values: Mapping[str, float], warm_start: Any) -> Mapping[str, PortSignals]:
        """What laws see at the force ports along the baseline's motion [the ports' units], (P,) each."""

    @abstractmethod
    def learned_spans(
        self, port: Port, values: Mapping[str, float], warm_start: Any
    ) -> Mapping[str, float] | None:
        """The range of a port's signals along the baseline's motion, as a learned law takes it, by name, SI.

        None where no law can be learned at the port.
        """

    @abstractmethod
    def gap_map(self, data: Data, rows: NDArray[np.float64]) -> tuple[MapCell, ...]:
        """Where in the data a prediction (m,) [units of the rows] misses."""

    @abstractmethod
    def cycle_positions(self, data: Data, rows: NDArray[np.float64]) -> tuple[CyclePosition, ...]:
        """Where in the cycle of the motion a prediction (m,) [units of the rows] misses."""

    @abstractmethod
    def regimes(self, data: Data, fit: LaplaceFit) -> tuple[Regime, ...]:
        """In which regimes the baseline misses, by its ``fit`` to ``data``, the most significant first."""

    @abstractmethod
    def loops(
        self,
        values: Mapping[str, float],
        warm_start: Any,
        found: Localisation,
        law: DrawnLaw | None,
        nearest: DrawnLaw | None,
    ) -> tuple[ForceLoop, ...]:
        """The signal inferred at a location against the motion there, with ``values`` [SI].

        Beside it, the ``law`` that is named, and the ``nearest`` formula where that is a learned one.
        """

    @abstractmethod
    def next_tests(self, search: Search, one: LaplaceFit, other: LaplaceFit) -> tuple[NextTest, ...]:
        """Tests that would separate two hypotheses, the most significant first."""

    def mistaken(self, given: NDArray[np.float64]) -> str:
        """What was probably recorded otherwise than it is said to be, in words; empty where nothing tells.

        ``given`` (m,) are rows of the baseline as given [units of the rows].
        """
        del given
        return ""

    @abstractmethod
    def responses(self, data: Data, *rows: NDArray[np.float64]) -> Responses | DriveForces:
        """Rows before, recalibrated and after, (m,) each [units of the rows], as a report shows them."""


class ModelPoint(NamedTuple):
    """A model of a problem: its terms, and its values by name [SI]."""

    problem: AbstractProblem
    terms: tuple[str, ...]
    values: Mapping[str, float]
