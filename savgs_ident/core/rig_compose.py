"""From the parts of a rig to the text of its TOML file: section by section, one line a parameter."""

from collections.abc import Mapping
from math import inf

import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import InlineTable, Table

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import Parameter, ParameterTable
from savgs_ident.core.rig_form import (
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
    check_unit,
)

_HEAD = (
    "SI units; tolerance is one standard deviation of what is known beforehand, 0 (left out) means exact",
    "or, for a parameter that is to be identified, that only its bounds are known.",
)
_DEFAULTS = {"tolerance": 0.0, "lower": -inf, "upper": inf, "about": "", "source": ""}


def compose_rig(
    name: str,
    parameters: ParameterTable,
    damper_velocity: tuple[float, ...],
    damper_force: tuple[float, ...],
    provenance: Mapping[str, object],
) -> str:
    """The text of a rig file; what :func:`read_rig` makes the same rig of.

    Raises :class:`InputError` for a missing parameter, a unit that rig files do not know, or a
    ``provenance`` that TOML cannot say (it takes texts, numbers, booleans, dates, lists and tables of
    these). The damper's table is ``damper_force`` [N] over ``damper_velocity`` [m/s].
    """
    missing = [entry for entry in SECTION_OF if entry not in parameters]
    if missing:
        raise InputError(f"the rig has no parameter '{missing[0]}'", remedy="write a whole rig")
    document = tomlkit.document()
    for line in _HEAD:
        document.add(tomlkit.comment(line))
    document.add("schema", tomlkit.item(SCHEMA))
    document.add("name", tomlkit.item(name))
    for key, section in SECTIONS.items():
        document.add(key, _compose_section(section.title, [parameters[entry] for entry in section.units]))
    document.add(DAMPER_SECTION, _compose_damper(damper_velocity, damper_force))
    extra = [entry for entry in parameters.entries if entry.name not in SECTION_OF]
    if extra:
        document.add(EXTRA_SECTION, _compose_section(EXTRA_TITLE, extra))
    if provenance:
        document.add(PROVENANCE_SECTION, _compose_provenance(provenance))
    return tomlkit.dumps(document)


def _compose_section(title: str, entries: list[Parameter]) -> Table:
    table = tomlkit.table()
    table.add(tomlkit.comment(title))
    for entry in entries:
        unit = check_unit(entry.unit, f"parameter '{entry.name}'", UNIT_OF.get(entry.name))
        optional = {key: getattr(entry, key) for key in _DEFAULTS if getattr(entry, key) != _DEFAULTS[key]}
        table.add(entry.name, _inline({"value": entry.value, "unit": unit} | optional))
    table.add(tomlkit.nl())
    return table


def _compose_damper(velocity: tuple[float, ...], force: tuple[float, ...]) -> Table:
    table = tomlkit.table()
    table.add(tomlkit.comment(DAMPER_TITLE))
    table.add("velocity", _inline({"values": list(velocity), "unit": DAMPER_UNITS["velocity"]}))
    table.add("force", _inline({"values": list(force), "unit": DAMPER_UNITS["force"]}))
    table.add(tomlkit.nl())
    return table


def _compose_provenance(provenance: Mapping[str, object]) -> Table:
    table = tomlkit.table()
    for key, value in provenance.items():
        try:
            table.add(key, tomlkit.item(value))
        except (TOMLKitError, TypeError, ValueError) as error:
            raise InputError(
                f"provenance.{key} cannot be written as TOML: {error}",
                remedy="give texts, numbers, lists and tables of these",
            ) from error
    return table


def _inline(fields: Mapping[str, object]) -> InlineTable:
    table = tomlkit.inline_table()
    table.update(fields)
    return table
