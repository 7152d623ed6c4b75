"""One controller on many rigs: the worst case over those that the recordings allow."""

from collections.abc import Iterable
from dataclasses import dataclass

import control
import numpy as np

from savgs_ident.control.generalised_plant import design_loop, generalised_plant
from savgs_ident.control.margins import Margins, margins_of
from savgs_ident.control.quarter_car_space import TwoMasses, quarter_car_space
from savgs_ident.core.parameter import ParameterTable


@dataclass(frozen=True)
class Robustness:
    """How a controller does on every rig of a set.

    Attributes:
        margins: of every rig, in order.
        peaks: largest singular value of every closed loop [1]; infinite where it is unstable.
    """

    margins: tuple[Margins, ...]
    peaks: tuple[float, ...]

    @property
    def stable(self) -> bool:
        """Whether every loop is stable."""
        return all(each.stable for each in self.margins)

    @property
    def worst(self) -> int:
        """The rig with the largest peak."""
        return int(np.argmax(self.peaks))


def examine(
    controller: control.StateSpace, rigs: Iterable[TwoMasses], bandwidth: float, weights: ParameterTable
) -> Robustness:
    """A continuous controller on rigs, with the weights it was made with; ``bandwidth`` [Hz] of the actuator."""
    margins, peaks = [], []
    for rig in rigs:
        space = quarter_car_space(rig)
        found = margins_of(design_loop(space, bandwidth), controller)
        closed = generalised_plant(space, bandwidth, weights).lft(controller)
        margins.append(found)
        peaks.append(float(control.linfnorm(closed)[0]) if found.stable else float("inf"))
    return Robustness(tuple(margins), tuple(peaks))
