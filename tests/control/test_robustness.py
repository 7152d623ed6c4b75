"""One controller on many rigs: the nominal one does as designed, and a rig that it cannot hold is told."""

import control
import pytest

from savgs_ident.control.generalised_plant import design_loop
from savgs_ident.control.margins import margins_of
from savgs_ident.control.quarter_car_space import TwoMasses, quarter_car_space
from savgs_ident.control.robustness import examine
from savgs_ident.control.synthesis import Synthesis
from savgs_ident.control.weights import DEFAULT_WEIGHTS


def test_the_nominal_rig_does_what_the_design_promised(
    synthesis: Synthesis, masses: TwoMasses, bandwidth: float
) -> None:
    found = examine(synthesis.controller, [masses], bandwidth, DEFAULT_WEIGHTS)
    assert found.stable
    assert found.peaks[0] == pytest.approx(synthesis.peak, rel=1e-6)
    assert found.margins[0] == margins_of(
        design_loop(quarter_car_space(masses), bandwidth), synthesis.controller
    )


def test_a_rig_that_it_does_not_hold_is_the_worst(
    synthesis: Synthesis, masses: TwoMasses, bandwidth: float
) -> None:
    """An eighth of the chassis: the same strut accelerates it eight times as much, beyond the gain margin."""
    light = masses._replace(mass=masses.mass / 8.0)
    found = examine(synthesis.controller, [masses, light, masses], bandwidth, DEFAULT_WEIGHTS)
    assert not found.stable
    assert [each.stable for each in found.margins] == [True, False, True]
    assert found.peaks[1] == float("inf")
    assert found.worst == 1
    loop = design_loop(quarter_car_space(light), bandwidth)
    closed = control.feedback(loop, synthesis.controller, sign=1)
    assert max(closed.poles().real) > 0.0


def test_the_rigs_are_in_their_order(synthesis: Synthesis, masses: TwoMasses, bandwidth: float) -> None:
    rigs = [masses._replace(k_eq=share * masses.k_eq) for share in (0.95, 1.0, 1.05)]
    together = examine(synthesis.controller, rigs, bandwidth, DEFAULT_WEIGHTS)
    single = [examine(synthesis.controller, [rig], bandwidth, DEFAULT_WEIGHTS).peaks[0] for rig in rigs]
    assert together.peaks == pytest.approx(single)
    assert together.worst == single.index(max(single))
