"""Units of rig files in the base units of FMI."""

import pytest

from savgs_ident.core.rig_form import KNOWN_UNITS
from savgs_ident.export.fmi_units import base_units


@pytest.mark.parametrize("unit", sorted(KNOWN_UNITS))
def test_every_unit_of_a_rig_file_has_base_units(unit: str) -> None:
    assert (base_units(unit) == {}) == (unit == "1")


@pytest.mark.parametrize(
    ("unit", "same"),
    [("N", "kg m/s^2"), ("J", "N m"), ("Pa", "N/m^2"), ("V", "W/A"), ("N m/A", "Wb"), ("V/(A s)", "ohm/s"),
     ("N m s/rad", "J s/rad"), ("m/(N s)", "s/kg"), ("Hz", "1/s"), ("H", "Wb/A")],
)  # fmt: skip
def test_equal_units_have_equal_base_units(unit: str, same: str) -> None:
    assert base_units(unit.replace("1/", "/")) == base_units(same.replace("1/", "/"))
