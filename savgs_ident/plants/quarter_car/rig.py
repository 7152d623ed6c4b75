"""The rig: every number the model takes, with unit, tolerance and source, in one TOML file.

A parameter is one line, so that a change of a number is a change of one line:

    [masses]
    m_s = { value = 320.0, unit = "kg", tolerance = 1.6, lower = 0.0, about = "sprung mass", source = "..." }

``tolerance`` is one standard deviation of what is known beforehand (0: exact, or to be identified). The
damper is a table of force over velocity, compression positive. An identified rig is the same form with one
more table, ``[provenance]``.

    >>> rig = read_rig(default_rig_path())
    >>> rig.parameters["m_s"].value, rig.parameters["m_s"].unit
    (320.0, 'kg')
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import partial
from itertools import pairwise
from math import isfinite
from pathlib import Path
from types import MappingProxyType

import tomlkit
from tomlkit.items import Table

from savgs_ident.core.errors import InputError
from savgs_ident.core.files import write_bytes
from savgs_ident.core.parameter import Parameter, ParameterTable
from savgs_ident.plants.parameter_toml import (
    compose_inline,
    compose_provenance,
    compose_section,
    file_content,
    new_document,
    parse_document,
)
from savgs_ident.plants.quarter_car.rig_toml import (
    DAMPER_SECTION,
    DAMPER_TITLE,
    DAMPER_UNITS,
    EXTRA_SECTION,
    EXTRA_TITLE,
    PROVENANCE_SECTION,
    SCHEMA,
    SECTION_OF,
    SECTIONS,
    UNIT_OF,
    parse_damper,
    parse_name,
    parse_parameters,
    parse_provenance,
)

_PACKAGE = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Rig:
    """One rig, as drawn or as identified.

    Attributes:
        name: short name of the rig.
        parameters: every parameter, SI.
        damper_velocity: velocities of the damper table [m/s], increasing, compression positive, with 0.
        damper_force: damper forces at these [N], never falling, resisting compression positive, 0 at 0.
        provenance: where the numbers come from (data hash, versions, covariance); empty for a drawing.
        source: the file that it was read from, for errors and reports; empty without one.
        sha256: digest of the file's content; empty without one.

    Raises :class:`InputError` for a damper table that is no curve through the origin.
    """

    name: str
    parameters: ParameterTable
    damper_velocity: tuple[float, ...]
    damper_force: tuple[float, ...]
    provenance: Mapping[str, object] = field(default_factory=dict)
    source: str = field(default="", compare=False)
    sha256: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "provenance", MappingProxyType(dict(self.provenance)))
        _check_damper_table(self.damper_velocity, self.damper_force)

    def __reduce__(self) -> tuple[object, ...]:
        # A view of a dictionary cannot be sent to another process.
        values = {each.name: getattr(self, each.name) for each in fields(self)}
        return partial(Rig, **values | {"provenance": dict(self.provenance)}), ()


def default_rig_path() -> Path:
    """The rig file that comes with the package: the rear suspension of a GT on the quarter-car rig."""
    return _shipped("rig/gt_rear.toml")


def default_campaign_path() -> Path:
    """The campaign that comes with the package: 28 dwells, a sweep and a standstill of the nominal rig."""
    return _shipped("campaigns/nominal.csv.gz")


def read_rig(path: str | Path) -> Rig:
    """Read a rig file.

    Raises :class:`InputError`, with file, key, what is wrong and the remedy, for anything that is not a
    complete rig file of the known form.
    """
    return parse_rig(file_content(path), path)


def parse_rig(content: bytes, source: object) -> Rig:
    """The rig in the ``content`` of a rig file that errors call ``source``; raises as :func:`read_rig` does."""
    document = parse_document(content, source)
    try:
        return Rig(
            parse_name(document),
            parse_parameters(document),
            *parse_damper(document),
            parse_provenance(document),
            str(source),
            hashlib.sha256(content).hexdigest(),
        )
    except InputError as error:
        raise InputError(error.what, source=source, remedy=error.remedy) from None


def write_rig(rig: Rig, path: str | Path) -> None:
    """Write a rig file of the same form as the one it was read from, whole or not at all.

    Parameters beyond the form (those of further effects) go into the section ``[effects]``. Raises
    :class:`InputError` if the file cannot be written, a unit is not known, or the provenance holds what TOML
    cannot say.
    """
    write_bytes(Path(path), rig_text(rig).encode())


def rig_text(rig: Rig) -> str:
    """What :func:`write_rig` writes, section by section, one line a parameter; raises as it does."""
    missing = [entry for entry in SECTION_OF if entry not in rig.parameters]
    if missing:
        raise InputError(f"the rig has no parameter '{missing[0]}'", remedy="write a whole rig")
    document = new_document()
    document.add("schema", tomlkit.item(SCHEMA))
    document.add("name", tomlkit.item(rig.name))
    for key, section in SECTIONS.items():
        document.add(key, _section(section.title, [rig.parameters[entry] for entry in section.units]))
    document.add(DAMPER_SECTION, _compose_damper(rig.damper_velocity, rig.damper_force))
    extra = [entry for entry in rig.parameters.entries if entry.name not in SECTION_OF]
    if extra:
        document.add(EXTRA_SECTION, _section(EXTRA_TITLE, extra))
    if rig.provenance:
        document.add(PROVENANCE_SECTION, compose_provenance(rig.provenance))
    return tomlkit.dumps(document)


def _section(title: str, entries: list[Parameter]) -> Table:
    return compose_section(title, [(each, UNIT_OF.get(each.name)) for each in entries])


def _compose_damper(velocity: tuple[float, ...], force: tuple[float, ...]) -> Table:
    table = tomlkit.table()
    table.add(tomlkit.comment(DAMPER_TITLE))
    table.add("velocity", compose_inline({"values": list(velocity), "unit": DAMPER_UNITS["velocity"]}))
    table.add("force", compose_inline({"values": list(force), "unit": DAMPER_UNITS["force"]}))
    table.add(tomlkit.nl())
    return table


def _shipped(relative: str) -> Path:
    # A wheel carries the data inside the package; a checkout (editable install) has it beside the package.
    for root in (_PACKAGE / "data", _PACKAGE.parent / "data"):
        if (root / relative).is_file():
            return root / relative
    raise InputError(f"the shipped file data/{relative} is missing", remedy="install the package again")


def _check_damper_table(velocity: tuple[float, ...], force: tuple[float, ...]) -> None:
    remedy = "give force over velocity through (0, 0), velocity increasing, force never falling"
    if len(velocity) != len(force):
        raise InputError(f"damper has {len(velocity)} velocities and {len(force)} forces", remedy=remedy)
    if len(velocity) < 3:
        raise InputError(f"damper has only {len(velocity)} points", remedy="give at least 3 points")
    if not all(isfinite(value) for value in velocity + force):
        raise InputError("damper has a value that is not finite", remedy="give finite numbers")
    for before, after in pairwise(velocity):
        if after <= before:
            raise InputError(f"damper.velocity does not increase at {after} m/s", remedy=remedy)
    for at, (before, after) in zip(velocity[1:], pairwise(force), strict=True):
        if after < before:
            raise InputError(f"damper.force falls at {at} m/s", remedy=remedy)
    if (0.0, 0.0) not in zip(velocity, force, strict=True):
        raise InputError("damper table does not pass through (0 m/s, 0 N)", remedy=remedy)
