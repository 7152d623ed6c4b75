"""JSON and TOML as a tree whose leaves are text: a leaf can be anything, valid or not.

node = grown({"a": [1, 2]}, Syntax.json)      # [("a", ["1", "2"])] as Table and list
written(node, Syntax.json)                    # '{"a": [1, 2]}'
"""

import json
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

from numpy.random import Generator

from fuzz.mutators import tokens
from fuzz.mutators.raw import set_bytes


class Syntax(StrEnum):
    """Which of the two."""

    json = "json"
    toml = "toml"


@dataclass
class Table:
    """Names and values in order; a name may be there twice."""

    pairs: list[tuple[str, "Node"]]


Node = Table | list["Node"] | str


def damage_json(content: bytes, random: Generator) -> bytes:
    """A JSON document with a value, a name or an entry that is not what it was; bytes of what is none."""
    try:
        document = json.loads(content)
    except (ValueError, RecursionError):
        return set_bytes(content, random)
    return _damaged(document, Syntax.json, random)


def damage_toml(content: bytes, random: Generator) -> bytes:
    """The same of a TOML document."""
    return _damaged(tomllib.loads(content.decode()), Syntax.toml, random)


def damage_lines(content: bytes, random: Generator) -> bytes:
    """The same of a line or two of JSON lines, or lines lost, doubled or swapped."""
    lines = content.splitlines(keepends=True)
    at = int(random.integers(len(lines)))
    match int(random.integers(6)):
        case 0:
            del lines[at]
        case 1:
            lines.insert(at, lines[int(random.integers(len(lines)))])
        case 2:
            lines.reverse()
        case _:
            lines[at] = damage_json(lines[at], random) + b"\n"
    return b"".join(lines)


def _damaged(document: object, syntax: Syntax, random: Generator) -> bytes:
    root = grown(document, syntax)
    if not _children(root):
        return tokens.JSON[int(random.integers(len(tokens.JSON)))].encode("utf-8", "surrogatepass")
    for _ in range(int(random.choice([1, 1, 1, 2, 3]))):
        chosen = random.choice(len(_WAYS))
        _WAYS[int(chosen)](_somewhere(root, random), syntax, random)
    return written(root, syntax).encode("utf-8", "surrogatepass")


def grown(value: object, syntax: Syntax) -> Node:
    """The tree of a parsed document."""
    if isinstance(value, dict):
        return Table([(str(name), grown(each, syntax)) for name, each in value.items()])
    if isinstance(value, list):
        return [grown(each, syntax) for each in value]
    if isinstance(value, float) and syntax is Syntax.toml:
        return repr(value)
    return json.dumps(value, ensure_ascii=False)


def written(node: Node, syntax: Syntax) -> str:
    """The text of a tree."""
    if syntax is Syntax.toml and isinstance(node, Table):
        return "".join(f"{_name(name)} = {_inline(each, syntax)}\n" for name, each in node.pairs)
    return _inline(node, syntax)


def _inline(node: Node, syntax: Syntax) -> str:
    if isinstance(node, str):
        return node
    if isinstance(node, list):
        return "[" + ", ".join(_inline(each, syntax) for each in node) + "]"
    mark = ": " if syntax is Syntax.json else " = "
    return "{" + ", ".join(_name(name) + mark + _inline(each, syntax) for name, each in node.pairs) + "}"


def _name(name: str) -> str:
    return json.dumps(name, ensure_ascii=False)


def _somewhere(root: Node, random: Generator) -> Table | list[Node]:
    """A table or list that is not empty, near the top as often as far down."""
    here = root
    while True:
        assert not isinstance(here, str)
        below = [each for each in _children(here) if not isinstance(each, str) and _children(each)]
        if not below or random.random() < 0.35:
            return here
        here = below[int(random.integers(len(below)))]


def _children(node: Node) -> list[Node]:
    if isinstance(node, str):
        return []
    return node if isinstance(node, list) else [each for _, each in node.pairs]


Place = Table | list[Node]
Way = Callable[[Place, Syntax, Generator], None]


def _replace(at: Place, syntax: Syntax, random: Generator) -> None:
    values = tokens.JSON if syntax is Syntax.json else tokens.TOML
    _put(at, int(random.integers(len(_children(at)))), values[int(random.integers(len(values)))])


def _drop(at: Place, syntax: Syntax, random: Generator) -> None:
    entries = at if isinstance(at, list) else at.pairs
    if len(entries) > 1:
        del entries[int(random.integers(len(entries)))]


def _double(at: Place, syntax: Syntax, random: Generator) -> None:
    if isinstance(at, list):
        at.append(at[int(random.integers(len(at)))])
    else:
        at.pairs.append(at.pairs[int(random.integers(len(at.pairs)))])


def _swap(at: Place, syntax: Syntax, random: Generator) -> None:
    one, other = (int(each) for each in random.integers(len(_children(at)), size=2))
    values = _children(at)
    first, second = values[one], values[other]
    _put(at, one, second)
    _put(at, other, first)


def _rename(at: Place, syntax: Syntax, random: Generator) -> None:
    if isinstance(at, list):
        return _replace(at, syntax, random)
    names = ["", "x", "a\nb", "\x1b[31m", "<b>", "../x", "value", "n" * 20_000, "schema", "__init__"]
    place = int(random.integers(len(at.pairs)))
    at.pairs[place] = (names[int(random.integers(len(names)))], at.pairs[place][1])
    return None


def _wrap(at: Place, syntax: Syntax, random: Generator) -> None:
    place = int(random.integers(len(_children(at))))
    _put(at, place, [_children(at)[place]])


def _as_text(at: Place, syntax: Syntax, random: Generator) -> None:
    place = int(random.integers(len(_children(at))))
    _put(at, place, _name(_inline(_children(at)[place], syntax)[:50]))


def _put(at: Place, place: int, node: Node) -> None:
    if isinstance(at, list):
        at[place] = node
    else:
        at.pairs[place] = (at.pairs[place][0], node)


_WAYS: tuple[Way, ...] = (
    _replace,
    _replace,
    _replace,
    _replace,
    _drop,
    _double,
    _swap,
    _rename,
    _wrap,
    _as_text,
)
