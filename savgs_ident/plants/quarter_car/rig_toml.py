"""The form of a rig file, and from a parsed TOML document to the parts of a rig, with every fault named by its key.

A rig file has one section for every part of the rig: :data:`SECTIONS` are its parameters, each with the one unit it
is given in. Names are unique over the whole file, so that the model takes them flat; the section says where a
reader finds them. Everything is SI: a number in millimetres is refused rather than converted, so that a file means
the same to everybody who reads it.

Nothing is guessed: a key that the form does not know, a unit other than the form's, a missing parameter are
errors, each with its remedy. The file's name is added by the caller.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import Parameter, ParameterTable
from savgs_ident.plants.parameter_toml import (
    Document,
    check_schema,
    parse_number,
    parse_parameter,
    parse_unit,
    refuse_unknown,
    table_at,
)

SCHEMA = 1
"""The number of the form; a file with another one is refused."""

EXTRA_SECTION = "effects"
"""The section for parameters beyond the form: those of further effects that were fitted."""

EXTRA_TITLE = "Parameters of further effects"
"""What a file says above that section."""

DAMPER_SECTION = "damper"
"""The section with the damper table."""

DAMPER_TITLE = "Force over velocity of the strut, compression positive; scaled as one by c_sd"
"""What a file says above that section."""

DAMPER_UNITS: Mapping[str, str] = MappingProxyType({"velocity": "m/s", "force": "N"})
"""The columns of the damper table and their units."""

PROVENANCE_SECTION = "provenance"
"""Where an identified rig says which data, versions and options it came from."""


class Section(NamedTuple):
    """One part of the rig: a ``title`` for the reader and the unit of every parameter by name."""

    title: str
    units: Mapping[str, str]


def _all_in(unit: str, names: str) -> dict[str, str]:
    return dict.fromkeys(names.split(), unit)


SECTIONS: Mapping[str, Section] = MappingProxyType(
    {
        "hardpoints": Section(
            "Points of the linkage in the nominal state: y from the rail to the wheel, z up from the plate",
            _all_in("m", "A_y A_z B_y B_z C_y C_z D_y D_z E_y E_z G_y G_z W_y W_z"),
        ),
        "link": Section(
            "Single link: the crank pin is F = G + l_SL (cos psi, sin psi) with psi = theta_0 + link angle",
            {"l_SL": "m", "theta_0": "rad", "psi_nominal": "rad"},
        ),
        "masses": Section(
            "Masses, moments of inertia about the x axis through the cg, and cgs in the nominal state",
            _all_in("kg", "m_s m_u m_L m_U")
            | _all_in("kg m^2", "J_L J_U J_K")
            | _all_in("m", "cg_L_y cg_L_z cg_U_y cg_U_z cg_K_y cg_K_z")
            | {"g": "m/s^2"},
        ),
        "strut": Section("Spring and damper of the strut", {"k_sd": "N/m", "l_free": "m", "c_sd": "N s/m"}),
        "tyre": Section(
            "Tyre: radial spring and damper, lateral friction at the contact point",
            {"k_t": "N/m", "c_t": "N s/m", "r_free": "m", "tilt": "rad", "mu_t": "1", "ydot_Hth": "m/s"},
        ),
        "rail": Section(
            "Railway that guides the sprung mass: two carriages and their friction",
            {"mu_r": "1", "l_tb": "m", "z_tb": "m", "k_pre": "N/m", "c_pre": "N s/m"},
        ),
        "sensors": Section(
            "Gains of the sensors: reading over truth", _all_in("1", "accel_gain deflection_gain")
        ),
        "road": Section("Cam under the road plate", {"cam_peak_to_peak": "m"}),
        "motor": Section(
            "Drive of the link for the active suspension: motor in d-q axes, gear, cascaded loops, limits",
            {
                "motor_pole_pairs": "1",
                "motor_resistance": "ohm",
                "motor_inductance_d": "H",
                "motor_inductance_q": "H",
                "motor_flux_linkage": "Wb",
                "motor_torque_constant": "N m/A",
                "motor_stall_torque": "N m",
                "motor_peak_torque": "N m",
                "motor_dc_bus": "V",
                "motor_rotor_inertia": "kg m^2",
                "motor_gear_input_inertia": "kg m^2",
                "motor_gear_ratio": "1",
                "motor_gear_efficiency": "1",
                "motor_link_inertia": "kg m^2",
                "motor_static_friction": "N m",
                "motor_speed_limit": "rad/s",
                "motor_peak_power": "W",
                "motor_current_bandwidth": "Hz",
                "motor_current_kp": "V/A",
                "motor_current_ki": "V/(A s)",
                "motor_velocity_bandwidth": "Hz",
                "motor_velocity_kp": "N m s/rad",
                "motor_velocity_ki": "N m/rad",
                "motor_reference_bandwidth": "Hz",
            },
        ),
        "servo": Section(
            "Drive that holds the link in the recordings",
            {
                "servo_gear_ratio": "1",
                "servo_torque_constant": "N m/A",
                "servo_inertia": "kg m^2",
                "servo_friction": "N m",
                "servo_speed_limit": "rad/s",
                "servo_current_limit": "A",
            },
        ),
    }
)
"""Section to title and parameters, in the order in which a file is written."""

UNIT_OF: Mapping[str, str] = MappingProxyType(
    {name: unit for section in SECTIONS.values() for name, unit in section.units.items()}
)
"""The unit of every parameter of the form."""

SECTION_OF: Mapping[str, str] = MappingProxyType(
    {name: key for key, section in SECTIONS.items() for name in section.units}
)
"""The section of every parameter of the form."""


_TOP_LEVEL = ("schema", "name", *SECTIONS, DAMPER_SECTION, EXTRA_SECTION, PROVENANCE_SECTION)


def parse_name(document: Document) -> str:
    """The rig's name, after a check that the document is of a form and schema that this version reads.

    Raises :class:`InputError` for another schema, an unknown section or a missing name.
    """
    check_schema(document, SCHEMA, "rig files")
    refuse_unknown(document, _TOP_LEVEL, "")
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
        section = table_at(document, EXTRA_SECTION)
        _refuse_misplaced(section, EXTRA_SECTION)
        _refuse_unusual(section)
        entries += [parse_parameter(section, EXTRA_SECTION, name, UNIT_OF.get(name)) for name in section]
    table = ParameterTable(tuple(entries))
    _check_mass_split(table)
    return table


def parse_damper(document: Document) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Velocities [m/s] and forces [N] of the damper table; whether they make a curve is for the rig to check.

    Raises :class:`InputError` for a missing column, a wrong unit or what is not a number.
    """
    damper = table_at(document, DAMPER_SECTION)
    refuse_unknown(damper, tuple(DAMPER_UNITS), f"{DAMPER_SECTION}.")
    return _parse_column(damper, "velocity"), _parse_column(damper, "force")


