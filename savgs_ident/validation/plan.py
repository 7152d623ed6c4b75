"""A campaign before it is recorded: which dwells identify the free parameters and tell the catalogue's effects apart.

    found = plan(model, amplitudes=(0.01, 0.02), noise={"angle": 2e-3}, tests=10, target=0.02)
    found.tests[0].frequency_hz, found.errors["k"], found.not_separated

All that could be recorded, dwells at some frequencies and amplitudes of the first input, is linearised about the
model: slopes of the harmonics in the free parameters and in those known to a tolerance, and what each effect of the
catalogue would change, in standard deviations of the noise. The information of dwells adds up, so that they are
chosen one after the other, each the one that helps most beside those before it: until every free parameter is known
to the ``target``, the one that brings their errors closest to it; from then on the one that tells effects apart.

All is to first order and by noise and tolerances alone: small errors that every model has are not in it
(:mod:`savgs_ident.validation.planned_dwells`).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.core.presentation import Progress, Result, no_progress
from savgs_ident.core.values import as_values
from savgs_ident.diagnosis.public import baseline_of
from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.inference.problem import check_free, used_parameters
from savgs_ident.plants.at_rest import require_return
from savgs_ident.plants.model import Model, PlantModel
from savgs_ident.simulate.excitation import sine_excitation, typical_amplitude, typical_levels
from savgs_ident.simulate.program_cache import use_persistent_cache
from savgs_ident.simulate.public import DWELLS, SimulatedResponse, simulate_response
from savgs_ident.validation.check_plant import frequencies_about
from savgs_ident.validation.planned_dwells import (
    PlannedEffect,
    Programme,
    choose,
    effects_shown,
    errors_with,
    information_of,
    joined,
)

Array = NDArray[np.float64]

OFFERED = 16
"""Frequencies that are offered about the natural ones of a plant, where none are given."""

ENDLESS = 1e8
"""As many times as often a campaign is repeated to see what is left of its errors."""

AS_GOOD_AS = 1.1
"""Errors, over those that are left then, of which more dwells would take next to nothing [1]."""

ASSUMED_NOISE = 0.01
"""Standard deviation of one sample where none is given, as a share of the largest rms of the channel in a dwell.

