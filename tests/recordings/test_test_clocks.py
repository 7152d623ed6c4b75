"""Samples of tests, and their seconds, which stand where the nanoseconds of the topic stood."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.recordings.mcap_timing import Span
from savgs_ident.recordings.mcap_topics import _samples_of

instants = st.lists(st.integers(0, 60), min_size=1, max_size=40)
spans = st.lists(st.tuples(st.integers(0, 60), st.integers(0, 20)), min_size=1, max_size=4)


@given(instants, spans, st.booleans())
def test_each_test_has_its_samples_and_their_time_from_its_start(times, tests, ordered) -> None:
    """Tests that touch, overlap or have no sample, and clocks that jump."""
    time = 10**18 + np.array(sorted(times) if ordered else times, dtype=np.int64)
    asked = [
        Span(f"t{k}", 10**18 + start, 10**18 + start + length, None)
        for k, (start, length) in enumerate(tests)
    ]
    expected = []
    for span in asked:
        inside = (time >= span.start) & (time <= span.stop)
        expected.append((np.flatnonzero(inside), 1e-9 * (time[inside] - span.start).astype(float)))
    numbers = np.arange(time.size)
    found = _samples_of(asked, time.copy())
    for samples, (where, seconds) in zip(found, expected, strict=True):
        np.testing.assert_array_equal(numbers[samples.where], where)
        np.testing.assert_array_equal(samples.time, seconds)
