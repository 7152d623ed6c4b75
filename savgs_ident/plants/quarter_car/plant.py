"""The quarter-car rig as one implicit residual.

    r(q, qd, qdd, s, sd, u; p) = 0

with q = (z_s, theta_LW), s the internal states of the effects and the road and the link angle as inputs u. The
first two rows are the equations of motion, the others those of the states.

    simqc = QuarterCar(damper_curve(rig))
    simtr = simqc + CATALOGUE["rail_coulomb"] + CATALOGUE["tyre_friction"]

Its static equilibrium is where it stands when nothing moves. Suspension deflection is counted from the equilibrium at
the nominal link angle, as a recording counts it from its standstill.
"""

from collections.abc import Mapping
from functools import partial
from math import pi
from typing import ClassVar, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.small_root import Root
from savgs_ident.core.values import Values
from savgs_ident.effects.base import Fundamental, InputSignal, Load, Port, PortSignals
from savgs_ident.effects.composition import (
    EffectsAtInstant,
    SeriesDeflection,
)
from savgs_ident.plants.at_rest import find_rest, standing
from savgs_ident.plants.base import (
    AbstractPlant,
    Channel,
    Coordinate,
    Input,
    Motion,
    OperatingCondition,
    Output,
)
from savgs_ident.plants.quarter_car.dynamics import (
    TRAVEL,
    Coordinates,
    GeneralisedForce,
    Section,
    SectionCurves,
    carriage_load,
    point_force,
    section,
    section_curves,
    weight,
)
from savgs_ident.plants.quarter_car.forces import (
    Contact,
    DamperCurve,
    Inputs,
    Link,
    Road,
    Strut,
    contact,
    radial_force,
    strut,
    strut_at_rest,
)
from savgs_ident.plants.quarter_car.kinematics import strut_length, suspension_travel
from savgs_ident.plants.quarter_car.ports import (
    CARCASS,
    DAMPER,
    FRAME,
    LINK,
    LOCATION_WORDS,
    MOUNT,
    PLATE,
    PORTS,
    RAIL,
    ROAD,
    STRUT,
    SUSPENSION,
    TYRE_LATERAL,
    TYRE_RADIAL,
)


class Readings(NamedTuple):
    """Sprung-mass acceleration [m/s^2] and suspension deflection [m], as indicated.

    The deflection counts from the drawing's nominal state; a recording counts from its own standstill, so the
    means of the two are not comparable, everything else is.
    """

    sprung_accel: Float[Array, ""]
    susp_deflection: Float[Array, ""]


def read_sensors(p: Values, theta_LW: Float[Array, ""], acceleration: Float[Array, ""]) -> Readings:
    """Indicated values at a wishbone angle [rad] and a sprung-mass acceleration [m/s^2], gains included."""
    return Readings(p["accel_gain"] * acceleration, p["deflection_gain"] * suspension_travel(p, theta_LW))


COORDINATES = (
    Coordinate("z_s", "m", "height of the sprung mass, up positive", 1e-2, 1e-1, 1.0),
    Coordinate("theta_LW", "rad", "angle of the lower wishbone from the drawing", 3e-2, 3e-1, 3.0, TRAVEL),
)

INPUTS = (
    Input(
        "road_height",
        "m",
        "road",
        moves=(1.0, 3.0),
        details="height of the plate, up positive",
        rate_name="road_velocity",
        keeps_mean=False,
        stroke="cam_peak_to_peak",
    ),
    # What a link of some 10 mm moves, seen over an arm of a third of a metre.
    Input(
        "link_angle",
        "rad",
        "link angle",
        moves=(1e-2, 3e-2),
        details="angle of the single link",
        rate_name="link_velocity",
        rest="psi_nominal",
        required=False,
        keeps_mean=True,
        orders=9,
    ),
)

CHANNELS = (
    Channel("sprung_accel", "m/s^2", "sprung-mass acceleration", decay=1),
    Channel("susp_deflection", "m", "suspension deflection", decay=2),
)

CONDITIONS = (
    OperatingCondition("the same programme again"),
    OperatingCondition("half the cam's lift", scale=0.5),
    OperatingCondition("1.4 times the cam's lift", scale=1.4),
    OperatingCondition("the link at 60 deg", offsets={"link_angle": -pi / 6.0}),
    OperatingCondition("the link at 120 deg", offsets={"link_angle": pi / 6.0}),
    OperatingCondition("50 kg of payload", changes={"m_s": 50.0}),
    OperatingCondition(
        "the road standing still and the link swung by 10 deg", scale=0.0, swings={"link_angle": pi / 18.0}
    ),
)


OUTPUTS = (
    Output("tyre_load", "N", "vertical load of the tyre"),
    Output("rail_force", "N", "friction of the railway on the sprung mass, up positive"),
    Output("strut_force", "N", "force with which the strut pushes apart"),
    Output("link_torque", "N m", "torque of the strut on the link towards greater angles"),
)


