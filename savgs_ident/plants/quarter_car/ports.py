"""Ports of the quarter-car rig: where forces act, what may give way, and what may be other than recorded.

Force ports. Force times velocity is power into the rig, but at the tyre's radius, where it is power out of it.

============== ===================================== ============================ =====================
port           displacement, velocity                positive force acts on       load
============== ===================================== ============================ =====================
rail           sprung mass over the frame, up        sprung mass, up              |F_Nt| + |F_Nb|
strut          strut length, growing in extension    strut, pushing it apart      the damper's push
suspension     suspension deflection l_s, bump       wheel, up, against the body  0
tyre_radial    tyre compression                      wheel, away from the plate   0
tyre_lateral   upright over the patch, outward       upright, outward             F_tz
============== ===================================== ============================ =====================

The velocity is the rate of the displacement, but for ``tyre_lateral``: there it is that of the upright's material
point, which the moving contact point leaves behind.

Series ports, each in the path of a load:

========= ============== ============================ ============================================
port      location       gives way (positive)         under the load (positive)
========= ============== ============================ ============================================
mount     strut          mount, shortening            push of the whole strut [N]
damper    strut          spring at the damper's end   push of the damper [N]
link      link           link, to greater angles      torque to greater angles [N m]
plate     road           plate, down                  F_tz [N]
carcass   tyre_lateral   upright over the patch, out  force on the plate, outward [N]
frame     frame          plate and rail, up           force on the frame, up [N]
========= ============== ============================ ============================================
"""

from collections.abc import Mapping
from types import MappingProxyType

from savgs_ident.effects.base import Family, Inertia, Number, Port, PortKind
from savgs_ident.plants.quarter_car.forces import REFERENCE_VELOCITY

RAIL = Port(
    "rail",
    PortKind.FORCE,
    "rail",
    about="sprung mass over the frame, up; force on the sprung mass; load |F_Nt| + |F_Nb|",
    loaded=True,
    contact=("k_pre", "c_pre"),
)
STRUT = Port(
    "strut",
    PortKind.FORCE,
    "strut",
    about="strut length; force that pushes it apart; load the damper's push",
    loaded=True,
    damped_at=REFERENCE_VELOCITY,
)
SUSPENSION = Port(
    "suspension",
    PortKind.FORCE,
    "suspension",
    about="suspension deflection, bump; force on the wheel, up, against the body",
)
TYRE_RADIAL = Port(
    "tyre_radial",
    PortKind.FORCE,
    "tyre_radial",
    about="tyre compression; force on the wheel, away from the plate",
    force=100.0,
    sense=-1.0,
)
TYRE_LATERAL = Port(
    "tyre_lateral",
    PortKind.FORCE,
    "tyre_lateral",
    about="upright over the patch, outward; force on the upright; load F_tz",
    velocity=0.05,
    loaded=True,
)

MOUNT = Port(
    "mount",
    PortKind.SERIES,
    "strut",
    about="mount, shortening, under the push of the strut",
    displacement=1e-3,
    velocity=0.1,
    force=2e3,
)
DAMPER = Port(
    "damper",
    PortKind.SERIES,
    "strut",
    about="spring at the damper's end, under the damper's push",
    displacement=1e-3,
    velocity=0.1,
    force=2e3,
)
LINK = Port(
    "link",
    PortKind.SERIES,
    "link",
    about="link, to greater angles, under the torque that way",
    displacement_unit="rad",
    force_unit="N m",
    displacement=1e-2,
    velocity=0.1,
    force=50.0,
    motion="strut",
)
PLATE = Port(
    "plate",
    PortKind.SERIES,
    "road",
    about="plate, down, under F_tz",
    displacement=1e-3,
    velocity=0.1,
    force=2e3,
    motion="tyre_radial",
)
CARCASS = Port(
    "carcass",
    PortKind.SERIES,
    "tyre_lateral",
    about="upright over the patch, outward, under the force on the plate",
    displacement=1e-3,
    velocity=0.1,
    force=500.0,
)
FRAME = Port(
    "frame",
    PortKind.SERIES,
    "frame",
    about="plate and rail, up, under the force on the frame",
    displacement=1e-3,
    velocity=0.1,
    force=2e3,
    resonant=True,
    motion="rail",
)