def parse_provenance(document: Document) -> Document:
    """Where an identified rig comes from, as written; empty if the file does not say."""
    return table_at(document, PROVENANCE_SECTION) if PROVENANCE_SECTION in document else {}


def _parse_section(document: Document, key: str) -> list[Parameter]:
    section = table_at(document, key)
    units = SECTIONS[key].units
    _refuse_misplaced(section, key)
    refuse_unknown(section, tuple(units), f"{key}.")
    missing = [name for name in units if name not in section]
    if missing:
        raise InputError(
            f"{key}.{missing[0]} is missing", remedy=f"give it under [{key}], in '{units[missing[0]]}'"
        )
    return [parse_parameter(section, key, name, UNIT_OF.get(name)) for name in units]


def _parse_column(damper: Document, key: str) -> tuple[float, ...]:
    where = f"{DAMPER_SECTION}.{key}"
    fields = table_at(damper, key, where)
    refuse_unknown(fields, ("values", "unit", "about", "source"), f"{where}.")
    parse_unit(fields, where, DAMPER_UNITS[key])
    values = fields.get("values")
    if not isinstance(values, list):
        raise InputError(f"{where}.values is missing or not a list", remedy="give a list of numbers")
    return tuple(parse_number(value, f"{where}.values[{index}]") for index, value in enumerate(values))


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


def _check_mass_split(table: ParameterTable) -> None:
    total, lower, upper = table.values_of(("m_u", "m_L", "m_U"))
    if total <= lower + upper:
        raise InputError(
            f"masses.m_u = {total} kg leaves nothing for the upright beside m_L + m_U = {lower + upper} kg",
            remedy="m_u is the whole unsprung mass: wishbones and upright",
        )
