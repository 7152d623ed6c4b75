"""JSON messages by columns and one by one: the same numbers, and what one way refuses the other says why."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.recordings.mcap_json import JsonDecoder
from savgs_ident.recordings.mcap_records import DecodeError, MessageBlock

KEYS = ("height", "imu.accel", "at.rest")
FIRST = {"height": 1.5, "imu": {"accel": -2.0}, "at.rest": 0.5, "note": "x"}


class _OneByOne(JsonDecoder):
    def _by_columns(self, block, keys):
        return None


def block_of(texts: list[bytes], between: bytes = b"........") -> MessageBlock:
    """Messages with the bytes of their records before them, those of another topic between."""
    data, starts, stops = b"", [], []
    for text in texts:
        data += between
        starts.append(len(data))
        data += text
        stops.append(len(data))
    zero = np.zeros(len(texts), dtype=np.int64)
    return MessageBlock(data, np.array(starts), np.array(stops), zero, zero)


numbers = st.none() | st.floats(allow_nan=False, allow_infinity=False) | st.integers(-(10**30), 10**30)
stamps = st.fixed_dictionaries({}, optional={"sec": st.integers(0, 2**62), "nanosec": st.integers(0, 10**9)})
messages = st.fixed_dictionaries(
    {"note": st.text(max_size=5)},
    optional={
        "height": numbers,
        "at.rest": numbers,
        "imu": st.none() | st.fixed_dictionaries({}, optional={"accel": numbers}),
        "header": st.fixed_dictionaries({"stamp": stamps}),
    },
)


@given(
    st.lists(messages, max_size=6),
    st.booleans(),
    st.binary(min_size=1, max_size=12),
    st.sampled_from((None, " ")),
)
def test_both_ways_give_the_same(later, stamped, between, indent) -> None:
    """Whatever later messages lack, hold as null or as integers, and however they are written."""
    first = FIRST | ({"header": {"stamp": {"sec": 5, "nanosec": 7}}} if stamped else {})
    texts = [json.dumps(each, indent=indent).encode() for each in (first, *later)]
    block = block_of(texts, between)
    found, times = JsonDecoder("/t", b"{}").decode(block, KEYS)
    expected, known = _OneByOne("/t", b"{}").decode(block, KEYS)
    for key in KEYS:
        np.testing.assert_array_equal(found[key], expected[key])
    np.testing.assert_array_equal(times, known)


@given(st.lists(st.tuples(st.integers(0, 2**32), st.integers(0, 10**9 - 1)), min_size=1, max_size=6))
def test_stamps_are_integers(times) -> None:
    """Nanoseconds since 1970 are more than a float holds."""
    texts = [
        json.dumps({"height": 1.0, "header": {"stamp": {"sec": sec, "nanosec": rest}}}).encode()
        for sec, rest in times
    ]
    decoder = JsonDecoder("/t", b"{}")
    assert decoder._by_columns(block_of(texts), ["height"]) is not None
    _, stamps = decoder.decode(block_of(texts), ["height"])
    assert stamps.tolist() == [sec * 10**9 + rest for sec, rest in times]


def test_usual_messages_go_by_columns() -> None:
    """Or nothing here would compare the two ways."""
    texts = [json.dumps(FIRST).encode()] * 3
    assert JsonDecoder("/t", b"{}")._by_columns(block_of(texts), KEYS) is not None


def test_paths_of_which_one_goes_on_from_another_are_no_columns() -> None:
    """A later block may lack a field whose name has a dot."""
    block = block_of([b'{"imu": 1.0}'])
    decoder = JsonDecoder("/t", b"{}")
    assert decoder._by_columns(block, ("imu", "imu.accel")) is None
    found, _ = decoder.decode(block, ("imu", "imu.accel"))
    assert found["imu"].tolist() == [1.0]
    assert np.isnan(found["imu.accel"]).all()


@pytest.mark.parametrize(
    "text",
    [
        b"null",
        b"[1]",
        b'{"height": true}',
        b'{"height": "1"}',
        b'{"height": {"x": 1}}',
        b'{"height": 1',
        b'{"height": 1}{"height": 2}',
        b"",
    ],
)
def test_what_is_no_number_is_refused(text: bytes) -> None:
    """And the message is named that it stands in."""
    block = block_of([json.dumps(FIRST).encode(), text])
    with pytest.raises(DecodeError) as refused:
        JsonDecoder("/t", b"{}").decode(block, ["height"])
    assert refused.value.index == 1
