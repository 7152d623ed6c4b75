"""Where the parameters of a rig's sheet sit: the port at which one would show whose tolerance does not hold.

Hardpoints have none: they bend the kinematics, and with them what all ports see.
"""

from collections.abc import Mapping

from savgs_ident.model.effect import Port

SEATS: Mapping[str, Port] = {
    **dict.fromkeys(("k_sd", "l_free", "c_sd"), Port.STRUT),
    **dict.fromkeys(("l_SL", "theta_0"), Port.LINK),
    **dict.fromkeys(("k_t", "c_t"), Port.TYRE_RADIAL),
    **dict.fromkeys(("m_s", "m_u", "m_L", "m_U", "J_L", "J_U", "J_K"), Port.INERTIA),
    **dict.fromkeys(("l_tb", "z_tb", "k_pre", "c_pre"), Port.RAIL),
    "accel_gain": Port.SENSOR_SPRUNG_ACCEL,
    "deflection_gain": Port.SENSOR_SUSP_DEFLECTION,
}
"""Port by parameter."""
