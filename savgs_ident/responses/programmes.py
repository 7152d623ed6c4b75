"""Which dwells of a campaign are driven alike: those of one programme.

A campaign that repeats its frequencies at other amplitudes of the first input, or at other levels of the others, is
several programmes in one. A line through all its dwells would go up and down between them.
"""

import numpy as np
from numpy.typing import NDArray

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


def settings_of(driven: NDArray[np.complex128], levels: list[NDArray[np.complex128]]) -> NDArray[np.float64]:
    """How dwells are driven, (D, 1 + s): by the first harmonic of an input, and the means of others."""
    columns = [np.log(np.maximum(np.abs(driven), np.finfo(float).tiny))]
    for level in (each.real for each in levels):
        # A level that varies by less than a hundredth of itself is one.
        varies = np.ptp(level) > 0.01 * np.max(np.abs(level), initial=0.0)
        columns.append(level / np.ptp(level) if varies else np.zeros(level.size))
    return np.stack(columns, axis=1)
