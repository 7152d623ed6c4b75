"""Time nodes of periodic solutions: dense where the acceleration moves fast, those of all dwells in flat arrays.

A friction that sticks turns the acceleration round within a few milliseconds of a period that may last two
seconds. Equal steps waste nodes; here the nodes follow the arc length of the acceleration in an earlier,
coarser solution: half of them are spread evenly over the period, half in proportion to how much the
accelerations change. The map from node number to time is smooth, so that sums over the nodes, weighted with
the map's own derivative, converge as fast as they do on equal steps.

A slow dwell needs more nodes than a fast one, because its reversals take the same few milliseconds of a longer period
(:class:`Layout`). The nodes of all dwells stand one after the other, so that the model is evaluated once for all of
them; chunks of equal length are what the linear algebra runs over in parallel.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

CHUNK = 16
"""Nodes in a chunk."""


class NodeOrder(Protocol):
    """Which of P nodes follows which, and to which of D dwells it belongs: of a layout, or of a part of it."""

    @property
    def dwell(self) -> NDArray[np.intp] | Array:
        """Dwell of each node, (P,)."""

    @property
    def following(self) -> NDArray[np.intp] | Array:
        """The next node of the same dwell, cyclically, (P,)."""

    @property
    def preceding(self) -> NDArray[np.intp] | Array:
        """The node before, cyclically, (P,)."""

    @property
    def chunk_table(self) -> NDArray[np.intp] | Array:
        """Chunks of each dwell in order, (D, most); absent ones point behind the last chunk."""

    @property
    def chunk_place(self) -> NDArray[np.intp] | Array:
        """Where each chunk stands in that table, its rows one after the other, (chunks,)."""

    @property
    def loose(self) -> NDArray[np.bool_] | Array | None:
        """Whether a node leads to no other, (P,); None where all lead to one."""


@dataclass(frozen=True)
class Layout:
    """Nodes per period of D dwells, each a multiple of :data:`CHUNK`; hashable, so that it can be static.

    Attributes:
        counts: nodes of each.
        opened: windows whose last node does not lead back to the first: they begin with a given state.
    """

    counts: tuple[int, ...]
    opened: tuple[int, ...] = ()

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

    def nodes_of(self, dwells: Sequence[int] | NDArray[np.intp]) -> NDArray[np.intp]:
        """The nodes of some dwells, one dwell after the other."""
        ranges = [np.arange(self.starts[d], self.starts[d] + self.counts[d]) for d in dwells]
        return np.concatenate([np.zeros(0, np.intp), *ranges])

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
    def loose(self) -> NDArray[np.bool_] | None:
        """Whether a node is the last one of a window that begins with a given state, (P,); None without such."""
        if not self.opened:
            return None
        found = np.zeros(self.total, np.bool_)
        found[self.loose_ends] = True
        return found

    @property
    def loose_ends(self) -> NDArray[np.intp]:
        """The last nodes of the windows that begin with a given state."""
        places = list(self.opened)
        return self.starts[places] + np.asarray(self.counts)[places] - 1

    def finer(self, times: int) -> "Layout":
        """So many times as many nodes."""
        return Layout(tuple(times * count for count in self.counts), self.opened)

    @cached_property
    def chunk_table(self) -> NDArray[np.intp]:
        """Chunks of each dwell in order, (D, most); absent ones point behind the last chunk."""
        chunks = np.asarray(self.counts) // CHUNK
        first = np.cumsum(chunks) - chunks
        place = np.arange(chunks.max())[None, :]
        return np.where(place < chunks[:, None], first[:, None] + place, chunks.sum())

    @cached_property
    def chunk_place(self) -> NDArray[np.intp]:
        """Where each chunk stands in :attr:`chunk_table`, its rows one after the other, (chunks,)."""
        return np.flatnonzero(self.chunk_table < self.total // CHUNK)


def layout_for(frequency: NDArray[np.float64], nodes: int, slow: float) -> Layout:
    """``nodes`` per period, more in proportion to the period below the frequency ``slow`` [Hz].

    ``frequency`` [Hz] is that of each dwell on the time scale of its plant, (D,).
    """
    wanted = nodes * np.maximum(1.0, slow / np.asarray(frequency))
    return Layout(tuple(int(count) for count in CHUNK * np.ceil(wanted / CHUNK)))


def over_dwells(values: Float[Array, " P"], layout: NodeOrder) -> Float[Array, " D"]:
    """The largest value in each dwell, in its unit; infinite where one is NaN."""
    finite = jnp.where(jnp.isnan(values), jnp.inf, values)
    return jax.ops.segment_max(finite, layout.dwell, len(layout.chunk_table), indices_are_sorted=True)


SPREAD = 0.5
"""Share of the nodes that follows the accelerations; the rest is spread evenly."""

_FINE = 2048
_SMOOTHING = 1.0 / 160.0
_SMOOTHING_TIME = 3e-3


class Mesh(NamedTuple):
    """Nodes over one period of every dwell, flat as ``layout`` says.

    Attributes:
        layout: how many nodes belong to which dwell.
        phase: phase of the nodes [rad], (P,), growing from 0 in every dwell.
        gap: phase from each node to the next, cyclically [rad], (P,); sums to 2 pi over a dwell.
        weight: quadrature weights of the mean over the period [1], (P,); sum to 1 over a dwell.
    """

    layout: Layout
    phase: Float[Array | np.ndarray, " P"]
    gap: Float[Array | np.ndarray, " P"]
    weight: Float[Array | np.ndarray, " P"]


ONE_BY_ONE = 16
"""So many orders are multiplied one by one; as many at a time are turned on from there."""


def waves(
    phase: Float[Array | np.ndarray, " P"], orders: int
) -> tuple[Float[Array, "K P"], Float[Array, "K P"]]:
    """cos(k phase) and sin(k phase) [1] of phases [rad] and orders k = 0..``orders``, by multiplication.

    Cosines of each order would cost more than a motion, and so would powers of complex numbers, of which the compiler
    makes no vectors.
    """
    once = jnp.asarray(phase)
    cosines, sines = _multiples(once, min(orders + 1, ONE_BY_ONE))
    if orders < ONE_BY_ONE:
        return cosines, sines
    far = _multiples(ONE_BY_ONE * once, orders // ONE_BY_ONE + 1)
    further_cosines, further_sines = (each[:, None] for each in far)
    found = (
        further_cosines * cosines - further_sines * sines,
        further_sines * cosines + further_cosines * sines,
    )
    c, s = (each.reshape(-1, once.size)[: orders + 1] for each in found)
    return c, s


def _multiples(angle: Float[Array, " P"], count: int) -> tuple[Float[Array, "n P"], Float[Array, "n P"]]:
    """Cosines and sines of 0, 1, 2, ... times an angle.

    In a loop: written out, the compiler would multiply the first ones again for each of the others.
    """
    cosine, sine = jnp.cos(angle), jnp.sin(angle)

    def turn(now: tuple[Array, Array], _: None) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        c, s = now
        return (c * cosine - s * sine, s * cosine + c * sine), now

    nought = jnp.ones_like(angle), jnp.zeros_like(angle)
    return jax.lax.scan(turn, nought, None, length=count)[1]


def only_dwells(mesh: Mesh, dwells: Sequence[int] | NDArray[np.intp]) -> Mesh:
    """The nodes of some of the dwells."""
    nodes = mesh.layout.nodes_of(dwells)
    places = [int(d) for d in dwells]
    opened = tuple(here for here, d in enumerate(places) if d in mesh.layout.opened)
    layout = Layout(tuple(mesh.layout.counts[d] for d in places), opened)
    return Mesh(layout, *(np.asarray(each)[nodes] for each in mesh[1:]))


def uniform_mesh(layout: Layout) -> Mesh:
    """Equal steps in every dwell."""
    return _stack(layout, [2.0 * np.pi * np.arange(count) / count for count in layout.counts])


def places_between(old: Mesh, new: Mesh) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Where the nodes of one mesh lie among those of another: the node before, (P,), and the share of its step."""
    # All dwells at a time: each has a turn of its own.
    known, wanted = (2.0 * np.pi * each.layout.dwell + np.asarray(each.phase) for each in (old, new))
    first, count = old.layout.starts[new.layout.dwell], np.asarray(old.layout.counts)[new.layout.dwell]
    before = np.clip(np.searchsorted(known, wanted, side="right") - 1, first, first + count - 1)
    return before, (wanted - known[before]) / np.asarray(old.gap)[before]


