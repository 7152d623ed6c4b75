"""What dwells would tell: the information of each on parameters and effects, and which of them tell most together.

With the information of parameters and effects in blocks, A and H of their own and B between them, that on the effects
once the parameters have made up for what they can is

    S = H - B' A^-1 B.

An effect of typical size stands out of the noise by sqrt(S_ee), and from another one, whatever that one's size, by
sqrt(S_ee - S_ef^2 / S_ff).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnosis.public import problem_of_dwells
from savgs_ident.diagnosis.result import DiagnosisSettings
from savgs_ident.diagnosis.thresholds import DecisionConstants
from savgs_ident.inference.prior import slopes_at, values_at
from savgs_ident.plants.model import Model
from savgs_ident.simulate.public import simulate_dwells

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PlannedEffect:
    """What a campaign would show of an effect.

    Attributes:
        name: of the effect.
        sigma: by how many standard deviations it stands out at its typical size [1], parameters estimated along.
        smallest: the size of its first amplitude that would be seen [``unit``]; infinite if none would.
        unit: of that.
        alike: the effect that imitates it best; empty where there is no other.
        apart: by how many standard deviations it differs from that one [1].
    """

    name: str
    sigma: float
    smallest: float
    unit: str
    alike: str
    apart: float


class Programme(NamedTuple):
    """How dwells are driven.

    Attributes:
        amplitude: of the first input [its unit].
        levels: of others above rest [their units], by name.
        beside: amplitudes of others that move along [their units], by name; below zero against the first.
    """

    amplitude: float
    levels: Mapping[str, float] = MappingProxyType({})
    beside: Mapping[str, float] = MappingProxyType({})

    def amplitudes(self, model: Model) -> dict[str, float]:
        """Amplitudes of all inputs that move [their units], by name."""
        return {model.plant.inputs[0].name: self.amplitude, **self.beside}

    def others(self, model: Model) -> tuple[str, ...]:
        """What inputs beside the first one do, in words."""
        units = {each.name: each.unit for each in model.plant.inputs}
        moved = (f"{name} {'in phase' if by > 0.0 else 'against it'}" for name, by in self.beside.items())
        held = (f"{name} {level:g} {units[name]} above rest" for name, level in self.levels.items())
        return (*moved, *held)

    def said(self, model: Model) -> str:
        """In words."""
        return ", ".join((f"{self.amplitude:g} {model.plant.inputs[0].unit}", *self.others(model)))


class Information(NamedTuple):
    """Dwells linearised: frequency [Hz] and how each is driven, and the information of each, (T, n + k, n + k) [1].

    That of n coordinates of the parameters comes first, then that of k effects of typical size. ``slopes`` are
    relative changes of the free parameters per unit of their coordinates [1]; ``units`` are by effect the size of its
    first amplitude and its unit.
    """

    dwells: tuple[tuple[float, Programme], ...]
    information: Array
    slopes: Array
    units: Mapping[str, tuple[float, str]]


def information_of(
    given: Model,
    settings: DiagnosisSettings,
    run: Programme,
    hertz: Sequence[float],
    noise: Mapping[str, float],
    samples: int,
) -> Information:
    """The dwells that are driven in one way."""
    measured = simulate_dwells(
        given,
        hertz,
        run.amplitudes(given),
        noise,
        samples=samples,
        orders=settings.orders,
        levels=run.levels,
    )
    problem, data = problem_of_dwells(measured, given, settings)
    origin = np.zeros(len(problem.nuisances))
    at = values_at(problem.nuisances, origin)
    motion = problem.start(at)
    names = [each.name for each in problem.nuisances]
    steepness = slopes_at(problem.nuisances, origin)
    parameters = problem.slopes(problem.model(()), problem.values(at), motion, names) * steepness
    # Each at its typical shape alone.
    terms = [replace(term, tries=({},)) for term in problem.candidates]
    found = problem.sensitivities((), at, motion, terms)
    typical = settings.constants.typical_coordinate
    sizes = [np.array([typical * each.scale for each in term.amplitudes]) for term in terms]
    effects = [each[0] @ by for each, by in zip(found, sizes, strict=True)]
    columns = np.stack([*parameters.T, *effects], axis=1)
    columns /= np.sqrt(data.variance)[:, None]
    rows = [columns[data.test == test] for test in range(data.tests)]
    count = len(settings.free)
    relative = np.abs(steepness[:count]) / np.array([abs(at[name]) for name in settings.free])
    units = {
        term.name: (float(by[0]), term.amplitudes[0].unit) for term, by in zip(terms, sizes, strict=True)
    }
    return Information(
        tuple((f, run) for f in measured.frequency.tolist()),
        np.stack([each.T @ each for each in rows]),
        relative,
        units,
    )


def joined(blocks: Sequence[Information]) -> Information:
    """The information of several blocks of dwells."""
    dwells = tuple(dwell for each in blocks for dwell in each.dwells)
    information = np.concatenate([each.information for each in blocks])
    return blocks[0]._replace(dwells=dwells, information=information)


def _split(block: Information, total: Array) -> tuple[Array, Array]:
    """Covariance of the parameters [1], (n, n), beside their priors, and the information on the effects, (k, k)."""
    count = total.shape[0] - len(block.units)
    known = np.linalg.inv(total[:count, :count] + np.eye(count))
    across = total[:count, count:]
    return np.asarray(known), np.asarray(total[count:, count:] - across.T @ known @ across)


def errors_with(block: Information, total: Array, free: int) -> Array:
    """Relative errors [1] of the ``free`` parameters with so much information."""
    known, _ = _split(block, total)
    return np.asarray(np.sqrt(np.diag(known)[:free]) * block.slopes)


def choose(
    block: Information, free: int, most: int, target: float, constants: DecisionConstants
) -> tuple[list[int], list[Array]]:
    """Places of the dwells that help most, and relative errors of the free parameters with each."""
    total = np.zeros(block.information.shape[1:])
    chosen: list[int] = []
    errors: list[Array] = []

    def worth(place: int) -> tuple[float, float]:
        with_it = total + block.information[place]
        beyond = np.maximum(np.log(errors_with(block, with_it, free) / target), 0.0)
        return -float(np.sum(beyond)), _told_separations(_split(block, with_it)[1], constants.visible_sigma)

    while len(chosen) < min(most, len(block.dwells)):
        best = max((each for each in range(len(block.dwells)) if each not in chosen), key=worth)
        total = total + block.information[best]
        chosen.append(best)
        errors.append(errors_with(block, total, free))
    return chosen, errors


def _told_separations(information: Array, visible: float) -> float:
    """How well effects are told from each other, over all pairs [1]; what is told apart for sure adds little more."""
    return float(np.sum(np.log1p(_separations(information) / visible**2)))


def _separations(information: Array) -> Array:
    """Squares of the sd by which each effect differs from each other one [1], (k, k); 0 from itself."""
    own = np.diag(information)
    shared = information**2 / np.where(own > 0.0, own, 1.0)
    apart = np.maximum(own[:, None] - shared, 0.0)
    np.fill_diagonal(apart, 0.0)
    return np.asarray(apart)


def effects_shown(
    block: Information, total: Array, constants: DecisionConstants
) -> tuple[PlannedEffect, ...]:
    """What a campaign of that information would show of every effect, the most visible first."""
    _, information = _split(block, total)
    apart, names, found = _separations(information), list(block.units), []
    for place, (name, (size, unit)) in enumerate(block.units.items()):
        sigma = float(np.sqrt(max(information[place, place], 0.0)))
        others = [each for each in range(len(names)) if each != place and information[each, each] > 0.0]
        nearest = min(others, key=lambda each: apart[place, each], default=None)
        found.append(
            PlannedEffect(
                name,
                sigma,
                constants.visible_sigma / sigma * size if sigma > 0.0 else np.inf,
                unit,
                "" if nearest is None else names[nearest],
                0.0 if nearest is None else float(np.sqrt(apart[place, nearest])),
            )
        )
    return tuple(sorted(found, key=lambda each: -each.sigma))
