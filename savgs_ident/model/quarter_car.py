"""The quarter-car rig as one implicit residual.

    r(q, qd, qdd, s, sd, input; p) = 0

with q = (z_s, theta_LW), s the internal states of the effects and the road and the link angle as inputs. The
first two rows are the equations of motion, the others those of the states. Periodic solutions use the residual
as it stands; time integration solves it for (qdd, sd); nothing is written twice.

    simqc = QuarterCar(damper_curve(rig))
    simtr = simqc + RailCoulomb() + TyreFriction()
"""

from functools import partial
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from savgs_ident.core.errors import InputError
from savgs_ident.model.acting import Acting, Part, Way
from savgs_ident.model.bristle import ANCHOR, Presliding, bristle
from savgs_ident.model.damper import DamperCurve
from savgs_ident.model.dynamics import GeneralisedForce, Motion, carriage_load, point_force, weight
from savgs_ident.model.effect import (
    AbstractChange,
    AbstractEffect,
    AbstractGrip,
    AbstractSensorFault,
    InternalState,
    Load,
    Port,
    PortSignals,
)
from savgs_ident.model.inputs import Imposed, Inputs, nothing_imposed
from savgs_ident.model.section import Section, SectionCurves, section, section_curves
from savgs_ident.model.sensors import RESPONSE_CHANNELS, Readings, read_sensors
from savgs_ident.model.strut import Link, Strut, strut, strut_at_rest
from savgs_ident.model.tyre import Contact, Road, contact, radial_force
from savgs_ident.model.values import Values


