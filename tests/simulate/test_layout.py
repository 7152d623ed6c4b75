"""How the nodes of dwells share flat arrays."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.simulate.mesh import CHUNK, Layout, layout_for, only_dwells, uniform_mesh

_layouts = st.lists(st.integers(1, 6), min_size=1, max_size=8).map(
    lambda chunks: Layout(tuple(CHUNK * count for count in chunks))
)


@given(layout=_layouts)
def test_each_dwell_is_a_ring_of_its_own(layout: Layout) -> None:
    first = 0
    for dwell, count in enumerate(layout.counts):
        ring = np.arange(first, first + count)
        assert layout.starts[dwell] == first
        assert np.array_equal(np.flatnonzero(layout.dwell == dwell), ring)
        assert np.array_equal(layout.following[ring], np.roll(ring, -1))
        assert np.array_equal(layout.preceding[ring], np.roll(ring, 1))
        first += count
    assert layout.total == first


@given(layout=_layouts)
def test_the_chunk_table_lists_the_chunks_of_each_dwell_in_order(layout: Layout) -> None:
    """Row by row, without what is absent, it counts the chunks through; the rest points behind the last."""
    table, chunks = layout.chunk_table, layout.total // CHUNK
    rows = [row[row < chunks] for row in table]
    assert np.array_equal(np.concatenate(rows), np.arange(chunks))
    assert [row.size * CHUNK for row in rows] == list(layout.counts)
    for row, present in zip(table, rows, strict=True):
        assert np.array_equal(row[: present.size], present)
        assert np.all(row[present.size :] == chunks)
        assert np.all(layout.dwell[present * CHUNK] == layout.dwell[present[0] * CHUNK])


@given(
    frequency=st.lists(st.floats(0.05, 20.0), min_size=1, max_size=10),
    nodes=st.integers(1, 600),
    slow=st.floats(0.1, 5.0),
)
def test_slow_dwells_get_nodes_in_proportion_to_their_period(
    frequency: list[float], nodes: int, slow: float
) -> None:
    counts = np.array(layout_for(np.array(frequency), nodes, slow).counts)
    wanted = np.array([nodes * max(1.0, slow / each) for each in frequency])
    assert np.all(counts % CHUNK == 0)
    assert np.all(counts >= wanted - 1e-6)
    assert np.all(counts < wanted + CHUNK + 1e-6)


def test_the_loose_ends_are_the_last_nodes_of_what_begins_at_rest() -> None:
    layout = Layout((2 * CHUNK, CHUNK, 3 * CHUNK), opened=(0, 2))
    assert layout.loose_ends.tolist() == [2 * CHUNK - 1, 6 * CHUNK - 1]
    assert Layout(layout.counts).loose_ends.size == 0
    finer = layout.finer(3)
    assert finer.counts == (6 * CHUNK, 3 * CHUNK, 9 * CHUNK)
    assert finer.opened == layout.opened
    assert only_dwells(uniform_mesh(layout), (2, 1)).layout == Layout((3 * CHUNK, CHUNK), opened=(0,))


def test_layouts_of_equal_counts_are_the_same_static_argument() -> None:
    assert Layout((32, 16)) == Layout((32, 16))
    assert hash(Layout((32, 16))) == hash(Layout((32, 16)))
    assert Layout((32, 16)) != Layout((16, 32))
