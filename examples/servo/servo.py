"""A motor that turns an arm against a spring, voltage in, angle and current out: a plant of one's own in one file."""

import savgs_ident as si

FORCE, INPUT, SENSOR = si.PortKind.FORCE, si.PortKind.INPUT, si.PortKind.SENSOR
STICKS = ("k_pre", "c_pre")
BEARING = si.Port("bearing", FORCE, "bearing", "angle; torque", "rad", "N m", 1.0, 10.0, 0.01, contact=STICKS)
SUPPLY = si.Port("supply", INPUT, "voltage", displacement_unit="V", displacement=0.1)
ENCODER = si.Port("encoder", SENSOR, "sensor.angle", displacement_unit="rad", displacement=1e-3)
SHUNT = si.Port("shunt", SENSOR, "sensor.current", displacement_unit="A", displacement=1e-2)


class Servo(si.StateSpacePlant):
    """Angle, speed and current of a motor; friction in its bearing is what may be missing."""

    states_declared = (
        si.State("phi", "rad", 0.1, "angle of the arm"),
        si.State("omega", "rad/s", 1.0, "its speed", rate_of="phi"),
        si.State("i", "A", 1.0, "current of the motor"),
    )
    inputs = (si.Input("voltage", "V", "voltage", moves=(0.05,)),)
    channels = (si.Channel("angle", "rad", "angle"), si.Channel("current", "A", "current"))
    ports = (BEARING, SUPPLY, ENCODER, SHUNT)
    parameters = si.ParameterTable(
        (
            si.Parameter("J", 0.0020, "kg m^2", lower=1e-4, upper=0.1, about="inertia of the arm"),
            si.Parameter("k", 0.5, "N m/rad", tolerance=0.01, lower=0.0, about="rate of the spring"),
            si.Parameter("d", 0.002, "N m s/rad", lower=0.0, upper=1.0, about="damping of the bearing"),
            si.Parameter("k_m", 0.05, "N m/A", tolerance=0.001, lower=0.0, about="torque constant"),
            si.Parameter("R", 1.0, "ohm", tolerance=0.02, lower=0.0, about="resistance"),
            si.Parameter("L", 0.005, "H", lower=1e-4, upper=0.1, about="inductance"),
            si.Parameter("k_pre", 50.0, "N m/rad", source="typical", about="bearing that sticks"),
            si.Parameter("c_pre", 0.05, "N m s/rad", source="typical", about="its damping"),
        )
    )

    def rhs(self, x, u, p, f):
        """Acceleration of the arm and rate of the current."""
        torque = p["k_m"] * x.i - p["k"] * x.phi - p["d"] * x.omega + f.force(BEARING, x.phi, x.omega)
        return {"omega": torque / p["J"], "i": (u.voltage - p["R"] * x.i - p["k_m"] * x.omega) / p["L"]}

    def output(self, x, dx, u, p):
        """What the encoder and the shunt show."""
        return x.phi, x.i
