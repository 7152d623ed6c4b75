"""A law at the port where something unknown acts, learned in full: on the true, nonlinear rig.

Attribution learns a law to first order about the baseline. Here the same functions of what the port sees become a
force of the model (:mod:`savgs_ident.effects.learned.forces`), and their coefficients are fitted beside the
baseline's own parameters, as those of any effect; so the correction can be solved, simulated and exported. Laws of
what is no force (something that gives way, a sensor, the road) are not learned this way.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.rig import merge_parameters
from savgs_ident.diagnose.engine.attribution import widths_of
from savgs_ident.diagnose.engine.climb import Mode, climb, search_of
from savgs_ident.diagnose.engine.coordinates import Linear
from savgs_ident.diagnose.engine.data import Data
from savgs_ident.diagnose.engine.heldout import HeldOut, hold_out
from savgs_ident.diagnose.engine.prediction import Term
from savgs_ident.diagnose.rig.columns import node_loads
from savgs_ident.diagnose.rig.plant import RigPlant
from savgs_ident.effects.learned.forces import LOADED, SMALLEST, coefficients_at
from savgs_ident.effects.registry import LEARNED
from savgs_ident.model.effect import Port

STEPS = 8
"""Most steps of the fit."""

MARGIN = 1.1
"""By how much the law reaches beyond the baseline's motion, for that of the rig with it is another."""


@dataclass(frozen=True)
class LearnedLaw:
    """A law at its best, beside the baseline.

    Attributes:
        name: of the effect.
        port: where it acts.
        plant: the baseline with the law as its only candidate.
        mode: the best point of both.
        held: what it predicts of tests left out.
        spans: the range of the port's motion that it knows, by name, SI.
    """

    name: str
    port: str
    plant: RigPlant
    mode: Mode
    held: HeldOut
    spans: dict[str, float]

    @property
    def values(self) -> dict[str, float]:
        """All its numbers, and those of the rig that were fitted beside it, SI."""
        return self.mode.values | self.spans


def can_be_learned(port: str) -> bool:
    """Whether a law of a port is a force."""
    return f"learned_{port}" in LEARNED


def learn(plant: RigPlant, data: Data, base: Mode, port: str) -> LearnedLaw:
    """The law at a ``port`` that :func:`can_be_learned`; ``base`` is the recalibrated baseline.

    Look at the status of its mode.
    """
    effect = LEARNED[f"learned_{port}"]
    spans = _spans(plant, base, port)
    table = ParameterTable(effect.parameters).with_values(spans)
    rig = replace(plant.rig, parameters=merge_parameters(plant.rig.parameters, table))
    there = {name: each for name, each in plant.catalogue.items() if name in plant.baseline}
    mine = replace(plant, rig=rig, catalogue={**there, effect.name: effect}, corrections={})
    search = search_of(mine, data)
    names = coefficients_at(Port(port))
    slopes = mine.predict((effect.name,), base.values, names, base.prediction.near).slopes
    widths = widths_of(search, base, slopes)
    amplitudes = tuple(Linear(name, "N", 0.0, float(each)) for name, each in zip(names, widths, strict=True))
    term = Term(effect.name, port, amplitudes)
    mode = climb(search, (term,), base.values, base.prediction.near, STEPS)
    return LearnedLaw(effect.name, port, mine, mode, hold_out(search, mode, (term,)), spans)


def _spans(plant: RigPlant, base: Mode, port: str) -> dict[str, float]:
    """The middle of the displacement [m], its stroke [m], the largest velocity [m/s] and load [N] at a port."""
    ports, _ = node_loads(plant.model(()), plant.values(base.values), base.prediction.near)
    displacement, velocity, load = (np.asarray(each) for each in ports[port])
    middle = float(displacement.mean())
    spans = {
        "middle": middle,
        "stroke": MARGIN * _largest(displacement - middle),
        "speed": MARGIN * _largest(velocity),
    }
    if Port(port) in LOADED:
        spans["carried"] = MARGIN * _largest(load)
    return {f"learned_{port}_{name}": value for name, value in spans.items()}


def _largest(signal: NDArray[np.float64]) -> float:
    return max(float(np.abs(signal).max()), SMALLEST)
