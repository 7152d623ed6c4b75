"""model.json: it comes back as it went, its schema describes it, and anything else is refused with a remedy."""

import contextlib
import copy
import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from savgs_ident.core.errors import InputError
from savgs_ident.export.document import JsonValue, json_text
from savgs_ident.export.exported_model import ExportedModel
from savgs_ident.export.gather import DIAGNOSIS_SCHEMAS
from savgs_ident.export.json_export import model_record, parse_model, read_model_json, write_json
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE, MODELS
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.rig import Rig, read_rig, write_rig

from ..in_one_test import over
from .diagnoses import MOUNT, UNKNOWN

Document = dict[str, Any]


def json_schema() -> Document:
    """The JSON Schema (draft 2020-12) of the document of a quarter car."""
    schema: Document = json.loads(
        files("savgs_ident.export").joinpath("model.schema.json").read_text("utf-8")
    )
    return schema


@pytest.fixture(scope="module")
def document(model: ExportedModel, tmp_path_factory: pytest.TempPathFactory) -> Document:
    """The document of the model with everything, as a file says it."""
    (path,) = write_json(model, tmp_path_factory.mktemp("json"))
    found: Document = json.loads(path.read_text(encoding="utf-8"))
    return found


@pytest.fixture(scope="module")
def validator() -> Draft202012Validator:
    """Of the published schema."""
    schema = json_schema()
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


def _same(found: ExportedModel, model: ExportedModel) -> None:
    assert found.model == model.model
    assert found.effects == model.effects
    assert found.samples.keys() == model.samples.keys()
    for name, values in model.samples.items():
        assert found.samples[name].dtype == np.float64
        assert np.array_equal(found.samples[name], values)
    assert dict(found.diagnosis) == dict(model.diagnosis)
    assert found.table == model.table


def test_the_model_comes_back_to_the_last_digit(model: ExportedModel, tmp_path: Path) -> None:
    (path,) = write_json(model, tmp_path)
    _same(read_model_json(path), model)


@pytest.mark.parametrize(
    "effects", [(), MODELS["simtr"], ("cam_harmonic", "rail_stribeck"), tuple(CATALOGUE)]
)
def test_a_drawing_comes_back_whatever_its_effects(
    rig: Rig, tmp_path: Path, effects: tuple[str, ...]
) -> None:
    drawing = ExportedModel(RigModel(rig, effects))
    (path,) = write_json(drawing, tmp_path)
    _same(read_model_json(path), drawing)


def test_a_rig_file_with_fitted_effects_comes_back(model: ExportedModel, tmp_path: Path) -> None:
    """Effects that were fitted stand in the rig's file, and after the round trip, too."""
    rig = replace(model.model.rig, parameters=model.table.with_values({"mount_compliance": 2e-6}))
    write_rig(rig, tmp_path / "model.toml")
    read = ExportedModel(RigModel(read_rig(tmp_path / "model.toml"), model.effects))
    (path,) = write_json(read, tmp_path)
    _same(read_model_json(path), read)
    assert json.loads(path.read_text())["parameters"]["mount_compliance"]["section"] == "effects"


def test_the_same_model_gives_the_same_bytes(model: ExportedModel, document: Document) -> None:
    assert json_text(model_record(model)) == json_text(document)


def test_the_document_holds_what_is_known(document: Document, model: ExportedModel) -> None:
    assert document["schema"] == 1
    assert set(document["parameters"]) == set(model.table)
    k_t = document["parameters"]["k_t"]
    assert (k_t["value"], k_t["unit"], k_t["section"]) == (1.01 * 2.75e5, "N/m", "tyre")
    assert document["parameters"]["mount_compliance"]["section"] == "catalogue"
    assert document["covariance"] == model.model.rig.provenance["covariance"]
    assert "covariance" not in document["provenance"]
    assert document["samples"]["count"] == 7
    assert document["diagnosis"]["verdict"]["effects"] == ["mount_compliance"]
    states = [each["name"] for each in document["signals"]["states"]]
    assert states[:4] == ["z_s", "theta_LW", "z_s_dot", "theta_LW_dot"]


