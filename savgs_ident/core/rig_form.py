"""The form of a rig file: its sections, the parameters of each, and the one unit each is given in.

A rig file has one section for every part of the rig. Names are unique over the whole file, so that the model
takes them flat; the section says where a reader finds them. Everything is SI: a number in millimetres is
refused rather than converted, so that a file means the same to everybody who reads it.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from savgs_ident.core.errors import InputError

SCHEMA = 1
"""The number of the form; a file with another one is refused."""

KNOWN_UNITS = frozenset(
    {
        "1", "m", "1/m", "m/s", "s/m", "m/s^2", "rad", "rad/m", "rad/s", "s", "Hz",
        "kg", "1/kg", "kg m^2", "N", "N/m", "N/m^2", "N/m^3", "m/N", "N s/m", "m/(N s)", "N s^2/m^2", "Pa",
        "N m", "N m/rad", "N m s/rad", "rad/(N m)", "J", "W",
        "A", "V", "ohm", "H", "Wb", "N m/A", "V/A", "V/(A s)",
    }
)  # fmt: skip
"""Units that a rig file may name. SI only."""

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


def check_unit(unit: str, where: str, expected: str | None) -> str:
    """``unit`` itself, if it is the ``expected`` one or, where the form expects none, a known one.

    Raises :class:`InputError` that begins with ``where`` otherwise.
    """
    if expected is not None and unit != expected:
        raise InputError(f"{where} is given in '{unit}'", remedy=f"convert it to '{expected}'")
    if unit not in KNOWN_UNITS:
        raise InputError(
            f"{where} has the unknown unit '{unit}'", remedy="choose among: " + ", ".join(sorted(KNOWN_UNITS))
        )
    return unit
