"""Sets of functions: what all of one cost, one of them does not."""

from dataclasses import replace

import numpy as np
import pytest

from savgs_ident.diagnosis.localisation import localise
from savgs_ident.diagnosis.thresholds import DEFAULTS
from savgs_ident.effects.base import Family
from savgs_ident.inference.background.port_functions import (
    InputLocation,
    Law,
    laws_of_functions,
    sensor_filters,
)
from savgs_ident.inference.find_map import find_map
from savgs_ident.inference.laplace_fit import search_of

from .toy import ToyPlant, draw

PLANT, NOISE = ToyPlant(), 0.01


def test_a_simple_cause_is_found_at_its_place_and_not_where_few_functions_imitate_it() -> None:
    """x^2 is one function of the spring's many; |x| and x^4 are all that a mass has, and come near it."""
    x = PLANT.x
    search = search_of(PLANT, draw(PLANT, {"c": 0.1}, NOISE, 4))
    base = find_map(search, (), {}, None)
    many = np.stack([x**2, *(np.sin(k * x) for k in range(4, 20))], axis=1)
    few = np.stack([np.abs(x), x**4], axis=1)

    def evidence(laws: tuple[Law, ...]) -> float:
        (found,) = localise(search, base, [InputLocation("spring", laws, many)])
        return found.evidence

    imitation = evidence(laws_of_functions(few, (Family.NUMBER,) * 2, DEFAULTS))
    assert evidence((Law(many),)) < imitation
    assert evidence(laws_of_functions(many, (Family.STIFFNESS,) * 17, DEFAULTS)) > imitation + 5.0


@pytest.mark.parametrize("plain", [(), (0, 2)])
@pytest.mark.parametrize("prior", [DEFAULTS.simple_law_prior, 0.3])
def test_simple_laws_are_so_probable_together(plain: tuple[int, ...], prior: float) -> None:
    columns = np.arange(12.0).reshape(3, 4)
    constants = replace(DEFAULTS, simple_law_prior=prior)
    whole, *few = laws_of_functions(columns, (Family.FRICTION,) * 4, constants, plain)
    assert whole.columns is columns
    assert sum(each.prior for each in few) == pytest.approx(prior * whole.prior)
    assert [each.columns.shape[1] for each in few] == [1, 1, 1, 1, *([2] if plain else [])]
    np.testing.assert_array_equal(np.concatenate([each.columns for each in few[:4]], axis=1), columns)


def test_every_family_of_several_functions_has_a_law_of_its_own() -> None:
    families = (Family.FRICTION, Family.DAMPING, Family.FRICTION, Family.STOP)
    columns = np.arange(12.0).reshape(3, 4)
    whole, friction, *alone = laws_of_functions(columns, families, DEFAULTS, (), "rail")
    assert whole.family is None
    assert friction.family is Family.FRICTION
    assert friction.columns.shape[1] == 2
    assert [each.family for each in alone] == list(families)
    assert {each.port for each in (whole, friction, *alone)} == {"rail"}


def test_the_second_filter_of_a_reading_is_a_small_delay() -> None:
    omega, delay = np.array([[0.0, 5.0, 10.0]]), 1e-5
    late = (np.exp(-1j * omega * delay) - 1.0) / -delay
    rate = sensor_filters(omega)[1]
    np.testing.assert_allclose(late * rate[0, 1] / late[0, 1], rate, atol=1e-4 * np.abs(rate).max())
