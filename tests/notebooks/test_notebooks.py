"""The notebooks run from top to bottom, and what they show is what they compute."""

import os
import re
from pathlib import Path

import nbformat
import pytest

NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
CHANCE = 0.15
"""By how much a number may differ on another machine [1]: a chain knows spreads to some per cent."""

COMPILES_MORE_THAN_IT_COMPUTES = ("control",)
"""Notebooks whose programs run a few times each: compiled in half the time, they are slower by less."""

NOTEBOOKS = sorted((Path(__file__).parents[2] / "notebooks").glob("*.ipynb"))


def _printed(notebook: nbformat.NotebookNode) -> list[str]:
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    return [output.text for output in outputs if output.output_type == "stream" and output.name == "stdout"]


def _pictures(notebook: nbformat.NotebookNode) -> int:
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    return sum("image/png" in output.get("data", {}) for output in outputs)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_stored_with_its_results_and_without_errors(path: Path) -> None:
    notebook = nbformat.read(path, as_version=4)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert [cell.execution_count for cell in code] == list(range(1, len(code) + 1))
    assert _pictures(notebook) >= 3
    kinds = {(output.output_type, output.get("name")) for cell in code for output in cell.outputs}
    assert ("stream", "stderr") not in kinds
    assert "error" not in {kind for kind, _ in kinds}


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_prints_what_is_stored_in_it(path: Path) -> None:
    # Not among what the fast tests need.
    from nbclient import NotebookClient

    kept = nbformat.read(path, as_version=4)
    fresh = nbformat.read(path, as_version=4)
    # JAX as users have it, without the strictness of the tests, which a kernel would inherit.
    environment = {name: value for name, value in os.environ.items() if not name.startswith("JAX_")}
    if path.stem in COMPILES_MORE_THAN_IT_COMPUTES:
        environment["JAX_DISABLE_MOST_OPTIMIZATIONS"] = "1"
    NotebookClient(fresh, timeout=900, kernel_name="python3").execute(env=environment)
    for now, before in zip(_printed(fresh), _printed(kept), strict=True):
        # Columns are as wide as their numbers.
        words = [[" ".join(part.split()) for part in NUMBER.split(text)] for text in (now, before)]
        assert words[0] == words[1]
        numbers, known = ([float(each) for each in NUMBER.findall(text)] for text in (now, before))
        assert numbers == pytest.approx(known, rel=CHANCE)
    assert _pictures(fresh) == _pictures(kept)