def adapted_mesh(
    mesh: Mesh, accelerations: NDArray[np.float64], frequency: NDArray[np.float64], layout: Layout
) -> Mesh:
    """Nodes that follow ``accelerations`` (A, P) known on an earlier ``mesh``, dwells at ``frequency`` [Hz].

    The frequency is that on the time scale of the plant.
    The accelerations may have any units: each counts by the share of its own total variation.
    """
    rates = np.abs(accelerations[:, mesh.layout.following] - accelerations)
    width = np.minimum(_SMOOTHING, _SMOOTHING_TIME * frequency)
    starts = mesh.layout.starts
    totals = np.maximum(np.add.reduceat(rates, starts, axis=1), np.finfo(float).tiny)
    share = (rates / totals[:, mesh.layout.dwell]).mean(axis=0)
    parts = zip(
        np.split(np.asarray(mesh.phase), starts[1:]),
        np.split(share, starts[1:]),
        width,
        layout.counts,
        strict=True,
    )
    return _stack(layout, [_nodes_of_dwell(*each) for each in parts])


def _nodes_of_dwell(phase: np.ndarray, share: np.ndarray, width: float, nodes: int) -> np.ndarray:
    """Phases at which the cumulative node density passes 0, 1/N, 2/N, ..."""
    grid = 2.0 * np.pi * np.arange(_FINE + 1) / _FINE
    edges = np.append(phase, phase[0] + 2.0 * np.pi)
    cumulative = np.append(0.0, np.cumsum(share))
    density = np.maximum(_smoothed(np.diff(np.interp(grid, edges, cumulative)), width), 0.0)
    followed = np.append(0.0, np.cumsum(density)) / max(density.sum(), np.finfo(float).tiny)
    total = (1.0 - SPREAD) * grid / (2.0 * np.pi) + SPREAD * followed
    return np.interp(np.arange(nodes) / nodes, total / total[-1], grid)


def _smoothed(density: np.ndarray, width: float) -> np.ndarray:
    """Periodic Gaussian smoothing over a fraction of the period."""
    order = np.fft.rfftfreq(density.size, d=1.0 / density.size)
    return np.fft.irfft(np.fft.rfft(density) * np.exp(-2.0 * (np.pi * order * width) ** 2), density.size)


def _stack(layout: Layout, rows: list[np.ndarray]) -> Mesh:
    gaps = [np.diff(phase, append=phase[0] + 2.0 * np.pi) for phase in rows]
    return Mesh(layout, *(np.concatenate(part) for part in (rows, gaps, [_weights(phase) for phase in rows])))


def _weights(phase: np.ndarray) -> np.ndarray:
    """d(phase)/d(node number), spectrally, as a share of the period."""
    nodes = phase.size
    spectrum = np.fft.rfft(phase - 2.0 * np.pi * np.arange(nodes) / nodes)
    order = np.arange(spectrum.size)
    order[-1] = 0
    return (1.0 + np.fft.irfft(1j * order * spectrum, nodes)) / nodes
