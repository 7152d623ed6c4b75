"""What has a law of one function at its port, checked on any plant."""

from collections.abc import Mapping

import numpy as np

from savgs_ident.diagnosis.dwell_problem import DwellProblem
from savgs_ident.inference.observations import Data
from savgs_ident.simulate.periodic import PeriodicSolution


def assert_a_law_of_one_function(
    plant: DwellProblem,
    data: Data,
    values: Mapping[str, float],
    start: PeriodicSolution,
    effect: str,
    port: str,
) -> None:
    """One law at ``port`` that consists of one function changes the rows in proportion to what ``effect`` does.

    ``start`` is the baseline's motion at ``values``.
    """
    places = plant.locations((), values, start)
    (place,) = (each for each in places if each.name == port)
    (term,) = (each for each in plant.candidates if each.name == effect)
    (columns,) = plant.sensitivities((), values, start, [term])
    change = columns[0][:, 0] / data.discrepancy_scale
    laws = [each.columns[:, 0] / data.discrepancy_scale for each in place.laws if each.columns.shape[1] == 1]
    alike = [abs(law @ change) / np.linalg.norm(law) for law in laws if np.any(law)]
    assert max(alike) > 0.9999 * np.linalg.norm(change)
