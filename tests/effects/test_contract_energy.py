"""No mechanism of the catalogue gives energy over a cycle: a friction takes it, a spring gives back what it took.

Whether there is energy to speak of is decided by kind: forces, friction limits, compliances; changed numbers, plates
and sensors that err are no mechanisms.
"""

import numpy as np
import pytest

from savgs_ident.effects.effect import Effect

from ..in_one_test import over
from ..plants.quarter_car.instants import as_values
from .cycles import along_a_cycle
from .kinds import MECHANISMS, effects_of


@pytest.mark.slow
@over("seed", range(3))
@over("effect", effects_of(*MECHANISMS))
def test_it_adds_no_energy_over_a_cycle(effect: Effect, numbers: dict[str, float], seed: int) -> None:
    """With its internal states back where they were."""
    cycle = along_a_cycle(effect, as_values(numbers), seed)
    assert cycle.open < 1e-6
    assert np.max(np.abs(cycle.power)) > 0.0
    assert np.mean(cycle.power) >= -1e-4 * np.mean(np.abs(cycle.power))
