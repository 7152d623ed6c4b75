"""A damper on a dynamometer, whose rod is moved while a load cell reads the force: a plant held against its drive."""

import savgs_ident as si

SEALS = si.Port(
    "seals",
    si.PortKind.FORCE,
    "damper",
    "stroke; force on the rod",
    displacement=1e-2,
    velocity=0.1,
    contact=("k_pre", "c_pre"),
)
CELL = si.Port("cell", si.PortKind.INPUT, "force", displacement_unit="N")
ENCODER = si.Port("encoder", si.PortKind.SENSOR, "sensor.stroke", displacement=1e-4)


class Damper(si.StateSpacePlant):
    """The rod; what the seals and the fluid do beside a viscous force is what may be missing."""

    states_declared = (
        si.State("x", "m", 0.01, "stroke"),
        si.State("v", "m/s", 0.1, "its speed", rate_of="x"),
    )
    inputs = (si.Input("force", "N", "force on the rod", moves=(1e-4,)),)
    channels = (si.Channel("stroke", "m", "stroke"),)
    ports = (SEALS, CELL, ENCODER)
    parameters = si.ParameterTable(
        (
            si.Parameter("m", 0.5, "kg", tolerance=0.2, lower=0.0, about="mass of the rod"),
            si.Parameter("c", 500.0, "N s/m", lower=0.0, upper=1e6, about="viscous damping"),
            si.Parameter(
                "k_pre", 1e6, "N/m", tolerance=2e6, lower=0.0, source="typical", about="stuck seals"
            ),
            si.Parameter("c_pre", 1e3, "N s/m", source="typical", about="damping of stuck seals"),
        )
    )

    def rhs(self, x, u, p, f):
        """Acceleration of the rod."""
        return {"v": (u.force - p["c"] * x.v + f.force(SEALS, x.x, x.v)) / p["m"]}

    def output(self, x, dx, u, p):
        """What the encoder shows."""
        return (x.x,)
