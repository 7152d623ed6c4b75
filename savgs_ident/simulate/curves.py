"""Responses over frequency as curves, a line for each programme of a campaign."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from savgs_ident.plants.base import AbstractPlant, Excitation
from savgs_ident.responses.harmonic_response import HarmonicResponse, peak_to_peak
from savgs_ident.responses.programmes import driven_alike, settings_of


@dataclass(frozen=True)
class ModelCurve:
    """A model's response at F frequencies, in the C channels of its plant.

    Attributes:
        label: what the legend calls it.
        frequency: [Hz], (F,), increasing.
        transfer: complex first harmonic per unit of the first input, (F, C); NaN where not solved.
        peak_to_peak: [unit], (F, C); NaN where not solved.
        programme: number of the line that each frequency is on, (F,); one for all where left out.
    """

    label: str
    frequency: NDArray[np.float64]
    transfer: NDArray[np.complex128]
    peak_to_peak: NDArray[np.float64]
    programme: NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, np.intp))

    @property
    def lines(self) -> list[NDArray[np.intp]]:
        """The places of the frequencies of each line."""
        numbers = np.unique(self.programme)
        return [np.flatnonzero(self.programme == each) for each in numbers] or [
            np.arange(self.frequency.size)
        ]


def model_curve(
    label: str,
    frequency: NDArray[np.float64],
    harmonics: NDArray[np.complex128],
    driven: NDArray[np.complex128],
    solved: NDArray[np.bool_],
    programme: NDArray[np.intp] | None = None,
) -> ModelCurve:
    """The curve of ``harmonics`` (F, C, K) under an input whose first harmonics are ``driven`` (F,).

    Frequencies that are not ``solved`` (F,) are left open; ``programme`` (F,) is the line that each is on.
    """
    every = np.ones(harmonics.shape, dtype=np.bool_)
    known = solved & (driven != 0.0)
    transfer = np.where(known[:, None], harmonics[:, :, 1] / np.where(known, driven, 1.0)[:, None], np.nan)
    extent = np.where(solved[:, None], peak_to_peak(harmonics, every), np.nan)
    lines = np.zeros(frequency.size, np.intp) if programme is None else programme
    return ModelCurve(label, frequency, transfer, extent, lines)


def programmes_of(plant: AbstractPlant | type[AbstractPlant], excitation: Excitation) -> NDArray[np.intp]:
    """The programme of each dwell of an excitation, (D,)."""
    driven, *others = (np.asarray(excitation.harmonics[each.name]) for each in plant.inputs)
    return driven_alike(
        np.asarray(excitation.frequency), settings_of(driven[:, 1], [each[:, 0] for each in others])
    )


def measured_programmes(
    measured: HarmonicResponse, plant: AbstractPlant | type[AbstractPlant]
) -> NDArray[np.intp]:
    """The programme of each measured dwell, (D,)."""
    driven, *others = (each.name for each in plant.inputs)
    levels = [
        measured.harmonics[:, measured.channel(name), 0] for name in others if name in measured.channels
    ]
    first = measured.harmonics[:, measured.channel(driven), 1]
    return driven_alike(measured.frequency, settings_of(first, levels))
