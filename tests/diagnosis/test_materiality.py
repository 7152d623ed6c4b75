"""What an effect or a learned law does to the response, beside the parameters that move with it."""

from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

from savgs_ident.core.status import Status
from savgs_ident.diagnosis.materiality import change_by_law, change_of, change_without
from savgs_ident.diagnosis.thresholds import DEFAULTS
from savgs_ident.inference.observations import Prediction

from .toy import TERMS, ToyPlant, draw

A_BEST = 1.2
"""The tolerance where the law is fitted [N]; where nothing is added it is 1."""


class Plant(ToyPlant):
    """The line and its bend; it has no solution where the tolerance is negative."""

    catalogue: ClassVar = {"bend": SimpleNamespace(parameters=TERMS[0].amplitudes)}

    @property
    def channel(self) -> NDArray[np.intp]:
        return np.zeros(self.x.size, dtype=np.intp)

    def predict(self, terms: Any, values: Any, names: Any, warm_start: Any) -> Prediction:
        found = super().predict(terms, values, names, warm_start)
        status = Status.CONVERGED if values.get("a", 1.0) > 0.0 else Status.NOT_FINITE
        return Prediction(found.rows, found.find_slopes, status, warm_start)


PLANT = Plant()


def _fit(values: dict[str, float], *terms: str) -> Any:
    return SimpleNamespace(terms=terms, values=values, prediction=PLANT.predict(terms, values, (), None))


PROBLEM: Any = SimpleNamespace(
    plant=PLANT, data=draw(PLANT, {}, 1e-3, seed=1), base=_fit({"a": 1.0}), constants=DEFAULTS
)


def _share(rows: NDArray[np.float64]) -> float:
    """The size of rows as a share of the recording, all tests of which are alike."""
    return float(np.linalg.norm(rows) / np.linalg.norm(PROBLEM.data.measured))


@pytest.mark.parametrize(("c", "matters"), [(1e-4, False), (0.1, True)])
def test_a_law_and_an_effect_matter_by_what_they_do_beside_their_parameters(c: float, matters: bool) -> None:
    """The tolerance that moves with them makes a fifth of the response, whatever they do themselves."""
    fit = _fit({"a": A_BEST, "c": c}, "bend")
    law: Any = SimpleNamespace(mode=fit)
    assert change_of(PROBLEM, fit.prediction.rows - PROBLEM.base.prediction.rows).matters(DEFAULTS)
    for change in (change_by_law(PROBLEM, law), change_without(PROBLEM, fit, ("bend",))):
        assert change.overall == pytest.approx(_share(c * PLANT.x**2), rel=1e-9)
        assert change.in_one_test == pytest.approx(change.overall, rel=0.01)
        assert change.matters(DEFAULTS) == matters


def test_what_has_no_solution_without_its_law_is_changed_without_bound() -> None:
    fit = _fit({"a": -1.0, "c": 0.1}, "bend")
    law: Any = SimpleNamespace(mode=fit)
    assert change_by_law(PROBLEM, law).overall == np.inf
    assert change_without(PROBLEM, fit, ("bend",)).in_one_test == np.inf
    assert change_without(PROBLEM, fit, ()).overall == 0.0
