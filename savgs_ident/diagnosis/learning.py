"""A law at the port where something unknown acts, learned in full: on the true, nonlinear plant.

Localisation learns a law to first order about the baseline. Here the same functions of what the port sees become a
force of the model (:mod:`savgs_ident.effects.learned`), and their coefficients are fitted beside the
baseline's own parameters, as those of any effect; so the correction can be solved, simulated and exported. Laws of
what is no force (something that gives way, a sensor, an input) are not learned this way.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.parameter import ParameterTable, merge_parameters
from savgs_ident.diagnosis.held_out import HeldOut, hold_out
from savgs_ident.diagnosis.localisation import widths_of
from savgs_ident.diagnosis.problem import AbstractProblem
from savgs_ident.effects.base import Port
from savgs_ident.effects.learned import SMALLEST, coefficients_at, learned_effect
from savgs_ident.inference.find_map import LaplaceFit, find_map, search_of
from savgs_ident.inference.observations import Data, Term
from savgs_ident.inference.prior import Linear

STEPS = 8
"""Most steps of the fit."""

MARGIN = 1.1
"""By how much the law reaches beyond the baseline's motion, for that of the plant with it is another."""


@dataclass(frozen=True)
class LearnedLaw:
    """A law at its best, beside the baseline.

    Attributes:
        name: of the effect.
        port: the force port where it acts.
        problem: the baseline with the law as its only candidate.
        mode: the best point of both.
        held: what it predicts of tests left out.
        spans: the range of the port's motion that it knows, by name, SI.
    """

    name: str
    port: Port
    problem: AbstractProblem
    mode: LaplaceFit
    held: HeldOut
    spans: dict[str, float]

    @property
    def values(self) -> dict[str, float]:
        """All its numbers, and those of the plant that were fitted beside it, SI."""
        return self.mode.values | self.spans


def learn(problem: AbstractProblem, data: Data, base: LaplaceFit, port: Port) -> LearnedLaw:
    """The law at a force ``port``; ``base`` is the recalibrated baseline.

    Look at the status of its mode.
    """
    effect = learned_effect(port)
    spans = _spans(problem, base, port)
    table = ParameterTable(effect.parameters).with_values(spans)
    there = {name: each for name, each in problem.catalogue.items() if name in problem.baseline}
    mine = replace(
        problem,
        parameters=merge_parameters(problem.parameters, table),
        catalogue={**there, effect.name: effect},
    ).uncorrected()
    search = search_of(mine, data)
    names = coefficients_at(port)
    slopes = mine.predict((effect.name,), base.values, names, base.prediction.warm_start).slopes
    widths = widths_of(search, base, slopes)
    amplitudes = tuple(
        Linear(name, port.force_unit, 0.0, float(each)) for name, each in zip(names, widths, strict=True)
    )
    term = Term(effect.name, port.location, amplitudes)
    mode = find_map(search, (term,), base.values, base.prediction.warm_start, STEPS)
    return LearnedLaw(effect.name, port, mine, mode, hold_out(search, mode, (term,)), spans)


def _spans(problem: AbstractProblem, base: LaplaceFit, port: Port) -> dict[str, float]:
    """The middle of the displacement, its stroke, the largest velocity and load at a port [units of the port]."""
    ports = problem.port_signals(base.values, base.prediction.warm_start)
    displacement, velocity, load = (np.asarray(each) for each in ports[port.name][:3])
    middle = float(displacement.mean())
    spans = {
        "middle": middle,
        "stroke": MARGIN * _largest(displacement - middle),
        "speed": MARGIN * _largest(velocity),
    }
    if port.loaded:
        spans["carried"] = MARGIN * _largest(load)
    return {f"learned_{port.name}_{name}": value for name, value in spans.items()}


def _largest(signal: NDArray[np.float64]) -> float:
    return max(float(np.abs(signal).max()), SMALLEST)