class Loads(NamedTuple):
    """Forces [N] along the way to the residual, for reports and energy balances.

    ``strut`` pushes apart and ``strut_rate`` [m/s] is the rate of its length; ``vertical`` is F_tz;
    ``lateral`` the tyre friction on the upright; ``rail`` the friction on the sprung mass; ``carriage``
    |F_Nt| + |F_Nb|; ``reaction`` F_Ny [N] and M_Nx [N m]; ``touch`` the tyre's contact; ``ports`` what the
    forces at each port see, ``carried`` the load under which something may give way there.
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
    carried: dict[str, Load]

    @property
    def link_torque(self) -> Float[Array, ""]:
        """Torque [N m] of the strut on the link, towards greater angles."""
        return self.carried[Port.LINK.value].total


class QuarterCar(eqx.Module):
    """The rig without friction, plus the effects that were added to it with ``+``.

    Adding raises :class:`InputError` for an effect that is in the model already.
    """

    damper: DamperCurve
    effects: tuple[AbstractEffect, ...] = ()

    def __add__(self, effect: AbstractEffect) -> "QuarterCar":
        if effect.name in (present.name for present in self.effects):
            raise InputError(f"effect '{effect.name}' is in the model already")
        return QuarterCar(self.damper, (*self.effects, effect))

    @property
    def grips(self) -> bool:
        """Whether the rail's carriages hold at all."""
        return any(isinstance(effect, AbstractGrip) for effect in self.effects)

    @property
    def states(self) -> tuple[InternalState, ...]:
        """Internal states: the rail's anchor if it holds, then those of all effects in their order."""
        own = tuple(state for effect in self.effects for state in effect.states)
        return (ANCHOR, *own) if self.grips else own

    @property
    def sensors_have_dynamics(self) -> bool:
        """Whether a sensor shows anything but the present truth."""
        return any(isinstance(effect, AbstractSensorFault) for effect in self.effects)

    def effective(self, p: Values) -> Values:
        """The rig's numbers with all changes made."""
        for effect in self.effects:
            if isinstance(effect, AbstractChange):
                p = dict(p) | dict(effect.changes(p))
        return p

    def curves(self, p: Values) -> SectionCurves:
        """Kinematics and inertia of a parameter set, for many evaluations of it."""
        return section_curves(self.effective(p))

    def read(self, p: Values, theta_LW: Float[Array, ""], acceleration: Float[Array, ""]) -> Readings:
        """What the sensors would show at a wishbone angle [rad] and an acceleration [m/s^2] if none had dynamics.

        See :meth:`transfers`.
        """
        return read_sensors(self.effective(p), theta_LW, acceleration)

    def transfers(self, p: Values, frequency: Float[Array, "*f"]) -> Complex[Array, "C *f"]:
        """Reading over truth of the response channels at frequencies [Hz], errors of the sensors alone."""
        rows = []
        for channel in RESPONSE_CHANNELS:
            row = jnp.ones_like(frequency, dtype=jnp.complex128)
            for effect in self.effects:
                if isinstance(effect, AbstractSensorFault) and effect.port.value == f"sensor.{channel}":
                    row = row * effect.transfer(p, frequency)
            rows.append(row)
        return jnp.stack(rows)

    def _parts(self, s: Array, sd: Array) -> tuple[Part, ...]:
        """The effects with their states."""
        parts, start = [], int(self.grips)
        for effect in self.effects:
            mine = slice(start, start + len(effect.states))
            parts.append(Part(effect, s[mine], sd[mine]))
            start = mine.stop
        return tuple(parts)

    def _evaluate(
        self, p: Values, at: Section, motion: Motion, s: Array, sd: Array, inputs: Inputs
    ) -> tuple[GeneralisedForce, Array, Loads]:
        """Generalised forces (4,), the balances of the states (s,), and the loads."""
        acting = Acting(self._parts(s, sd), p)
        given = inputs.imposed or nothing_imposed(motion.q.z_s)
        leg, push = self._strut(acting, at, motion, inputs, given)
        frame = acting.way(Port.FRAME, given.frame_way)
        touch, vertical, lateral = _wheel(acting, at, motion, inputs, given, frame)
        travel = PortSignals(at.W_z - p["W_z"], at.W_z_slope * motion.qd.theta_LW, jnp.zeros_like(push))
        joint = acting.force(Port.SUSPENSION, travel, given.suspension)

        omega, zero = motion.qd.theta_LW, jnp.zeros_like(push)
        inertia = at.inertia @ jnp.stack([motion.qdd.z_s + p["g"], motion.qdd.theta_LW, omega**2])
        total = inertia + point_force(p, touch.place, touch.place_slope, (lateral, vertical))
        total += jnp.stack([zero, push * leg.slope + joint * at.W_z_slope, zero, zero])
        carriage = carriage_load(p, total)
        sliding = PortSignals(motion.q.z_s - frame.displacement, motion.qd.z_s - frame.velocity, carriage)
        rail = acting.force(Port.RAIL, sliding, given.rail)
        anchor = []
        if self.grips:
            held = bristle(Presliding(p["k_pre"], p["c_pre"]), sliding, acting.grip(sliding), s[0])
            rail += held.force
            anchor = [sd[:1] - held.rate]
        acting.carry(Port.FRAME, -vertical - rail, -weight(p))
        total += jnp.stack([rail, zero, zero, zero])
        states = [acting.balances[part.effect.name] for part in acting.parts if part.effect.states]
        balance = jnp.concatenate([*anchor, *states] or [jnp.zeros(0)])
        reaction = -total[2:]
        loads = Loads(
            push, leg.rate, vertical, lateral, rail, carriage, reaction, touch, acting.ports, acting.carried
        )
        return total, balance, loads

    def _strut(
        self, acting: Acting, at: Section, motion: Motion, inputs: Inputs, given: Imposed
    ) -> tuple[Strut, Array]:
        """The leg from eye to crank pin, and the force with which it pushes apart."""
        p = acting.p
        way = acting.way(Port.LINK, given.link_way)
        link = Link(inputs.link.angle + way.displacement, inputs.link.velocity + way.velocity)
        leg = strut(p, at, motion.qd.theta_LW, link)
        mount = acting.way(Port.STRUT, given.mount_way)
        end = acting.way(Port.STRUT, given.damper_way, in_damper=True)
        length, rate = leg.length + mount.displacement, leg.rate + mount.velocity
        damping = p["c_sd"] * self.damper(-(rate + end.velocity))
        extra = acting.force(Port.STRUT, PortSignals(length, rate, damping), given.strut)
        push = p["k_sd"] * (p["l_free"] - length) + damping + extra
        rest = strut_at_rest(p)
        acting.carry(Port.STRUT, push, rest.push)
        acting.carry(Port.STRUT, damping, jnp.zeros_like(damping), in_damper=True)
        acting.carry(Port.LINK, push * leg.link_slope, rest.torque)
        return leg, push

    def residual(
        self,
        p: Values,
        motion: Motion,
        s: Array,
        sd: Array,
        inputs: Inputs,
        curves: SectionCurves | None = None,
    ) -> Array:
        """The residual, shape (2 + s,): force [N] and moment [N m] out of balance, states out of balance.

        ``s`` and ``sd`` (s,) are the internal states and their rates, in the order of :attr:`states`.
        :meth:`curves` of the same parameters serve where many points share them; without, the kinematics are
        evaluated in closed form.
        """
        p = self.effective(p)
        at = (curves or partial(section, p))(motion.q.theta_LW)
        total, balance, _ = self._evaluate(p, at, motion, s, sd, inputs)
        return jnp.concatenate([total[:2], balance])

    def loads(
        self,
        p: Values,
        motion: Motion,
        s: Array,
        sd: Array,
        inputs: Inputs,
        curves: SectionCurves | None = None,
    ) -> Loads:
        """Forces and reactions along a motion; ``s`` and ``sd`` (s,) as in :meth:`residual`, in their units."""
        p = self.effective(p)
        at = (curves or partial(section, p))(motion.q.theta_LW)
        return self._evaluate(p, at, motion, s, sd, inputs)[2]


def _wheel(
    acting: Acting, at: Section, motion: Motion, inputs: Inputs, given: Imposed, frame: Way
) -> tuple[Contact, Array, Array]:
    """The tyre's contact, its vertical load F_tz and the lateral force on the upright."""
    p = acting.p
    sunk = acting.way(Port.ROAD, given.plate_way)
    plate = acting.plate(inputs)
    road = Road(
        plate.height - sunk.displacement + frame.displacement, plate.velocity - sunk.velocity + frame.velocity
    )
    touch = contact(p, at, motion, road)
    pressing = PortSignals(touch.compression, touch.compression_rate, jnp.zeros_like(touch.compression))
    extra = acting.force(Port.TYRE_RADIAL, pressing, given.tyre_radial)
    vertical = radial_force(p, touch, extra) / touch.cos_tilt
    acting.carry(Port.ROAD, vertical, weight(p))
    carcass = acting.way(Port.TYRE_LATERAL, given.carcass_way)
    scrub = PortSignals(
        touch.place[0] - carcass.displacement, touch.lateral_velocity - carcass.velocity, vertical
    )
    lateral = acting.force(Port.TYRE_LATERAL, scrub, given.tyre_lateral)
    acting.carry(Port.TYRE_LATERAL, -lateral, jnp.zeros_like(lateral))
    return touch, vertical, lateral