Origin: by choice."""


@dataclass(frozen=True)
class PlannedTest:
    """A dwell of a plan.

    Attributes:
        frequency_hz: of the first input [Hz].
        programme: how it is driven.
        errors: relative standard errors [1] of the free parameters with it and all before it, in their order.
    """

    frequency_hz: float
    programme: Programme
    errors: tuple[float, ...]


@dataclass(frozen=True)
class CampaignPlan(Result):
    """A plan of a campaign.

    Attributes:
        model: what it is for.
        tests: its dwells, in the order of what they are worth.
        free: the parameters that are to be identified.
        target: the relative standard error [1] that was asked for.
        least: relative standard errors [1] of the free parameters that tolerances of others leave however much is
            recorded.
        effects: what it would show of the catalogue, the most visible first.
        visible: standard deviations by which an effect is seen, and told from another [1].
        noise: standard deviation of one sample of each channel [its unit].
        assumed: channels whose noise was assumed.
        offered: how many dwells there were to choose among.
        unsolved: dwells without a periodic motion, in words.
    """

    presenter: ClassVar[str] = "CAMPAIGN_PLAN"

    model: Model
    tests: tuple[PlannedTest, ...]
    free: tuple[str, ...]
    target: float
    least: tuple[float, ...]
    effects: tuple[PlannedEffect, ...]
    visible: float
    noise: Mapping[str, float]
    assumed: tuple[str, ...]
    offered: int
    unsolved: tuple[str, ...]

    @property
    def errors(self) -> dict[str, float]:
        """Relative standard errors [1] of the free parameters with the whole campaign."""
        return dict(zip(self.free, self.tests[-1].errors, strict=True))

    @property
    def trusted(self) -> bool:
        """Whether every free parameter would be known as well as was asked for."""
        return all(each <= self.target for each in self.errors.values())

    @property
    def limited(self) -> tuple[str, ...]:
        """Free parameters of which more dwells would tell no more, for tolerances of others limit them."""
        return tuple(
            name
            for name, least in zip(self.free, self.least, strict=True)
            if self.errors[name] < AS_GOOD_AS * least
        )

    @property
    def not_visible(self) -> tuple[str, ...]:
        """Effects that would not be seen at their typical size."""
        return tuple(each.name for each in self.effects if each.sigma < self.visible)

    @property
    def not_separated(self) -> tuple[tuple[str, str], ...]:
        """Effects that would be seen, but not told from another one, which stands second."""
        seen = (each for each in self.effects if each.sigma >= self.visible and each.alike)
        return tuple((each.name, each.alike) for each in seen if each.apart < self.visible)


def plan(
    model: Model,
    *,
    free: Sequence[str] = (),
    frequencies: Sequence[float] = (),
    amplitudes: Sequence[float] = (),
    noise: Mapping[str, float] | None = None,
    levels: Mapping[str, Sequence[float]] | None = None,
    tests: int = 12,
    target: float = 0.02,
    samples: int = 4000,
    orders: int = 9,
    constants: DecisionConstants = DEFAULTS,
    command: Sequence[str] = (),
    progress: Progress = no_progress,
) -> CampaignPlan:
    """Plan a campaign of dwells.

    Args:
        model: the rig, or another plant, as it is known before any recording.
        free: names of the parameters to identify; those of a fit if empty.
        frequencies: that the rig can be driven at [Hz]; those of the shipped campaign for the rig, some about the
            natural frequencies of another plant, if empty.
        amplitudes: of the first input that it can be driven with [its unit]; the typical one if empty.
        noise: standard deviation of one sample of each channel [its unit], by name; a hundredth of the largest
            motion's rms where it is not given.
        levels: by how much further inputs can be held above rest [their units], by name, one of them at a time; half
            the typical level and the whole, where they are left out, of inputs whose mean counts and that are no
            motion or force as the first is. Those move along in phase with it and against it, all together and one
            at a time.
        tests: most dwells of the campaign.
        target: relative standard error that is wanted of the free parameters [1].
        samples: samples of each channel in a dwell.
        orders: highest harmonic order that is compared.
        constants: of the diagnosis, for typical sizes of effects and what is seen.
        command: the command line that the result says it was made by.
        progress: called with a sentence on what is being done.

    Look at ``trusted`` of the result. Raises :class:`InputError` for names that do not exist, for numbers that are
    not above zero, and where no dwell has a periodic motion.
    """
    use_persistent_cache()
    hertz, sizes = _offers(model, frequencies, amplitudes)
    programmes = [each for size in sizes for each in _programmes(model, size, levels)]
    _above_zero({"tests": tests, "target": target, "samples": samples, "orders": orders})
    given, settings, _ = baseline_of(model, orders, (), constants)
    settings = replace(settings, free=given.free(free))
    check_free(settings.free, given.table, used_parameters(given.build(), given.table))
    _have_sizes(given, settings.free)
    solved = []
    for each in programmes:
        progress(f"solving {len(hertz)} dwells at {each.said(given)}")
        driven = sine_excitation(
            given.plant, given.table, np.array(hertz), each.amplitudes(given), each.levels
        )
        solved.append(simulate_response(given, driven, orders))
    known, assumed = _noise(given, solved, dict(noise or {}))
    blocks = []
    for each, response in zip(programmes, solved, strict=True):
        there = [float(f) for f, ok in zip(response.frequency, response.ok, strict=True) if ok]
        if there:
            progress(f"what {len(there)} dwells at {each.said(given)} would show")
            blocks.append(information_of(given, settings, each, there, known, samples))
    if not blocks:
        require_return(given.build(), as_values(given.table.as_dict()))
        raise InputError(
            "no dwell that was offered has a periodic motion", remedy="offer smaller amplitudes or others"
        )
    lost = [
        f"{f:.3g} Hz at {each.said(given)}"
        for each, response in zip(programmes, solved, strict=True)
        for f, ok in zip(response.frequency, response.ok, strict=True)
        if not ok
    ]
    every = joined(blocks)
    chosen, errors = choose(every, len(settings.free), tests, target, constants)
    total = every.information[chosen].sum(axis=0)
    origin = replace(model.origin(), command=tuple(command))
    return CampaignPlan(
        model=given,
        tests=tuple(
            PlannedTest(hertz_of, run, tuple(after.tolist()))
            for (hertz_of, run), after in zip((every.dwells[each] for each in chosen), errors, strict=True)
        ),
        free=settings.free,
        target=target,
        least=tuple(errors_with(every, ENDLESS * total, len(settings.free)).tolist()),
        effects=effects_shown(every, total, constants),
        visible=constants.visible_sigma,
        noise=known,
        assumed=assumed,
        offered=len(every.dwells),
        unsolved=tuple(lost),
        origin=origin,
    )


def _programmes(
    model: Model, amplitude: float, levels: Mapping[str, Sequence[float]] | None
) -> Iterator[Programme]:
    """Ways to drive dwells with an amplitude of the first input, that in which all others rest first."""
    first, *others = model.plant.inputs
    alike = [each.name for each in others if each.unit == first.unit]
    typical = typical_levels(model.build(), model.table)
    if levels is None:
        # A rig is planned as it is run: with its link where it is.
        offered = typical if isinstance(model, PlantModel) else {}
        levels = {name: [0.5 * level, level] for name, level in offered.items() if name not in alike}
    yield Programme(amplitude)
    for names in dict.fromkeys([tuple(alike), *((name,) for name in alike)]):
        if names:
            yield from (
                Programme(amplitude, beside=dict.fromkeys(names, sign * amplitude)) for sign in (1.0, -1.0)
            )
    for name, each in levels.items():
        if name not in typical:
            among = ", ".join(typical) or "it has none"
            raise InputError(
                f"the plant has no further input '{name}' whose level counts", remedy=f"choose among: {among}"
            )
        yield from (Programme(amplitude, {name: level}) for level in each if level)


def _offers(
    model: Model, frequencies: Sequence[float], amplitudes: Sequence[float]
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Frequencies [Hz] and amplitudes of the first input [its unit] to choose among, growing."""
    if not frequencies:
        frequencies = frequencies_about(model, OFFERED) if isinstance(model, PlantModel) else DWELLS
    sizes = tuple(amplitudes) or (typical_amplitude(model.plant, model.table),)
    for size in sizes:
        if not 0.0 < size < np.inf:
            raise InputError(f"an amplitude of {size:g} moves nothing", remedy="give one above zero")
    for each in frequencies:
        if not 0.0 < each < np.inf:
            raise InputError(f"{each:g} Hz is no frequency", remedy="give a frequency above 0 Hz")
    return tuple(sorted(set(frequencies))), tuple(sorted(set(sizes)))


