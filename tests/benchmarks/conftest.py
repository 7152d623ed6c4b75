"""JAX as users have it, with programs kept from one run of the tests to the next."""

from collections.abc import Iterator

import pytest

from ..relaxed import with_kept_programs


@pytest.fixture(scope="package", autouse=True)
def _as_users_have_it() -> Iterator[None]:
    with with_kept_programs():
        yield
