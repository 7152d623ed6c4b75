"""Which dwells of a campaign are driven alike: those of one programme.

A campaign that repeats its frequencies at other amplitudes of the first input, or at other levels of the others, is
several programmes in one. A line through all its dwells would go up and down between them.
"""

import numpy as np
from numpy.typing import NDArray

SAME = 1e-3
"""Frequencies that differ by less than this are one [1]."""

ALIKE = 0.5
"""A programme is followed to a dwell whose amplitude differs from that at the frequency before by less than a factor
exp of this, or whose levels by less than this of their range. Origin: by choice; amplitudes may fall along it."""

REPEATED = 0.05
"""The same of two dwells at one frequency that are one programme: the second repeats the first."""


def driven_alike(frequency: NDArray[np.float64], settings: NDArray[np.float64]) -> NDArray[np.intp]:
    """The programme of each dwell, (D,), counted from 0; one for all where no ``frequency`` [Hz] occurs twice.

    ``settings`` (D, s) are how each is driven, in units in which a difference of one is a large one.
    """
    found, last = np.zeros(frequency.size, np.intp), list[NDArray[np.float64]]()
    order = np.argsort(frequency, kind="stable")
    apart = np.diff(np.log(frequency[order])) > SAME
    if apart.all():
        return found
    for dwells in np.split(order, np.flatnonzero(apart) + 1):
        before = len(last)
        pairs = [
            (float(np.linalg.norm(settings[d] - last[chain])), int(d), chain)
            for d in dwells
            for chain in range(before)
        ]
        placed, taken = dict[int, int](), set[int]()
        for distance, d, chain in sorted(pairs):
            if d not in placed and chain not in taken and distance < ALIKE:
                placed[d] = chain
                taken.add(chain)
        for d in (int(each) for each in dwells):
            same = (
                placed[other] for other in placed if np.linalg.norm(settings[d] - settings[other]) < REPEATED
            )
            if d not in placed:
                placed[d] = next(same, len(last))
            if placed[d] == len(last):
                last.append(settings[d])
        for d, chain in placed.items():
            found[d], last[chain] = chain, settings[d]
    return found


def settings_of(driven: NDArray[np.complex128], levels: list[NDArray[np.complex128]]) -> NDArray[np.float64]:
    """How dwells are driven, (D, 1 + s): by the first harmonic of an input, and the means of others."""
    columns = [np.log(np.maximum(np.abs(driven), np.finfo(float).tiny))]
    for level in (each.real for each in levels):
        # A level that varies by less than a hundredth of itself is one.
        varies = np.ptp(level) > 0.01 * np.max(np.abs(level), initial=0.0)
        columns.append(level / np.ptp(level) if varies else np.zeros(level.size))
    return np.stack(columns, axis=1)
