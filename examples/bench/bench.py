"""A quarter car for the bench, two masses on a guide above a plate that moves: a plant of one's own in one file."""

import savgs_ident as si

FORCE, INPUT, SENSOR = (getattr(si.PortKind, kind) for kind in ("FORCE", "INPUT", "SENSOR"))
STICKS = ("k_pre", "c_pre")
GUIDE = si.Port("guide", FORCE, "guide", "height of the body", displacement=0.02, force=1.0, contact=STICKS)
SPRING = si.Port("spring", FORCE, "suspension", "deflection of the suspension", force=1.0)
TYRE = si.Port("tyre", FORCE, "tyre", "deflection of the tyre", force=1.0)
PLATE = si.Port("plate", INPUT, "plate", displacement=1e-4)
BODY = si.Port("body", SENSOR, "sensor.body", displacement=1e-4)
WHEEL = si.Port("wheel", SENSOR, "sensor.wheel", displacement=1e-4)
ACCELEROMETER = si.Port(
    "accelerometer", SENSOR, "sensor.body_accel", displacement_unit="m/s^2", displacement=0.1
)


class Bench(si.StateSpacePlant):
    """Heights of two masses over rest, road under them; friction in the guide of the body is what may be missing."""

    states_declared = (
        si.State("z_s", "m", 0.01, "height of the body"),
        si.State("v_s", "m/s", 0.1, "its speed", rate_of="z_s"),
        si.State("z_u", "m", 0.01, "height of the wheel"),
        si.State("v_u", "m/s", 0.1, "its speed", rate_of="z_u"),
    )
    inputs = (si.Input("plate", "m", "plate", moves=(1.0, 1.0)),)
    channels = (
        si.Channel("body", "m", "height of the body"),
        si.Channel("wheel", "m", "height of the wheel"),
        si.Channel("body_accel", "m/s^2", "acceleration of the body"),
    )
    ports = (GUIDE, SPRING, TYRE, PLATE, BODY, WHEEL, ACCELEROMETER)
    parameters = si.ParameterTable(
        (
            si.Parameter("m_s", 2.45, "kg", tolerance=0.02, lower=0.1, about="mass of the body"),
            si.Parameter("m_u", 1.0, "kg", tolerance=0.01, lower=0.1, about="mass of the wheel"),
            si.Parameter("k", 900.0, "N/m", lower=10.0, upper=1e4, about="stiffness of the suspension"),
            si.Parameter("c", 7.5, "N s/m", lower=0.1, upper=100.0, about="damping of the suspension"),
            si.Parameter("k_t", 2500.0, "N/m", tolerance=100.0, lower=10.0, about="stiffness of the tyre"),
            si.Parameter("c_t", 5.0, "N s/m", tolerance=1.0, lower=0.0, about="damping of the tyre"),
            si.Parameter(
                "k_pre", 1e4, "N/m", tolerance=5e3, lower=1.0, source="typical", about="guide that sticks"
            ),
            si.Parameter("c_pre", 10.0, "N s/m", source="typical", about="damping of a guide that sticks"),
        )
    )

    def rhs(self, x, u, p, f):
        """Accelerations of body and wheel."""
        deflection, rate = x.z_s - x.z_u, x.v_s - x.v_u
        strut = p["k"] * deflection + p["c"] * rate - f.force(SPRING, deflection, rate)
        over, over_rate = x.z_u - u.plate, x.v_u - u.plate_rate
        tyre = p["k_t"] * over + p["c_t"] * over_rate - f.force(TYRE, over, over_rate)
        return {
            "v_s": (f.force(GUIDE, x.z_s, x.v_s) - strut) / p["m_s"],
            "v_u": (strut - tyre) / p["m_u"],
        }

    def output(self, x, dx, u, p):
        """What the encoders and the accelerometer show."""
        return x.z_s, x.z_u, dx.v_s