def _have_sizes(model: Model, free: Sequence[str]) -> None:
    """Raises :class:`InputError` for a parameter of which a relative error says nothing, for it is zero."""
    for name in free:
        if model.table[name].value == 0.0:
            raise InputError(
                f"a relative error of '{name}' means nothing, for its value is 0",
                source="--free",
                remedy="give it a value, or name other parameters",
            )


def _above_zero(numbers: Mapping[str, float]) -> None:
    for name, number in numbers.items():
        if not 0.0 < number < np.inf:
            raise InputError(f"{name} is {number:g}", source=name, remedy="give a number above zero")


def _noise(
    model: Model, solved: Sequence[SimulatedResponse], given: Mapping[str, float]
) -> tuple[dict[str, float], tuple[str, ...]]:
    """Noise of one sample of each channel [its unit], and the channels for which it was assumed."""
    names = [each.name for each in model.channels]
    absent = sorted(set(given) - set(names))
    if absent:
        raise InputError(
            f"the plant has no channel '{absent[0]}'", remedy="choose among: " + ", ".join(names)
        )
    _above_zero(given)
    motions = np.concatenate([each.harmonics[each.ok, :, 1:] for each in solved])
    largest = np.sqrt(0.5 * np.max(np.sum(np.abs(motions) ** 2, axis=2), axis=0, initial=0.0))
    known = {
        name: given.get(name, ASSUMED_NOISE * float(size)) for name, size in zip(names, largest, strict=True)
    }
    return known, tuple(name for name in names if name not in given)
