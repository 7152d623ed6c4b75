"""What a plant that no force brings back has of places to stand still."""

import pytest

import savgs_ident as si
from savgs_ident.core.values import as_values
from savgs_ident.plants.at_rest import unrestrained
from savgs_ident.plants.axis import Axis
from savgs_ident.plants.two_mass import PARAMETERS, TwoMass


@pytest.mark.parametrize(
    ("loose", "expected"),
    [
        ({}, ()),
        ({"k": 0.0}, ("z_s",)),
        ({"k_t": 0.0}, ("z_s", "z_u")),
        ({"k": 0.0, "k_t": 0.0}, ("z_s", "z_u")),
    ],
)
def test_masses_may_be_anywhere_where_the_spring_below_them_is_missing(
    loose: dict[str, float], expected: tuple[str, ...]
) -> None:
    """Without the tyre's spring both masses may move together, without the strut's the upper one alone."""
    values = as_values(PARAMETERS.as_dict() | loose)
    assert unrestrained(TwoMass(), values) == expected


def test_friction_alone_brings_nothing_back() -> None:
    rubbing = si.PlantModel(Axis(), Axis.parameters) + "guide_coulomb" + "guide_preload"
    assert unrestrained(rubbing.build(), as_values(rubbing.table.as_dict())) == ("x",)
