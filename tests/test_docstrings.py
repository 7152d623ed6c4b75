"""The examples in the docstrings of the package give what stands there."""

import doctest
from importlib import import_module
from pathlib import Path

import pytest

import savgs_ident

PACKAGE = Path(savgs_ident.__path__[0])
WITH_EXAMPLES = sorted(
    ".".join(file.relative_to(PACKAGE.parent).with_suffix("").parts)
    for file in PACKAGE.rglob("*.py")
    if ">>>" in file.read_text(encoding="utf-8")
)


@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_the_examples_of_a_module(name: str) -> None:
    failed, attempted = doctest.testmod(import_module(name))
    assert attempted > 0
    assert failed == 0
