"""What model.json says of the quarter car beside what it says of any plant: its rig file, its linear equivalent.

Every parameter has the section of the rig file that it belongs to; ``catalogue`` are those that the rig file does not
have, which an effect of the model adds with their usual values. What is read passes the checks of a rig file. The
linear equivalent follows from the rig; it is for readers without this package.
"""

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import Parameter
from savgs_ident.export.document import BOUNDS, NUMBERS, TEXTS, JsonValue, parameter_record
from savgs_ident.export.linear_models import (
    EQUATION_8,
    EQUIVALENT_UNITS,
    equation_8,
    linear_equivalent,
    parse_space,
    space_record,
)
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.plants.quarter_car.rig_toml import (
    DAMPER_SECTION,
    DAMPER_UNITS,
    EXTRA_SECTION,
    SECTION_OF,
    SECTIONS,
    parse_damper,
    parse_name,
    parse_parameters,
)
from savgs_ident.plants.quarter_car.rig_toml import SCHEMA as RIG_SCHEMA

CATALOGUE_SECTION = "catalogue"
"""The section of parameters that the rig file does not carry."""
_SECTIONS = (*SECTIONS, EXTRA_SECTION, CATALOGUE_SECTION)


def rig_entries(model: RigModel) -> dict[str, object]:
    """What the document of a quarter car has beside what that of any plant has."""
    return {
        "name": model.rig.name,
        "parameters": rig_parameters_record(model),
        "damper": damper_record(model.rig),
        "linear_equivalent": linear_equivalent_record(model),
    }


def rig_parameters_record(model: RigModel) -> dict[str, dict[str, object]]:
    """All parameters of the model by name, with their sections; an absent bound is null."""
    return {entry.name: _parameter_record(model.rig, entry) for entry in model.table.entries}


def damper_record(rig: Rig) -> dict[str, object]:
    """The damper table: force over velocity, compression positive, before its scale c_sd."""
    columns = {"velocity": rig.damper_velocity, "force": rig.damper_force}
    return {name: {"unit": DAMPER_UNITS[name], "values": list(column)} for name, column in columns.items()}


def linear_equivalent_record(model: RigModel) -> dict[str, object]:
    """The linear equivalent of the strut, and equation (8) made of it."""
    found = linear_equivalent(model)
    numbers = {
        name: {"value": float(getattr(found, name)), "unit": unit} for name, unit in EQUIVALENT_UNITS.items()
    }
    return {**numbers, "state_space": space_record(equation_8(model))}


def check_linear_equivalent(place: JsonValue) -> None:
    """Raises :class:`InputError` unless it has the form of :func:`linear_equivalent_record`."""
    fields = place.table((*EQUIVALENT_UNITS, "state_space"))
    for name, unit in EQUIVALENT_UNITS.items():
        number = fields[name].table(("value", "unit"))
        number["value"].number()
        number["unit"].text((unit,))
    parse_space(fields["state_space"], EQUATION_8)


def parse_rig(fields: dict[str, JsonValue], effects: tuple[str, ...]) -> Rig:
    """The rig of the document's ``fields``, without covariance.

    Raises :class:`InputError` for an invalid rig, or other parameters than those of the model with ``effects``.
    """
    rows = {
        name: place.table((*NUMBERS, *TEXTS, "section"))
        for name, place in fields["parameters"].entries().items()
    }
    document: dict[str, object] = {
        "schema": RIG_SCHEMA,
        "name": fields["name"].text(),
        DAMPER_SECTION: _damper(fields["damper"]),
    }
    sections: dict[str, dict[str, object]] = {key: {} for key in SECTIONS}
    for name, row in rows.items():
        section = row["section"].text(_SECTIONS)
        if section != CATALOGUE_SECTION:
            sections.setdefault(section, {})[name] = _fields(row)
    provenance = {name: place.value for name, place in fields["provenance"].entries().items()}
    document |= sections
    rig = Rig(parse_name(document), parse_parameters(document), *parse_damper(document), provenance)
    _check_parameters(RigModel(rig, effects), rows)
    return rig


def _parameter_record(rig: Rig, entry: Parameter) -> dict[str, object]:
    usual = SECTION_OF.get(entry.name, EXTRA_SECTION)
    section = usual if entry.name in rig.parameters else CATALOGUE_SECTION
    return parameter_record(entry) | {"section": section}


def _fields(row: dict[str, JsonValue]) -> dict[str, object]:
    """A row as a rig file has it: an absent bound is left out."""
    numbers = {
        name: row[name].number() for name in NUMBERS if name not in BOUNDS or row[name].value is not None
    }
    return numbers | {name: row[name].text() for name in TEXTS}


def _damper(place: JsonValue) -> dict[str, object]:
    columns: dict[str, object] = {}
    for name, column in place.table(tuple(DAMPER_UNITS)).items():
        fields = column.table(("unit", "values"))
        columns[name] = {"unit": fields["unit"].text(), "values": fields["values"].vector().tolist()}
    return columns


def _check_parameters(model: RigModel, rows: dict[str, dict[str, JsonValue]]) -> None:
    """The rows are the model's parameters, and those of the catalogue have the values of this version."""
    expected = rig_parameters_record(model)
    for name in expected:
        if name not in rows:
            raise InputError(f"parameters.{name} is missing")
    for name, row in rows.items():
        if name not in expected:
            raise InputError(f"parameters.{name} belongs to no effect of the model")
        found = {field: place.value for field, place in row.items()}
        if row["section"].value == CATALOGUE_SECTION and found != expected[name]:
            raise InputError(f"parameters.{name} is another than this version's catalogue has")
