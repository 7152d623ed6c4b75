"""Dwells that are driven alike are on one line."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.plants.two_mass import PARAMETERS, TwoMass
from savgs_ident.responses.programmes import driven_alike, settings_of
from savgs_ident.simulate.curves import programmes_of
from savgs_ident.simulate.excitation import interpolate_excitation, sine_excitation

HERTZ = np.array([0.8, 1.2, 1.7, 2.4, 3.4, 4.8])


def settings(amplitude: object, *levels: object) -> np.ndarray:
    return settings_of(np.asarray(amplitude, complex), [np.asarray(each, complex) for each in levels])


def test_a_campaign_of_one_programme_is_one_line_whatever_its_amplitudes() -> None:
    assert not driven_alike(HERTZ, settings(0.004 / HERTZ**2)).any()
    assert not driven_alike(HERTZ, settings(np.geomspace(1.0, 1e-3, 6))).any()


@given(st.permutations(range(15)), st.floats(0.0, 0.4))
def test_amplitudes_and_levels_are_told_apart_in_any_order(order: list[int], falls: float) -> None:
    """Two amplitudes, the larger one at two levels and not at the highest frequency, falling with frequency."""
    frequency = np.concatenate([HERTZ, HERTZ[:5], HERTZ[1:5]])
    amplitude = np.repeat([0.005, 0.012, 0.012], [6, 5, 4]) * frequency**-falls
    level = np.repeat([0.0, 0.0, 0.5], [6, 5, 4]) + 1e-3 * np.cos(frequency)
    wanted = np.repeat([0, 1, 2], [6, 5, 4])
    found = driven_alike(frequency[order], settings(amplitude[order], level[order]))
    pairs = {(int(a), int(b)) for a, b in zip(wanted[order], found, strict=True)}
    assert len(pairs) == 3
    assert {a for a, _ in pairs} == {b for _, b in pairs} == {0, 1, 2}


@pytest.mark.parametrize("step", [1e-5, 1e-3, 3e-3, 5e-3, 0.01])
def test_a_fine_grid_of_frequencies_is_one_line(step: float) -> None:
    fine = 5.0 * np.exp(step * np.arange(60))
    assert not driven_alike(fine, settings(np.full(60, 0.004))).any()
    assert not driven_alike(np.repeat(fine, 2), settings(np.full(120, 0.004))).any()


def test_a_level_that_hardly_varies_is_one_level() -> None:
    twice = np.repeat(HERTZ, 2)
    noise = 1.5707 + 1e-3 * np.sin(np.arange(12.0))
    found = driven_alike(twice, settings(np.tile([0.01, 0.03], 6), noise))
    np.testing.assert_array_equal(found, np.tile(found[:2], 6))
    assert set(found) == {0, 1}


def test_between_dwells_the_inputs_are_those_of_their_own_programme() -> None:
    plain = sine_excitation(TwoMass(), PARAMETERS, np.repeat(HERTZ, 2), {"road_height": 1.0})
    sizes = np.tile([0.004, 0.012], 6)
    driven = np.asarray(plain.harmonics["road_height"]) * sizes[:, None]
    excitation = plain._replace(harmonics={"road_height": driven})
    lines = programmes_of(TwoMass(), excitation)
    added = interpolate_excitation(excitation, lines)
    found = np.abs(np.asarray(added.harmonics["road_height"])[:, 1])
    assert np.asarray(added.frequency).size == 12
    assert np.all(np.diff(np.asarray(added.frequency)) >= 0.0)
    np.testing.assert_allclose(np.sort(found), np.repeat([0.004, 0.012], 6))
