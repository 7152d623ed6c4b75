"""A process that compiles without end would be ended by the system; programs are let go before that."""

import jax
import jax.numpy as jnp
import pytest

from savgs_ident.simulate import compilation
from savgs_ident.simulate.compilation import make_room_for_programs, mapped_regions

PROGRAMS = 30

if mapped_regions() == 0:
    pytest.skip("this system does not tell what is mapped", allow_module_level=True)


def _compile(programs: int) -> None:
    for number in range(programs):
        jax.jit(lambda x, n=number: jnp.cumsum(jnp.sin(n * x)))(jnp.ones(number + 2)).block_until_ready()


def test_programs_are_let_go_where_they_are_many(monkeypatch: pytest.MonkeyPatch) -> None:
    before = mapped_regions()
    _compile(PROGRAMS)
    full = mapped_regions()
    assert full > before + PROGRAMS
    monkeypatch.setattr(compilation, "MANY_REGIONS", full - 1)
    make_room_for_programs()
    assert mapped_regions() < full - PROGRAMS


def test_programs_are_kept_while_there_is_room(monkeypatch: pytest.MonkeyPatch) -> None:
    _compile(PROGRAMS)
    full = mapped_regions()
    monkeypatch.setattr(compilation, "MANY_REGIONS", full + PROGRAMS)
    make_room_for_programs()
    assert mapped_regions() > full - PROGRAMS
