"""Parameters in TOML files: one line each, with every fault named by its key.

    m_s = { value = 320.0, unit = "kg", tolerance = 1.6, lower = 0.0, about = "sprung mass", source = "..." }

Everything is SI: a number in millimetres is refused rather than converted, so that a file means the same to everybody
who reads it. Nothing is guessed: an unknown key, another unit, a missing value are errors, each with its remedy. The
file's name is added by the caller.
"""

import tomllib
from collections.abc import Mapping, Sequence
from math import inf, isnan
from pathlib import Path

import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import InlineTable, Table

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import Parameter

Document = Mapping[str, object]
"""A table of a TOML document as it was parsed."""

HEAD = (
    "SI units; tolerance is one standard deviation of what is known beforehand, 0 (left out) means exact",
    "or, for a parameter that is to be identified, that only its bounds are known.",
)
"""What a file says at its top."""

KNOWN_UNITS = frozenset(
    {
        "1", "m", "1/m", "m/s", "s/m", "m/s^2", "rad", "rad/m", "rad/s", "s", "Hz",
        "kg", "1/kg", "kg m^2", "N", "N/m", "N/m^2", "N/m^3", "m/N", "N s/m", "m/(N s)", "N s^2/m^2", "Pa",
        "N m", "N m/rad", "N m s/rad", "rad/(N m)", "J", "W",
        "A", "V", "ohm", "H", "Wb", "N m/A", "V/A", "V/(A s)",
    }
)  # fmt: skip
"""Units, SI, that a parameter may have of which nobody says which one it has."""

_NUMBERS = ("value", "tolerance", "lower", "upper")
_TEXTS = ("unit", "about", "source")
_DEFAULTS = {"tolerance": 0.0, "lower": -inf, "upper": inf, "about": "", "source": ""}


def file_content(path: str | Path) -> bytes:
    """What is in a file now; raises :class:`InputError` if it cannot be read."""
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise InputError(
            f"cannot be read: {error.strerror}", source=path, remedy="name an existing file"
        ) from error


def parse_document(content: bytes, source: object) -> dict[str, object]:
    """The tables of a TOML document that errors call ``source``; raises :class:`InputError` for what is none."""
    try:
        return tomllib.loads(content.decode("utf-8"))
    except UnicodeDecodeError as error:
        raise InputError("is not text in UTF-8", source=source, remedy="save the file as UTF-8") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"is not valid TOML: {error}", source=source, remedy="mend it there") from error


def check_schema(document: Document, expected: int, what: str) -> None:
    """Raise :class:`InputError` unless the document is of the ``expected`` form of ``what``."""
    schema = document.get("schema")
    if schema != expected or isinstance(schema, bool):
        raise InputError(
            f"schema is {'missing' if schema is None else repr(schema)}",
            remedy=f"this version reads {what} with schema = {expected}",
        )


def check_unit(unit: str, where: str, expected: str | None) -> str:
    """``unit`` itself, if it is the ``expected`` one or, where nothing is expected, a known one.

    Raises :class:`InputError` that begins with ``where`` otherwise.
    """
    if expected is not None:
        if unit != expected:
            raise InputError(f"{where} is given in '{unit}'", remedy=f"convert it to '{expected}'")
    elif unit not in KNOWN_UNITS:
        raise InputError(
            f"{where} has the unknown unit '{unit}'", remedy="choose among: " + ", ".join(sorted(KNOWN_UNITS))
        )
    return unit


def parse_parameter(section: Document, key: str, name: str, expected: str | None) -> Parameter:
    """The parameter ``name`` of the table ``key``, in the ``expected`` unit; raises :class:`InputError`."""
    where = f"{key}.{name}"
    fields = table_at(section, name, where)
    refuse_unknown(fields, _NUMBERS + _TEXTS, f"{where}.")
    unit = parse_unit(fields, where, expected)
    if "value" not in fields:
        raise InputError(f"{where}.value is missing", remedy=f"give the number in '{unit}' as value = ...")
    number = {field: parse_number(fields[field], f"{where}.{field}") for field in _NUMBERS if field in fields}
    text = {field: parse_text(fields[field], f"{where}.{field}") for field in _TEXTS if field in fields}
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


def parse_unit(fields: Document, where: str, expected: str | None) -> str:
    """The unit of a table; raises :class:`InputError` as :func:`check_unit` does, or where there is none."""
    if "unit" not in fields:
        raise InputError(f"{where}.unit is missing", remedy=f"the unit here is '{expected or 'one of SI'}'")
    return check_unit(parse_text(fields["unit"], f"{where}.unit"), where, expected)


def table_at(parent: Document, key: str, where: str = "") -> dict[str, object]:
    """The table under ``key``, which errors call ``where``; raises :class:`InputError` for what is none."""
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


def refuse_unknown(table: Document, known: Sequence[str], prefix: str) -> None:
    """Raise :class:`InputError` for a key that is not ``known``."""
    for name in table:
        if name not in known:
            raise InputError(f"{prefix}{name} is not known", remedy="choose among: " + ", ".join(known))


def parse_text(value: object, where: str) -> str:
    """``value`` if it is a text; raises :class:`InputError` otherwise."""
    if not isinstance(value, str):
        raise InputError(f"{where} is {value!r}, not a text", remedy="put it in quotes")
    return value


def parse_number(value: object, where: str) -> float:
    """``value`` if it is a number, infinity among them; raises :class:`InputError` otherwise."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{where} is {value!r}, not a number", remedy="give a plain number in SI")
    try:
        number = float(value)
    except OverflowError:
        raise InputError(f"{where} is larger than any float", remedy="give a number that fits") from None
    if isnan(number):
        raise InputError(f"{where} is not a number (nan)", remedy="give a finite number")
    return number


def new_document() -> tomlkit.TOMLDocument:
    """An empty document with the words that stand above the parameters."""
    document = tomlkit.document()
    for line in HEAD:
        document.add(tomlkit.comment(line))
    return document


def compose_section(title: str, entries: Sequence[tuple[Parameter, str | None]]) -> Table:
    """A section of parameters, a line each, each with the unit that is expected of it.

    Raises :class:`InputError` for another unit.
    """
    table = tomlkit.table()
    table.add(tomlkit.comment(title))
    for entry, expected in entries:
        unit = check_unit(entry.unit, f"parameter '{entry.name}'", expected)
        optional = {key: getattr(entry, key) for key in _DEFAULTS if getattr(entry, key) != _DEFAULTS[key]}
        table.add(entry.name, compose_inline({"value": entry.value, "unit": unit} | optional))
    table.add(tomlkit.nl())
    return table


def compose_provenance(provenance: Document) -> Table:
    """Where numbers come from, as a section; raises :class:`InputError` for what TOML cannot say."""
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


def compose_inline(fields: Document) -> InlineTable:
    """A table in one line."""
    table = tomlkit.inline_table()
    table.update(fields)
    return table
