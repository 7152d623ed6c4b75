"""The bench quarter car of the examples: known truth in the stand-in, from two rough roads."""

from collections.abc import Iterator
from pathlib import Path

import pytest

import savgs_ident as si

from .relaxed import with_kept_programs

EXAMPLE = Path(__file__).resolve().parents[1] / "examples/bench"
TRUTH = {"k": 940.0, "c": 8.3, "guide_preload_force": 0.6}


@pytest.fixture(scope="module", autouse=True)
def _relaxed() -> Iterator[None]:
    with with_kept_programs():
        yield


@pytest.mark.slow
def test_friction_of_a_guide_is_found_from_roads_under_a_plant_that_rings() -> None:
    """By a formula that is not quite that of the friction, so that the fit says that it misses."""
    model = si.load_plant(str(EXAMPLE / "bench.py")) + "guide_preload"
    fit = si.fit(model, si.load_campaign(EXAMPLE / "roads.csv.gz", layout=model.layout))
    for name, true in TRUTH.items():
        assert abs(fit[name].value - true) < 2.0 * fit[name].stderr, name
        assert fit[name].stderr < 0.1 * true, name
    assert not fit.trusted
    assert "diagnose" in fit.doubts[0]