class Loads(NamedTuple):
    """Forces [N] along the way to the residual, for reports and energy balances.

    ``strut`` pushes apart and ``strut_rate`` [m/s] is the rate of its length; ``vertical`` is F_tz;
    ``lateral`` the tyre friction on the upright; ``rail`` the friction on the sprung mass; ``carriage``
    |F_Nt| + |F_Nb|; ``reaction`` F_Ny [N] and M_Nx [N m]; ``touch`` the tyre's contact; ``ports`` what the
    forces at each port see, ``forces`` the whole force there, the rig's own element and all effects together,
    signs as in :mod:`savgs_ident.plants.quarter_car.ports`; ``carried`` the load under which
    something may give way there.
    """

    strut: Float[Array, ""]
    strut_rate: Float[Array, ""]
    vertical: Float[Array, ""]
    lateral: Float[Array, ""]
    rail: Float[Array, ""]
    carriage: Float[Array, ""]
    reaction: Float[Array, "2"]
    touch: Contact
    ports: dict[str, PortSignals]
    forces: dict[str, Float[Array, ""]]
    carried: dict[str, Load]

    @property
    def link_torque(self) -> Float[Array, ""]:
        """Torque [N m] of the strut on the link, towards greater angles."""
        return self.carried[LINK.name].total


class QuarterCar(AbstractPlant):
    """The rig without friction, plus the effects that were added to it with ``+``.

    Adding raises :class:`InputError` for an effect that is in the model already.
    """

    damper: DamperCurve
    coordinates: ClassVar[tuple[Coordinate, ...]] = COORDINATES
    coordinate_type: ClassVar[type[Coordinates]] = Coordinates
    inputs: ClassVar[tuple[Input, ...]] = INPUTS
    channels: ClassVar[tuple[Channel, ...]] = CHANNELS
    ports: ClassVar[tuple[Port, ...]] = PORTS
    outputs: ClassVar[tuple[Output, ...]] = OUTPUTS
    conditions: ClassVar[tuple[OperatingCondition, ...]] = CONDITIONS
    location_words: ClassVar[Mapping[str, str]] = LOCATION_WORDS

    def prepare(self, p: Values) -> SectionCurves:
        """Kinematics and inertia of a parameter set, for many evaluations of it."""
        return section_curves(self.effective(p))

    def drive(
        self,
        signals: tuple[InputSignal, ...],
        fundamental: Fundamental | None = None,
        imposed: Mapping[str, Array] | None = None,
    ) -> Inputs:
        """Road and link from their signals [m], [rad]; the angle and speed of the cam where it turns."""
        road, link = signals
        return Inputs(Road(*road), Link(*link), fundamental, imposed)

    def cold_start(self, u: Inputs) -> tuple[Coordinates, Coordinates, list[Array]]:
        """The rig carried along by the road as one."""
        height, velocity = u.road
        rest = jnp.zeros_like(height)
        states = [height if state.slips else rest for state in self.states]
        return Coordinates(height, rest), Coordinates(velocity, rest), states

    def read_outputs(self, loads: Loads) -> tuple[Float[Array, ""], ...]:
        """Loads [N] of tyre, rail and strut, torque on the link [N m]."""
        return loads.vertical, loads.rail, loads.strut, loads.link_torque

    def read(
        self,
        p: Values,
        motion: Motion,
        s: Array,
        sd: Array,
        u: Inputs,
        prepared: SectionCurves | None = None,
    ) -> Readings:
        """What the sensors would show if none had dynamics; see :meth:`transfers`."""
        return read_sensors(self.effective(p), motion.q.theta_LW, motion.qdd.z_s)

    def evaluate(
        self,
        p: Values,
        motion: Motion,
        u: Inputs,
        acting: EffectsAtInstant,
        prepared: SectionCurves | None = None,
    ) -> tuple[GeneralisedForce, Loads]:
        """Force along z_s [N] and moment along theta_LW [N m] out of balance, and the loads.

        Where ``prepared`` is not given, the kinematics are evaluated in closed form.
        """
        at = (prepared or partial(section, p))(motion.q.theta_LW)
        leg, push = self._strut(acting, at, motion, u)
        frame = acting.deflection(FRAME)
        touch, vertical, lateral = _wheel(acting, at, motion, u, frame)
        none = jnp.zeros_like(push)
        travel = PortSignals(at.W_z - p["W_z"], at.W_z_slope * motion.qd.theta_LW, none, none)
        joint = acting.force(SUSPENSION, travel)

        omega, zero = motion.qd.theta_LW, jnp.zeros_like(push)
        inertia = at.inertia @ jnp.stack([motion.qdd.z_s + p["g"], motion.qdd.theta_LW, omega**2])
        total = inertia + point_force(p, touch.place, touch.place_slope, (lateral, vertical))
        total += jnp.stack([zero, push * leg.slope + joint * at.W_z_slope, zero, zero])
        carriage = carriage_load(p, total)
        sliding = PortSignals(
            motion.q.z_s - frame.displacement, motion.qd.z_s - frame.velocity, carriage, zero
        )
        rail = acting.force(RAIL, sliding)
        acting.carry(FRAME, -vertical - rail, -weight(p))
        total += jnp.stack([rail, zero, zero, zero])
        reaction = -total[2:]
        acting.report(STRUT, push)
        acting.report(TYRE_RADIAL, vertical * touch.cos_tilt)
        loads = Loads(
            strut=push,
            strut_rate=leg.rate,
            vertical=vertical,
            lateral=lateral,
            rail=rail,
            carriage=carriage,
            reaction=reaction,
            touch=touch,
            ports=acting.signals,
            forces=acting.forces,
            carried=acting.loads,
        )
        return total[:2], loads

    def _strut(
        self, acting: EffectsAtInstant, at: Section, motion: Motion, inputs: Inputs
    ) -> tuple[Strut, Array]:
        """The leg from eye to crank pin, and the force with which it pushes apart."""
        p = acting.p
        yielded = acting.deflection(LINK)
        link = Link(inputs.link.angle + yielded.displacement, inputs.link.velocity + yielded.velocity)
        leg = strut(p, at, motion.qd.theta_LW, link)
        mount = acting.deflection(MOUNT)
        end = acting.deflection(DAMPER)
        length, rate = leg.length + mount.displacement, leg.rate + mount.velocity
        damping = p["c_sd"] * self.damper(-(rate + end.velocity))
        nominal = strut_length(p, jnp.zeros_like(length), p["psi_nominal"])
        extra = acting.force(STRUT, PortSignals(length, rate, damping, nominal))
        push = p["k_sd"] * (p["l_free"] - length) + damping + extra
        rest = strut_at_rest(p)
        acting.carry(MOUNT, push, rest.push)
        acting.carry(DAMPER, damping, jnp.zeros_like(damping))
        acting.carry(LINK, push * leg.link_slope, rest.torque)
        return leg, push


