"""Toy problems whose posterior is known, and compiled programs kept from one run of the tests to the next."""

from collections.abc import Iterator

import pytest

from ..relaxed import with_kept_programs
from .toy import Toy, bent_toy
from .toy_reference import Reference, reference_of
from .toy_surrogate import Stand, stand_for


@pytest.fixture(scope="package", autouse=True)
def _as_users_have_it() -> Iterator[None]:
    with with_kept_programs():
        yield


@pytest.fixture(scope="package")
def bent() -> Toy:
    """A model that bends, of which not every point has a solution."""
    return bent_toy()


@pytest.fixture(scope="package")
def rough(bent: Toy) -> Stand:
    """A surrogate for it whose slopes are a tenth too large and that knows half of the bend."""
    return stand_for(bent, slope_share=1.1, bend_share=0.5)


@pytest.fixture(scope="package")
def reference(bent: Toy, rough: Stand) -> Reference:
    """Its posterior by importance sampling, without the code under test."""
    return reference_of(bent, rough.point)
