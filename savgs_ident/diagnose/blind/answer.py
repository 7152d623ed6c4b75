"""What was drawn for a trial: the truth that the diagnosis must not see."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

Drawn = Literal["none", "effect", "two", "unknown"]
"""What a trial's rig has beyond its model: nothing, an effect, two, or one that the catalogue then lacks."""


@dataclass(frozen=True)
class Answer:
    """The truth of a trial.

    Attributes:
        number: of the trial.
        kind: what was drawn.
        effects: names of the effects that the rig has beyond the baseline.
        ports: where they act, in the same order.
        changes: by how much each alone changes the clean response, relative; by effect.
        sigmas: by how many standard deviations each stands out of what noise, calibration and tolerances can do,
            the other one projected out; by effect.
        imitators: of a single effect, others of the catalogue that do the same to this campaign, to first order
            within the noise.
        parameters: true values of the effects' parameters, SI.
        rig: true values of the rig's own parameters that are not those of the sheet, SI.
        without: effects that are removed from the catalogue for this trial.
    """

    number: int
    kind: Drawn
    effects: tuple[str, ...]
    ports: tuple[str, ...]
    changes: Mapping[str, float]
    sigmas: Mapping[str, float]
    imitators: tuple[str, ...]
    parameters: Mapping[str, float]
    rig: Mapping[str, float]
    without: tuple[str, ...]
