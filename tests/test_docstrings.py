"""Every public name says what it is: module, class, function; and what the examples show is true."""

import ast
import doctest
import importlib
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "savgs_ident"
SOURCES = sorted(PACKAGE.rglob("*.py"))
EXAMPLES = [
    source
    for source in SOURCES
    if any(">>> " in line and "+SKIP" not in line for line in source.read_text(encoding="utf-8").splitlines())
]

Documented = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


def _public_definitions(tree: ast.Module) -> Iterator[tuple[str, Documented]]:
    yield "the module", tree
    for node in tree.body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and not node.name.startswith("_"):
            yield node.name, node


def _undocumented(source: str) -> list[str]:
    definitions = _public_definitions(ast.parse(source))
    return [name for name, node in definitions if not (ast.get_docstring(node) or "").strip()]


@pytest.mark.parametrize("source", SOURCES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_every_public_name_has_a_docstring(source: Path) -> None:
    assert _undocumented(source.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize("source", EXAMPLES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_the_examples_in_the_docstrings_are_true(source: Path) -> None:
    name = ".".join(source.relative_to(PACKAGE.parent).with_suffix("").parts)
    result = doctest.testmod(importlib.import_module(name.removesuffix(".__init__")))
    assert result.attempted > 0
    assert result.failed == 0


def test_a_missing_docstring_is_found() -> None:
    source = '"""Module."""\ndef bare(): ...\ndef told():\n    """Told."""\nclass Bare: ...\ndef _own(): ...'
    assert _undocumented(source) == ["bare", "Bare"]
    assert _undocumented("def _own(): ...") == ["the module"]
