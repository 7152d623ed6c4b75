"""The sampled and the reduced controller: what they keep, and what they lose at most."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.control.digital import discretise, reduce_order
from savgs_ident.control.synthesis import Synthesis
from savgs_ident.core.errors import InputError

FREQUENCY = np.geomspace(1e-3, 1e3, 300)


@given(rate=st.floats(200.0, 2e4), place=st.floats(0.001, 0.95))
def test_sampling_by_the_bilinear_rule_only_bends_the_frequency(
    synthesis: Synthesis, rate: float, place: float
) -> None:
    """z = exp(i w T) stands for s = (2i/T) tan(w T/2): nothing else may change."""
    turn = place * np.pi
    warped = 2j * rate * np.tan(turn / 2.0)
    found, wanted = discretise(synthesis.controller, rate)(np.exp(1j * turn)), synthesis.controller(warped)
    assert np.abs(found - wanted).max() < 1e-7 * np.abs(wanted).max()


def test_the_sampled_controller_keeps_names_rate_static_gain_and_stability(synthesis: Synthesis) -> None:
    found = discretise(synthesis.controller, 500.0)
    assert (found.input_labels, found.output_labels) == (
        synthesis.controller.input_labels,
        synthesis.controller.output_labels,
    )
    assert found.dt == 1.0 / 500.0
    assert found.dcgain() == pytest.approx(synthesis.controller.dcgain(), rel=1e-8)
    assert np.all(synthesis.controller.poles().real < 0.0)
    assert np.all(np.abs(found.poles()) < 1.0)


def test_a_controller_of_its_full_order_stays_as_it_is(synthesis: Synthesis) -> None:
    full = synthesis.controller
    same = reduce_order(full, full.nstates)
    iw = 2j * np.pi * FREQUENCY
    assert np.abs(same(iw) - full(iw)).max() < 1e-8 * np.abs(full(iw)).max()


@pytest.mark.parametrize("order", [1, 4, 6, 8, 9])
def test_a_reduced_controller_keeps_its_static_gain_and_loses_no_more_than_the_hankel_tail(
    synthesis: Synthesis, order: int
) -> None:
    """Glover's bound: twice the sum of the Hankel singular values that were dropped."""
    full = synthesis.controller
    reduced = reduce_order(full, order)
    assert reduced.nstates == order
    assert reduced.dcgain() == pytest.approx(full.dcgain(), rel=1e-6, abs=1e-8)
    assert (reduced.input_labels, reduced.output_labels) == (full.input_labels, full.output_labels)
    tail = 2.0 * np.sum(np.sort(control.hankel_singular_values(full))[::-1][order:])
    iw = 2j * np.pi * FREQUENCY
    difference = np.linalg.norm(reduced(iw) - full(iw), axis=(0, 1))
    assert np.max(difference) <= tail * (1.0 + 1e-6)


@pytest.mark.parametrize("order", [-1, 0, 11])
def test_an_order_that_is_not_there_is_refused(synthesis: Synthesis, order: int) -> None:
    assert synthesis.controller.nstates == 10
    with pytest.raises(InputError, match=f"cannot be reduced to {order}") as caught:
        reduce_order(synthesis.controller, order)
    assert "between 1 and 10" in caught.value.remedy


@pytest.mark.parametrize("pole", [0.0, 1.0])
def test_an_unstable_controller_is_not_reduced(pole: float) -> None:
    unstable = control.ss(np.diag([pole, -2.0]), np.ones((2, 3)), np.ones((1, 2)), np.zeros((1, 3)))
    with pytest.raises(InputError, match="unstable"):
        reduce_order(unstable, 1)
