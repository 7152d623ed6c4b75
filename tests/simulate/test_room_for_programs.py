"""A process that compiles without end would be ended by the system; programs are let go before that.

Each test has a process of its own: what else a process did decides where new regions of memory come to lie.
"""

import subprocess
import sys

import pytest

from savgs_ident.simulate.program_cache import mapped_regions

pytestmark = pytest.mark.slow

PROGRAMS = 100

_COUNT = """
import jax
import jax.numpy as jnp
from savgs_ident.simulate import program_cache as compilation

before = compilation.mapped_regions()
for number in range({programs}):
    jax.jit(lambda x, n=number: jnp.cumsum(jnp.sin(n * x)))(jnp.ones(number + 2)).block_until_ready()
full = compilation.mapped_regions()
compilation.make_room_for_programs(full + {room}, {memory})
print(before, full, compilation.mapped_regions())
"""

if mapped_regions() == 0:
    pytest.skip("this system does not say what is mapped", allow_module_level=True)


def _regions(room: int, memory: int = 2**40) -> tuple[int, int, int]:
    """Mapped regions before the programs, with them, and after room was made for ``room`` regions less than many."""
    code = _COUNT.format(programs=PROGRAMS, room=room, memory=memory)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    before, full, after = (int(each) for each in done.stdout.split())
    return before, full, after


def test_programs_are_let_go_where_they_are_many() -> None:
    # Threads of the compiler may end meanwhile, and some regions with them.
    before, full, after = _regions(room=-PROGRAMS // 2)
    assert full - before > PROGRAMS
    assert full - after > PROGRAMS


def test_programs_are_kept_while_there_is_room() -> None:
    _, full, after = _regions(room=PROGRAMS)
    assert abs(after - full) < PROGRAMS


def test_programs_are_let_go_where_a_process_has_much_memory() -> None:
    _, full, after = _regions(room=PROGRAMS, memory=2**20)
    assert full - after > PROGRAMS
