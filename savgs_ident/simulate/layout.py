"""How the time nodes of all dwells share flat arrays.

A slow dwell needs more nodes than a fast one: its reversals take the same few milliseconds of a longer
period. The nodes of all dwells stand one after the other in flat arrays, so that the model is evaluated once
for all of them; chunks of equal length are what the linear algebra runs over in parallel.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

CHUNK = 16
"""Nodes in a chunk."""


@dataclass(frozen=True)
class Layout:
    """Nodes per period of D dwells, each a multiple of :data:`CHUNK`; hashable, so that it can be static."""

    counts: tuple[int, ...]

    @property
    def total(self) -> int:
        """Nodes of all dwells, P."""
        return sum(self.counts)

    @property
    def starts(self) -> NDArray[np.intp]:
        """The first node of each dwell, (D,)."""
        return np.cumsum((0, *self.counts[:-1]))

    @cached_property
    def dwell(self) -> NDArray[np.intp]:
        """The dwell of each node, (P,)."""
        return np.repeat(np.arange(len(self.counts)), self.counts)

    @cached_property
    def following(self) -> NDArray[np.intp]:
        """The next node of the same dwell, cyclically, (P,)."""
        after = np.arange(1, self.total + 1)
        after[self.starts + np.asarray(self.counts) - 1] = self.starts
        return after

    @cached_property
    def preceding(self) -> NDArray[np.intp]:
        """The node before, cyclically, (P,)."""
        before = np.arange(-1, self.total - 1)
        before[self.starts] = self.starts + np.asarray(self.counts) - 1
        return before

    @cached_property
    def chunk_table(self) -> NDArray[np.intp]:
        """Chunks of each dwell in order, (D, most); absent ones point behind the last chunk."""
        chunks = np.asarray(self.counts) // CHUNK
        first = np.cumsum(chunks) - chunks
        place = np.arange(chunks.max())[None, :]
        return np.where(place < chunks[:, None], first[:, None] + place, chunks.sum())


def layout_for(frequency: NDArray[np.float64], nodes: int, slow: float) -> Layout:
    """``nodes`` per period, more in proportion to the period below the frequency ``slow`` [Hz].

    ``frequency`` [Hz] is that of each dwell, (D,).
    """
    wanted = nodes * np.maximum(1.0, slow / np.asarray(frequency))
    return Layout(tuple(int(count) for count in CHUNK * np.ceil(wanted / CHUNK)))
