"""Damage that needs no knowledge of the form: bits, spans, ends."""

from collections.abc import Callable

from numpy.random import Generator

Mutator = Callable[[bytes, Generator], bytes]


def flip_bits(content: bytes, random: Generator) -> bytes:
    """One to eight bits, anywhere."""
    changed = bytearray(content)
    for _ in range(int(random.integers(1, 9)) if content else 0):
        changed[int(random.integers(len(changed)))] ^= 1 << int(random.integers(8))
    return bytes(changed)


def set_bytes(content: bytes, random: Generator) -> bytes:
    """One to eight bytes of a kind that often matters: 0, 255, the largest of a signed byte."""
    changed = bytearray(content)
    for _ in range(int(random.integers(1, 9)) if content else 0):
        changed[int(random.integers(len(changed)))] = int(random.choice([0, 1, 10, 34, 127, 128, 255]))
    return bytes(changed)


def truncate(content: bytes, random: Generator) -> bytes:
    """The end is missing, from anywhere on."""
    return content[: int(random.integers(len(content) + 1))]


def behead(content: bytes, random: Generator) -> bytes:
    """The beginning is missing."""
    return content[int(random.integers(len(content) + 1)) :]


def delete_span(content: bytes, random: Generator) -> bytes:
    """Some bytes are missing in between."""
    begin, end = _span(content, random)
    return content[:begin] + content[end:]


def duplicate_span(content: bytes, random: Generator) -> bytes:
    """Some bytes are there twice."""
    begin, end = _span(content, random)
    return content[:end] + content[begin:]


def swap_spans(content: bytes, random: Generator) -> bytes:
    """Two neighbouring pieces have changed places."""
    begin, end = _span(content, random)
    middle = int(random.integers(begin, end + 1))
    return content[:begin] + content[middle:end] + content[begin:middle] + content[end:]


def rubbish_behind_head(content: bytes, random: Generator) -> bytes:
    """A good beginning, then anything."""
    head = int(random.integers(min(len(content), 200) + 1))
    return content[:head] + random.bytes(int(random.integers(400)))


def insert_bytes(content: bytes, random: Generator) -> bytes:
    """Some bytes too many."""
    at = int(random.integers(len(content) + 1))
    return content[:at] + random.bytes(int(random.integers(1, 20))) + content[at:]


def _span(content: bytes, random: Generator) -> tuple[int, int]:
    begin = int(random.integers(len(content) + 1))
    longest = int(random.choice([4, 60, 2000]))
    return begin, min(begin + int(random.integers(longest + 1)), len(content))


RAW: tuple[Mutator, ...] = (
    flip_bits, set_bytes, truncate, behead, delete_span, duplicate_span, swap_spans, rubbish_behind_head,
    insert_bytes,
)  # fmt: skip
"""All of them."""