def test_the_linear_equivalent_is_that_of_the_rig(document: Document, rig: Rig) -> None:
    linear = document["linear_equivalent"]
    assert linear["k_eq"] == {"value": pytest.approx(59987.0, rel=0.01), "unit": "N/m"}
    assert linear["c_eq"] == {"value": pytest.approx(1.01 * 2087.4, rel=0.01), "unit": "N s/m"}
    assert linear["alpha"]["value"] < 0.0
    space = linear["state_space"]
    states = list(space["states"])
    pull = np.array(space["A"])[0, states.index("susp_deflection")] * rig.parameters["m_s"].value
    assert pull == pytest.approx(linear["k_eq"]["value"])


def test_documents_are_what_the_schema_describes(
    document: Document, validator: Draft202012Validator, rig: Rig
) -> None:
    validator.validate(document)
    for schema in DIAGNOSIS_SCHEMAS:
        validator.validate(
            model_record(ExportedModel(RigModel(rig, ()), diagnosis=UNKNOWN | {"schema": schema}))
        )


def _set(*place: Any, value: Any) -> Callable[[Document], None]:
    def change(document: Document) -> None:
        at: Any = document
        for key in place[:-1]:
            at = at[key]
        at[place[-1]] = value

    return change


def _drop(*place: Any) -> Callable[[Document], None]:
    def change(document: Document) -> None:
        at: Any = document
        for key in place[:-1]:
            at = at[key]
        del at[place[-1]]

    return change


# What no document of the form says; the schema sees it as the reader does.
FORM = {
    "another schema": _set("schema", value=2),
    "a truth for a schema": _set("schema", value=True),
    "another kind": _set("kind", value="something"),
    "no parameters": _drop("parameters"),
    "an unknown entry": _set("more", value=1),
    "a name that is none": _set("name", value=3),
    "an effect twice": _set("effects", value=["rail_coulomb", "rail_coulomb"]),
    "a value as a text": _set("parameters", "k_t", "value", value="275000"),
    "a parameter without a unit": _drop("parameters", "k_t", "unit"),
    "a parameter with more": _set("parameters", "k_t", "sd", value=1.0),
    "a tolerance below zero": _set("parameters", "k_t", "tolerance", value=-1.0),
    "a bound as a text": _set("parameters", "k_t", "lower", value="-inf"),
    "a section that is none": _set("parameters", "k_t", "section", value="wheels"),
    "a damper in another unit": _set("damper", "force", "unit", value="kN"),
    "a damper without forces": _drop("damper", "force"),
    "a damper of texts": _set("damper", "force", "values", value=["0", "1", "2"]),
    "signals as names": _set("signals", "states", value=["z_s"]),
    "k_eq in another unit": _set("linear_equivalent", "k_eq", "unit", value="N/mm"),
    "no state space": _drop("linear_equivalent", "state_space"),
    "A of texts": _set("linear_equivalent", "state_space", "A", value=[["1"]]),
    "a covariance of names only": _drop("covariance", "matrix"),
    "a covariance as a list": _set("covariance", value=[]),
    "draws as a list": _set("samples", "draws", value=[[1.0]]),
    "no draws": _set("samples", "draws", value={}),
    "draws that are null": _set("samples", "draws", "mu_r", value=None),
    "a count as a text": _set("samples", "count", value="7"),
    "a diagnosis without verdict": _drop("diagnosis", "verdict"),
    "a verdict of no kind": _set("diagnosis", "verdict", "kind", value="perhaps"),
    "fitted values as texts": _set("diagnosis", "identified", "k_t", value="soft"),
    "a provenance as a text": _set("provenance", value="the rig"),
}

# What only the reader can know to be wrong.
MEANING = {
    "an effect that is none": _set("effects", value=["magic"]),
    "an effect too many": _set("effects", value=["rail_coulomb", "tyre_friction"]),
    "a parameter too few": _drop("parameters", "k_t"),
    "an effect's parameter too few": _drop("parameters", "mount_compliance"),
    "a parameter too many": _set(
        "parameters", "extra", value={"value": 1.0, "unit": "m", "tolerance": 0, "lower": None, "upper": None,
                                      "about": "", "source": "", "section": "catalogue"},
    ),
    "a parameter in another unit": _set("parameters", "k_t", "unit", value="N/mm"),
    "a parameter in another section": _set("parameters", "k_t", "section", value="strut"),
    "a parameter beyond its bounds": _set("parameters", "k_t", "upper", value=1.0),
    "another catalogue": _set("parameters", "mount_compliance", "value", value=1e-9),
    "masses that leave no upright": _set("parameters", "m_u", "value", value=1.0),
    "a damper that falls": _set("damper", "force", "values", 0, value=1e9),
    "a damper too short": _set("damper", "force", "values", value=[0.0]),
    "signals of another version": _set("signals", "states", 0, "about", value="something else"),
    "A that does not fit": _set("linear_equivalent", "state_space", "A", value=[[1.0]]),
    "a covariance that does not fit": _set("covariance", "matrix", value=[[1.0]]),
    "a covariance of strangers": _set("covariance", "names", 0, value="nobody"),
    "draws too few": _set("samples", "draws", "mu_r", value=[0.03]),
    "draws of a stranger": _set("samples", "draws", "nobody", value=[0.0] * 7),
    "a diagnosis of magic": _set("diagnosis", "verdict", "effects", value=["magic"]),
    "an effect that is nothing": _set("diagnosis", "verdict", "kind", value="none"),
}  # fmt: skip


