"""The rig in the JSON document: the parameters of the model by name, the damper table, the provenance.

Every parameter says the section of the rig file that it belongs to; ``catalogue`` are those that the rig file does
not carry, which an effect of the model brings along with their usual values. What is read goes through the checks of
a rig file.
"""

from dataclasses import asdict
from math import isfinite

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import Parameter
from savgs_ident.core.rig import Rig
from savgs_ident.core.rig_form import DAMPER_SECTION, DAMPER_UNITS, EXTRA_SECTION, SECTION_OF, SECTIONS
from savgs_ident.core.rig_form import SCHEMA as RIG_SCHEMA
from savgs_ident.core.rig_parse import parse_damper, parse_name, parse_parameters
from savgs_ident.export.exported_model import ExportedModel
from savgs_ident.export.json_text import Plain, as_plain
from savgs_ident.export.place import Place

CATALOGUE_SECTION = "catalogue"
"""The section of parameters that the rig file does not carry."""

COVARIANCE = "covariance"
"""What the document lifts out of the provenance, for it is of interest by itself."""

_NUMBERS = ("value", "tolerance", "lower", "upper")
_TEXTS = ("unit", "about", "source")
_BOUNDS = ("lower", "upper")
_SECTIONS = (*SECTIONS, EXTRA_SECTION, CATALOGUE_SECTION)


def parameters_record(model: ExportedModel) -> dict[str, object]:
    """All parameters of the model by name; a bound that is not there is null."""
    return {entry.name: _parameter_record(model.rig, entry) for entry in model.table.entries}


def damper_record(rig: Rig) -> dict[str, object]:
    """The damper table: force over velocity, compression positive, before its scale c_sd."""
    columns = {"velocity": rig.damper_velocity, "force": rig.damper_force}
    return {name: {"unit": DAMPER_UNITS[name], "values": list(column)} for name, column in columns.items()}


def provenance_record(rig: Rig) -> dict[str, Plain]:
    """Where the numbers come from, but for their covariance.

    Raises :class:`InputError` for what JSON cannot say.
    """
    return {
        name: as_plain(value, f"provenance.{name}")
        for name, value in rig.provenance.items()
        if name != COVARIANCE
    }


def covariance_record(model: ExportedModel) -> Plain:
    """Names and covariance of the estimated parameters; null for a drawing.

    Raises :class:`InputError` if what the rig carries is none of its parameters.
    """
    if COVARIANCE not in model.rig.provenance:
        return None
    plain = as_plain(model.rig.provenance[COVARIANCE], "provenance.covariance")
    check_covariance(Place(plain, "provenance.covariance"), model)
    return plain


def check_covariance(place: Place, model: ExportedModel) -> None:
    """Raises :class:`InputError` for what is no covariance of parameters of the model."""
    fields = place.table(("names", "matrix"))
    names = fields["names"].names(tuple(model.table))
    fields["matrix"].matrix(len(names), len(names))


def parse_rig(fields: dict[str, Place], effects: tuple[str, ...]) -> Rig:
    """The rig of the document's ``fields``, without covariance.

    Raises :class:`InputError` for what is no rig, or whose parameters are not those of the model with ``effects``.
    """
    rows = {
        name: place.table((*_NUMBERS, *_TEXTS, "section"))
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
    _check_parameters(ExportedModel(rig, effects), rows)
    return rig


def _parameter_record(rig: Rig, entry: Parameter) -> dict[str, object]:
    usual = SECTION_OF.get(entry.name, EXTRA_SECTION)
    bounds = {name: value if isfinite(value := getattr(entry, name)) else None for name in _BOUNDS}
    section = usual if entry.name in rig.parameters else CATALOGUE_SECTION
    fields = {name: value for name, value in asdict(entry).items() if name != "name"}
    return fields | bounds | {"section": section}


def _fields(row: dict[str, Place]) -> dict[str, object]:
    """A row as a rig file has it: a bound that is not there left out."""
    numbers = {
        name: row[name].number() for name in _NUMBERS if name not in _BOUNDS or row[name].value is not None
    }
    return numbers | {name: row[name].text() for name in _TEXTS}


def _damper(place: Place) -> dict[str, object]:
    columns: dict[str, object] = {}
    for name, column in place.table(tuple(DAMPER_UNITS)).items():
        fields = column.table(("unit", "values"))
        columns[name] = {"unit": fields["unit"].text(), "values": fields["values"].vector().tolist()}
    return columns


def _check_parameters(model: ExportedModel, rows: dict[str, dict[str, Place]]) -> None:
    """The rows are the model's parameters, and those of the catalogue are what it says here."""
    expected = parameters_record(model)
    for name in expected:
        if name not in rows:
            raise InputError(f"parameters.{name} is missing")
    for name, row in rows.items():
        if name not in expected:
            raise InputError(f"parameters.{name} belongs to no effect of the model")
        found = {field: place.value for field, place in row.items()}
        if row["section"].value == CATALOGUE_SECTION and found != expected[name]:
            raise InputError(f"parameters.{name} is another than this version's catalogue has")
