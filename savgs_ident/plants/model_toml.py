"""The file of a model of any plant: the numbers of a fit with where they come from, in the form of a rig file.

    schema = 1
    plant = "Pendulum"

    [parameters]
    m = { value = 0.501, unit = "kg", tolerance = 0.005, lower = 0.0, about = "mass of the bob" }

    [effects]                       # parameters of effects beside the plant's own
    [provenance]                    # of a fit: the effects, what was free, what was known before, the covariance

What a file leaves out stays as the plant declares it, so that a few lines with what was measured are a file, too.
"""

from dataclasses import replace
from pathlib import Path

import tomlkit

from savgs_ident.core.errors import InputError, blamed_on
from savgs_ident.core.files import write_bytes
from savgs_ident.core.parameter import Parameter, ParameterTable
from savgs_ident.plants.model import PlantModel
from savgs_ident.plants.parameter_toml import (
    Document,
    check_schema,
    compose_provenance,
    compose_section,
    file_content,
    new_document,
    parse_document,
    parse_parameter,
    refuse_unknown,
    table_at,
)

SCHEMA = 1
"""The number of the form; a file with another one is refused."""

_SECTIONS = ("parameters", "effects")
_PROVENANCE = "provenance"


def read_model(path: str | Path, model: PlantModel) -> PlantModel:
    """A ``model`` of a plant with the effects and the numbers of a file.

    Raises :class:`InputError`, with file, key, what is wrong and the remedy, for a file of another form or plant, for
    effects and parameters that the plant does not have, and for what is not in its unit.
    """
    return parse_model(file_content(path), path, model)


def parse_model(content: bytes, source: object, model: PlantModel) -> PlantModel:
    """The same of the ``content`` of a file that errors call ``source``."""
    document = parse_document(content, source)
    with blamed_on(source):
        check_schema(document, SCHEMA, "models")
        refuse_unknown(document, ("schema", "plant", *_SECTIONS, _PROVENANCE), "")
        if document.get("plant") != model.plant_name:
            raise InputError(
                f"it is of the plant {document.get('plant')!r}, not of {model.plant_name}",
                remedy=f'give a file with plant = "{model.plant_name}", or the plant that it is of',
            )
        provenance = table_at(document, _PROVENANCE) if _PROVENANCE in document else {}
        for name in _effects(provenance):
            model = model + name
        table = _read_parameters(document, model.table)
        _check_provenance(provenance, table)
        return replace(model.with_parameters(table).with_provenance(provenance), source=str(source))


def write_model(model: PlantModel, path: str | Path) -> Path:
    """Write the file of a model, whole or not at all; the path.

    Raises :class:`InputError` if it cannot be written or the provenance holds what TOML cannot say.
    """
    return write_bytes(Path(path), model_text(model).encode())


def model_text(model: PlantModel) -> str:
    """What :func:`write_model` writes; raises as it does."""
    document = new_document()
    document.add("schema", tomlkit.item(SCHEMA))
    document.add("plant", tomlkit.item(model.plant_name))
    brought = {each.name for effect in model.plant.effects for each in effect.parameters}
    own = [each for each in model.table.entries if each.name not in brought]
    further = [each for each in model.table.entries if each.name in brought]
    for key, title, entries in (
        ("parameters", "Parameters of the plant", own),
        ("effects", "Parameters of its effects", further),
    ):
        if entries:
            document.add(key, compose_section(title, [(each, each.unit) for each in entries]))
    if model.provenance:
        document.add(_PROVENANCE, compose_provenance(model.provenance))
    return tomlkit.dumps(document)


def _effects(provenance: Document) -> list[str]:
    named = provenance.get("effects", [])
    if not isinstance(named, list) or not all(isinstance(each, str) for each in named):
        raise InputError(f"provenance.effects is {named!r}", remedy="list names of effects")
    return named


def _read_parameters(document: Document, known: ParameterTable) -> ParameterTable:
    """The ``known`` parameters, with the lines of the document in place of those that it has."""
    read: dict[str, Parameter] = {}
    for key in _SECTIONS:
        section = table_at(document, key) if key in document else {}
        refuse_unknown(section, tuple(known), f"{key}.")
        read |= {name: parse_parameter(section, key, name, known[name].unit) for name in section}
    return ParameterTable(tuple(read.get(each.name, each) for each in known.entries))


def _check_provenance(provenance: Document, table: ParameterTable) -> None:
    """Raise :class:`InputError` unless what a fit left free and knew before are parameters and numbers of them."""
    free, before = provenance.get("free", []), provenance.get("before", {})
    remedy = "identify the model again"
    if not isinstance(free, list) or not all(isinstance(each, str) and each in table for each in free):
        raise InputError(f"provenance.free is {free!r}", remedy=remedy)
    numbers = isinstance(before, dict) and all(
        name in table and isinstance(each, int | float) and not isinstance(each, bool)
        for name, each in before.items()
    )
    if not numbers:
        raise InputError("provenance.before is no table of numbers of parameters", remedy=remedy)
