"""From a parsed TOML document to the parts of a rig, with every fault named by its key.

Nothing is guessed: a key that the form does not know, a unit other than the form's, a missing parameter are
errors, each with its remedy. The file's name is added by the caller.
"""

from collections.abc import Mapping
from math import inf, isnan

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import Parameter, ParameterTable
from savgs_ident.core.rig_form import (
    DAMPER_SECTION,
    DAMPER_UNITS,
    EXTRA_SECTION,
    PROVENANCE_SECTION,
    SCHEMA,
    SECTION_OF,
    SECTIONS,
    UNIT_OF,
    check_unit,
)

Document = Mapping[str, object]

_NUMBERS = ("value", "tolerance", "lower", "upper")
_TEXTS = ("unit", "about", "source")
_TOP_LEVEL = ("schema", "name", *SECTIONS, DAMPER_SECTION, EXTRA_SECTION, PROVENANCE_SECTION)


def parse_name(document: Document) -> str:
    """The rig's name, after a check that the document is of a form and schema that this version reads.

    Raises :class:`InputError` for another schema, an unknown section or a missing name.
    """
    schema = document.get("schema")
    if schema != SCHEMA or isinstance(schema, bool):
        raise InputError(
            f"schema is {'missing' if schema is None else repr(schema)}",
            remedy=f"this version reads rig files with schema = {SCHEMA}",
        )
    _refuse_unknown(document, _TOP_LEVEL, "")
    name = document.get("name")
    if not isinstance(name, str) or not name:
        raise InputError("name is missing or not a text", remedy='give the rig a name: name = "gt_rear"')
    return name


def parse_parameters(document: Document) -> ParameterTable:
    """All parameters of the form, in its order, then those of further effects.

    Raises :class:`InputError` for the first fault, by key.
    """
    entries = [entry for key in SECTIONS for entry in _parse_section(document, key)]
    if EXTRA_SECTION in document:
        section = _table_at(document, EXTRA_SECTION)
        _refuse_misplaced(section, EXTRA_SECTION)
        _refuse_unusual(section)
        entries += [_parse_parameter(section, EXTRA_SECTION, name) for name in section]
    table = ParameterTable(tuple(entries))
    _check_mass_split(table)
    return table


def parse_damper(document: Document) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Velocities [m/s] and forces [N] of the damper table; whether they make a curve is for the rig to check.

    Raises :class:`InputError` for a missing column, a wrong unit or what is not a number.
    """
    damper = _table_at(document, DAMPER_SECTION)
    _refuse_unknown(damper, tuple(DAMPER_UNITS), f"{DAMPER_SECTION}.")
    return _parse_column(damper, "velocity"), _parse_column(damper, "force")


def parse_provenance(document: Document) -> Document:
    """Where an identified rig comes from, as written; empty if the file does not say."""
    return _table_at(document, PROVENANCE_SECTION) if PROVENANCE_SECTION in document else {}


def _parse_section(document: Document, key: str) -> list[Parameter]:
    section = _table_at(document, key)
    units = SECTIONS[key].units
    _refuse_misplaced(section, key)
    _refuse_unknown(section, tuple(units), f"{key}.")
    missing = [name for name in units if name not in section]
    if missing:
        raise InputError(
            f"{key}.{missing[0]} is missing", remedy=f"give it under [{key}], in '{units[missing[0]]}'"
        )
    return [_parse_parameter(section, key, name) for name in units]


def _parse_parameter(section: Document, key: str, name: str) -> Parameter:
    where = f"{key}.{name}"
    fields = _table_at(section, name, where)
    _refuse_unknown(fields, _NUMBERS + _TEXTS, f"{where}.")
    unit = _parse_unit(fields, where, UNIT_OF.get(name))
    if "value" not in fields:
        raise InputError(f"{where}.value is missing", remedy=f"give the number in '{unit}' as value = ...")
    number = {field: _number(fields[field], f"{where}.{field}") for field in _NUMBERS if field in fields}
    text = {field: _text(fields[field], f"{where}.{field}") for field in _TEXTS if field in fields}
    try:
        return Parameter(
            name,
            number["value"],
            unit,
            number.get("tolerance", 0.0),
            number.get("lower", -inf),
            number.get("upper", inf),
            text.get("about", ""),
            text.get("source", ""),
        )
    except InputError as error:
        raise InputError(f"{where}: {error.what}", remedy=error.remedy) from None


def _parse_column(damper: Document, key: str) -> tuple[float, ...]:
    where = f"{DAMPER_SECTION}.{key}"
    fields = _table_at(damper, key, where)
    _refuse_unknown(fields, ("values", "unit", "about", "source"), f"{where}.")
    _parse_unit(fields, where, DAMPER_UNITS[key])
    values = fields.get("values")
    if not isinstance(values, list):
        raise InputError(f"{where}.values is missing or not a list", remedy="give a list of numbers")
    return tuple(_number(value, f"{where}.values[{index}]") for index, value in enumerate(values))


def _table_at(parent: Document, key: str, where: str = "") -> dict[str, object]:
    where = where or f"section [{key}]"
    if key not in parent:
        raise InputError(f"{where} is missing", remedy="take the shipped rig file as an example")
    table = parent[key]
    if not isinstance(table, dict):
        raise InputError(
            f"{where} is {table!r}, not a table",
            remedy="write it as in the shipped rig file, with its unit",
        )
    return table


def _refuse_unknown(table: Document, known: tuple[str, ...], prefix: str) -> None:
    for name in table:
        if name not in known:
            raise InputError(f"{prefix}{name} is not known", remedy="choose among: " + ", ".join(known))


def _refuse_misplaced(section: Document, key: str) -> None:
    for name in section:
        if SECTION_OF.get(name, key) != key:
            raise InputError(
                f"{key}.{name} stands in the wrong section", remedy=f"move it to [{SECTION_OF[name]}]"
            )


def _refuse_unusual(section: Document) -> None:
    for name in section:
        if not name.isidentifier():
            raise InputError(
                f"{EXTRA_SECTION}: {name!r} cannot be the name of a parameter",
                remedy="use letters, digits and underscores",
            )


def _parse_unit(fields: Document, where: str, expected: str | None) -> str:
    if "unit" not in fields:
        raise InputError(f"{where}.unit is missing", remedy=f"the unit here is '{expected or 'one of SI'}'")
    return check_unit(_text(fields["unit"], f"{where}.unit"), where, expected)


def _text(value: object, where: str) -> str:
    if not isinstance(value, str):
        raise InputError(f"{where} is {value!r}, not a text", remedy="put it in quotes")
    return value


def _number(value: object, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{where} is {value!r}, not a number", remedy="give a plain number in SI")
    try:
        number = float(value)
    except OverflowError:
        raise InputError(f"{where} is larger than any float", remedy="give a number that fits") from None
    if isnan(number):
        raise InputError(f"{where} is not a number (nan)", remedy="give a finite number")
    return number


def _check_mass_split(table: ParameterTable) -> None:
    total, lower, upper = table.values_of(("m_u", "m_L", "m_U"))
    if total <= lower + upper:
        raise InputError(
            f"masses.m_u = {total} kg leaves nothing for the upright beside m_L + m_U = {lower + upper} kg",
            remedy="m_u is the whole unsprung mass: wishbones and upright",
        )