def _wheel(
    acting: EffectsAtInstant,
    at: Section,
    motion: Motion,
    inputs: Inputs,
    frame: SeriesDeflection,
) -> tuple[Contact, Array, Array]:
    """The tyre's contact, its vertical load F_tz and the lateral force on the upright."""
    p = acting.p
    sunk = acting.deflection(PLATE)
    height, velocity = acting.input(ROAD, InputSignal(*inputs.road), inputs.cam)
    road = Road(height - sunk.displacement + frame.displacement, velocity - sunk.velocity + frame.velocity)
    touch = contact(p, at, motion, road)
    none = jnp.zeros_like(touch.compression)
    slack = p["r_free"] - p["W_z"] / jnp.cos(p["tilt"])
    pressing = PortSignals(touch.compression, touch.compression_rate, none, slack)
    extra = acting.force(TYRE_RADIAL, pressing)
    vertical = radial_force(p, touch, extra) / touch.cos_tilt
    acting.carry(PLATE, vertical, weight(p))
    carcass = acting.deflection(CARCASS)
    scrub = PortSignals(
        touch.place[0] - carcass.displacement,
        touch.lateral_velocity - carcass.velocity,
        vertical,
        p["W_y"] + p["W_z"] * jnp.tan(p["tilt"]),
    )
    lateral = acting.force(TYRE_LATERAL, scrub)
    acting.carry(CARCASS, -lateral, none)
    return touch, vertical, lateral


class Equilibrium(NamedTuple):
    """Coordinates and internal states (s,) at rest, the push of the strut apart [N], and how they were found."""

    q: Coordinates
    s: Float[Array, " s"]
    strut: Float[Array, ""]
    root: Root


def static_equilibrium(
    model: QuarterCar,
    p: Values,
    link_angle: Float[Array, ""],
    road_height: Float[Array, ""],
    prepared: SectionCurves | None = None,
) -> Equilibrium:
    """Where the rig rests at a link angle [rad] and a height of the plate [m]; look at the status of its root.

    ``prepared`` serves as in :meth:`QuarterCar.residual`. Differentiable in everything, exactly.
    """
    zero = jnp.zeros_like(link_angle)
    u = Inputs(Road(road_height, zero), Link(link_angle, zero))
    q, s, root = find_rest(model, p, u, prepared)
    loads = model.loads(p, standing(model, q), s, jnp.zeros_like(s), u, prepared)
    return Equilibrium(q, s, loads.strut, root)


def deflection_zero(model: QuarterCar, p: Values, prepared: SectionCurves | None = None) -> Float[Array, ""]:
    """Suspension travel from the drawing [m] at which a recorded deflection is zero.

    That is at standstill with the link at its nominal angle.
    """
    nominal = jnp.asarray(p["psi_nominal"])
    rest = static_equilibrium(model, p, nominal, jnp.zeros_like(nominal), prepared)
    return suspension_travel(p, rest.q.theta_LW)