STRUT_NUMBERS = Port(
    "strut_numbers",
    PortKind.NUMBER,
    "strut",
    numbers=(
        Number("k_sd", "N/m", 8e3, Family.STIFFNESS),
        Number("l_free", "m", 5e-3),
        Number("c_sd", "N s/m", 600.0, Family.DAMPING),
    ),
)
LINK_NUMBERS = Port(
    "link_numbers",
    PortKind.NUMBER,
    "link",
    numbers=(Number("l_SL", "m", 5e-4), Number("theta_0", "rad", 0.2)),
)
TYRE_NUMBERS = Port(
    "tyre_numbers",
    PortKind.NUMBER,
    "tyre_radial",
    numbers=(Number("k_t", "N/m", 3e4, Family.STIFFNESS), Number("c_t", "N s/m", 1500.0, Family.DAMPING)),
)
INERTIA = Port(
    "inertia",
    PortKind.NUMBER,
    "inertia",
    numbers=(
        Number("m_s", "kg", 15.0),
        Number("m_u", "kg", 8.0),
        Number("m_L", "kg", 1.0),
        Number("m_U", "kg", 0.5),
        Number("J_L", "kg m^2", 0.05),
        Number("J_U", "kg m^2", 0.02),
        Number("J_K", "kg m^2", 0.1),
    ),
    inertias=(Inertia("rail", ("rail",)), Inertia("tyre_radial", ("rail", "suspension"))),
)
RAIL_NUMBERS = Port(
    "rail_numbers",
    PortKind.NUMBER,
    "rail",
    numbers=(
        Number("l_tb", "m", 0.02),
        Number("z_tb", "m", 0.02),
        Number("k_pre", "N/m", 1e6),
        Number("c_pre", "N s/m", 3e3),
    ),
)
ACCEL_NUMBERS = Port(
    "accel_numbers", PortKind.NUMBER, "sensor.sprung_accel", numbers=(Number("accel_gain", "1", 0.05),)
)
DEFLECTION_NUMBERS = Port(
    "deflection_numbers",
    PortKind.NUMBER,
    "sensor.susp_deflection",
    numbers=(Number("deflection_gain", "1", 0.05),),
)

ROAD = Port(
    "road", PortKind.INPUT, "road", about="height of the plate, up", displacement=1e-2, motion="tyre_radial"
)

ACCEL = Port(
    "accel",
    PortKind.SENSOR,
    "sensor.sprung_accel",
    about="acceleration of the sprung mass, up",
    displacement_unit="m/s^2",
    motion="rail",
)
DEFLECTION = Port(
    "deflection",
    PortKind.SENSOR,
    "sensor.susp_deflection",
    about="suspension deflection, bump",
    motion="suspension",
)

PORTS = (
    RAIL, STRUT, SUSPENSION, TYRE_RADIAL, TYRE_LATERAL,
    MOUNT, DAMPER, LINK, PLATE, CARCASS, FRAME,
    STRUT_NUMBERS, LINK_NUMBERS, TYRE_NUMBERS, INERTIA, RAIL_NUMBERS, ACCEL_NUMBERS, DEFLECTION_NUMBERS,
    ROAD, ACCEL, DEFLECTION,
)  # fmt: skip
"""All ports of the rig."""

LOCATION_WORDS: Mapping[str, str] = MappingProxyType(
    {
        "rail": "rail",
        "strut": "strut",
        "suspension": "wishbone joints",
        "tyre_radial": "tyre (radial)",
        "tyre_lateral": "tyre (lateral)",
        "link": "link and drive",
        "road": "road plate",
        "frame": "frame",
        "inertia": "masses",
        "sensor.sprung_accel": "accelerometer",
        "sensor.susp_deflection": "potentiometer",
    }
)
"""The locations as an engineer calls them."""
