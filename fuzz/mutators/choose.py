"""Which damage is done to an input: of its bytes, of its form, or both."""

from collections.abc import Mapping

from numpy.random import Generator

from fuzz.loader import Form
from fuzz.mutators.arrays import damage_hdf5
from fuzz.mutators.container import damage_mcap
from fuzz.mutators.matlab import damage_matlab
from fuzz.mutators.parquet import damage_parquet
from fuzz.mutators.raw import RAW, Mutator
from fuzz.mutators.sqlite import damage_sqlite
from fuzz.mutators.table import damage_packed, damage_table
from fuzz.mutators.tree import damage_json, damage_lines, damage_toml

OF_FORM: Mapping[Form, Mutator] = {
    Form.json: damage_json,
    Form.lines: damage_lines,
    Form.toml: damage_toml,
    Form.table: damage_table,
    Form.packed_table: damage_packed,
    Form.mcap: damage_mcap,
    Form.hdf5: damage_hdf5,
    Form.matlab: damage_matlab,
    Form.parquet: damage_parquet,
    Form.sqlite: damage_sqlite,
}
"""Damage that knows the form."""

_BYTES_ONLY, _BOTH = 0.3, 0.08


def damage(content: bytes, form: Form, random: Generator) -> tuple[bytes, str]:
    """A good file's content, damaged, and the names of what was done."""
    done = []
    drawn = random.random()
    if drawn >= _BYTES_ONLY:
        content = OF_FORM[form](content, random)
        done.append(OF_FORM[form].__name__)
    if drawn < _BYTES_ONLY + _BOTH:
        way = RAW[int(random.integers(len(RAW)))]
        content = way(content, random)
        done.append(way.__name__)
    return content, " then ".join(done)
