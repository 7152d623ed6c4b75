"""Responses over frequency as curves, a line for each programme of a campaign.

A campaign that repeats its frequencies at other amplitudes of the first input, or at other levels of the others, is
several programmes in one. A line through all its dwells would go up and down between them.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from savgs_ident.plants.base import AbstractPlant, Excitation
from savgs_ident.responses.harmonic_response import HarmonicResponse, peak_to_peak


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


SAME = 5e-3
"""Frequencies that differ by less than this are one [1]."""

ALIKE = 0.5
"""A programme is followed to a dwell whose amplitude differs from that at the frequency before by less than a factor
exp of this, or whose levels by less than this of their range. Origin: by choice; amplitudes may fall along it."""


def driven_alike(frequency: NDArray[np.float64], settings: NDArray[np.float64]) -> NDArray[np.intp]:
    """The programme of each dwell, (D,), counted from 0; one for all where no ``frequency`` [Hz] occurs twice.

    ``settings`` (D, s) are how each is driven, in units in which a difference of one is a large one.
    """
    found, last = np.zeros(frequency.size, np.intp), list[NDArray[np.float64]]()
    order = np.argsort(frequency, kind="stable")
    apart = np.diff(np.log(frequency[order])) > SAME
    together = np.split(order, np.flatnonzero(apart) + 1)
    if all(each.size < 2 for each in together):
        return found
    for dwells in together:
        known = np.array(last)
        distances = (
            np.linalg.norm(settings[dwells][:, None] - known, axis=2) if last else np.zeros((dwells.size, 0))
        )
        left, free = set(range(dwells.size)), set(range(len(last)))
        for place in np.argsort(distances, axis=None):
            one, chain = divmod(int(place), len(last))
            if one in left and chain in free and distances[one, chain] < ALIKE:
                found[dwells[one]] = chain
                last[chain] = settings[dwells[one]]
                left.discard(one)
                free.discard(chain)
        for one in sorted(left):
            found[dwells[one]] = len(last)
            last.append(settings[dwells[one]])
    return found


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


def settings_of(driven: NDArray[np.complex128], levels: list[NDArray[np.complex128]]) -> NDArray[np.float64]:
    """How dwells are driven, (D, 1 + s): by the first harmonic of an input, and the means of others."""
    columns = [np.log(np.maximum(np.abs(driven), np.finfo(float).tiny))]
    for level in (each.real for each in levels):
        # A level that varies by less than a hundredth of itself is one.
        varies = np.ptp(level) > 0.01 * np.max(np.abs(level), initial=0.0)
        columns.append(level / np.ptp(level) if varies else np.zeros(level.size))
    return np.stack(columns, axis=1)