@over("fault", {**FORM, **MEANING})
def test_a_mutilated_document_is_refused_with_file_place_and_remedy(
    fault: str, document: Document, tmp_path: Path
) -> None:
    changed = copy.deepcopy(document)
    {**FORM, **MEANING}[fault](changed)
    path = tmp_path / "model.json"
    path.write_text(json.dumps(changed), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_model_json(path)
    assert caught.value.source == str(path)
    assert caught.value.remedy


@over("fault", FORM)
def test_a_mutilated_document_is_not_what_the_schema_describes(
    fault: str, document: Document, validator: Draft202012Validator
) -> None:
    changed = copy.deepcopy(document)
    FORM[fault](changed)
    assert not validator.is_valid(changed)


def _required(schema: Document, definitions: Document) -> Iterator[tuple[str, ...]]:
    """The places of all entries that the schema asks for."""
    schema = definitions[schema["$ref"].rpartition("/")[2]] if "$ref" in schema else schema
    for name in schema.get("required", ()):
        yield (name,)
    for name, inner in schema.get("properties", {}).items():
        yield from ((name, *deeper) for deeper in _required(inner, definitions))


def test_whatever_the_schema_asks_for_the_reader_asks_for(
    document: Document, validator: Draft202012Validator
) -> None:
    schema = json_schema()
    places = list(_required(schema, schema["$defs"]))
    assert len(places) > 30
    for place in places:
        changed = copy.deepcopy(document)
        _drop(*place)(changed)
        assert not validator.is_valid(changed), place
        with pytest.raises(InputError):
            parse_model(JsonValue(changed))


def test_what_is_no_readable_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read: No such file"):
        read_model_json(tmp_path / "none.json")
    with pytest.raises(InputError, match="cannot be read: Is a directory"):
        read_model_json(tmp_path)


def test_a_provenance_that_json_cannot_say_is_refused(rig: Rig, tmp_path: Path) -> None:
    dated = replace(rig, provenance={"seen": [float("nan")]})
    with pytest.raises(InputError, match=r"provenance.seen\[0\] is nan, which JSON cannot say"):
        write_json(ExportedModel(RigModel(dated, ())), tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("carried", [{}, 3, {"names": ["k_t"]}, {"names": ["x"], "matrix": [[1.0]]}])
def test_a_covariance_that_is_none_is_refused(rig: Rig, tmp_path: Path, carried: object) -> None:
    with pytest.raises(InputError, match=r"provenance\.covariance"):
        write_json(ExportedModel(RigModel(replace(rig, provenance={"covariance": carried}), ())), tmp_path)


junk = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=6,
)


def _places(value: Any, place: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    inner = (
        value.items() if isinstance(value, dict) else enumerate(value[:2]) if isinstance(value, list) else ()
    )
    return [place, *(deeper for key, entry in inner for deeper in _places(entry, (*place, key)))]


@given(data=st.data())
def test_anything_in_place_of_an_entry_gives_a_model_or_an_input_error(
    document: Document, data: st.DataObject
) -> None:
    changed = copy.deepcopy({**document, "samples": None})
    place = data.draw(st.sampled_from(_places(changed)[1:]))
    _set(*place, value=data.draw(junk))(changed)
    # Any other error would be a traceback to a user.
    with contextlib.suppress(InputError):
        assert isinstance(parse_model(JsonValue(changed)), ExportedModel)


def test_the_diagnosis_travels_whole(model: ExportedModel, tmp_path: Path) -> None:
    (path,) = write_json(model, tmp_path)
    assert read_model_json(path).diagnosis == MOUNT
