"""The file of a model of any plant: what is written is read back, and every fault is named by its key."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import savgs_ident as si
from savgs_ident.core.errors import InputError
from savgs_ident.plants.model_toml import model_text, parse_model, read_model, write_model

PROVENANCE = {
    "effects": ["guide_coulomb"],
    "free": ["k", "c"],
    "before": {"k": 6e4},
    "trusted": True,
    "chi2": 3.5,
}


def _identified() -> si.PlantModel:
    model = si.load_plant("two_mass") + "guide_coulomb"
    return model.with_values({"k": 5.4e4, "m_s": 318.0, "guide_coulomb_coefficient": 0.03}).with_provenance(
        PROVENANCE
    )


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    model = _identified()
    found = si.load_plant("two_mass", write_model(model, tmp_path / "model.toml"))
    assert found.table == model.table
    assert found.effects == model.effects
    assert dict(found.provenance) == PROVENANCE
    assert not found.is_drawing
    assert found.before.table["k"].value == 6e4
    assert found.source.endswith("model.toml")


def test_what_a_file_leaves_out_stays_as_the_plant_declares_it(tmp_path: Path) -> None:
    path = tmp_path / "some.toml"
    path.write_text(
        'schema = 1\nplant = "TwoMass"\n[parameters]\nm_s = { value = 321.0, unit = "kg", tolerance = 0.5 }\n'
    )
    found, declared = si.load_plant("two_mass", path), si.load_plant("two_mass")
    assert (found.table["m_s"].value, found.table["m_s"].tolerance) == (321.0, 0.5)
    assert {name: found.table[name] for name in found.table if name != "m_s"} == {
        name: declared.table[name] for name in declared.table if name != "m_s"
    }


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ('plant = "Pendulum"', "it is of the plant 'Pendulum', not of TwoMass"),
        ('schema = 2\nplant = "TwoMass"', "schema is 2"),
        ('[parameters]\nmass = { value = 1.0, unit = "kg" }', "parameters.mass is not known"),
        (
            '[parameters]\nm_s = { value = 320.0, unit = "g" }',
            "parameters.m_s is given in 'g'.*convert it to 'kg'",
        ),
        (
            '[parameters]\nm_s = { value = "heavy", unit = "kg" }',
            "parameters.m_s.value is 'heavy', not a number",
        ),
        ('[parameters]\nm_s = { unit = "kg" }', "parameters.m_s.value is missing"),
        ("[parameters]\nm_s = 320.0", "parameters.m_s is 320.0, not a table"),
        ('[parameters]\nm_s = { value = -1.0, unit = "kg", lower = 0.0 }', "outside its bounds"),
        ('[provenance]\neffects = "guide_coulomb"', "provenance.effects is 'guide_coulomb'"),
        ('[provenance]\neffects = ["magic"]', "there is no effect 'magic'"),
        ('[provenance]\nfree = ["mu_r"]', r"provenance.free is \['mu_r'\]"),
        ('[provenance]\nbefore = { k = "soft" }', "provenance.before is no table of numbers"),
        ("[springs]", "springs is not known"),
    ],
)
def test_a_fault_is_named_by_its_key(tmp_path: Path, line: str, said: str) -> None:
    path = tmp_path / "model.toml"
    head = "" if line.startswith(("plant", "schema")) else 'schema = 1\nplant = "TwoMass"\n'
    path.write_text(("schema = 1\n" if line.startswith("plant") else "") + head + line + "\n")
    with pytest.raises(InputError, match=said) as found:
        read_model(path, si.load_plant("two_mass"))
    assert found.value.source == str(path)
    assert found.value.remedy


@given(
    st.dictionaries(
        st.sampled_from(["m_s", "m_u", "k", "c", "k_t", "c_t"]),
        st.floats(1.0, 1e5, allow_nan=False),
        max_size=6,
    )
)
def test_any_values_survive_to_the_last_bit(values: dict[str, float]) -> None:
    model = si.load_plant("two_mass").with_values(values)
    assert parse_model(model_text(model).encode(), "here", si.load_plant("two_mass")).table == model.table
