"""The quarter-car rig as one implicit residual.

    r(q, qd, qdd, s, sd, input; p) = 0

with q = (z_s, theta_LW), s the internal states of the effects and the road and the link angle as inputs. The
first two rows are the equations of motion, the others say sd - rate = 0. Periodic solutions use the residual
as it stands; time integration solves it for (qdd, sd); nothing is written twice.

    simqc = QuarterCar(damper_curve(rig))
    simtr = simqc + RailCoulomb() + TyreFriction()
"""

from functools import partial
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.errors import InputError
from savgs_ident.model.damper import DamperCurve
from savgs_ident.model.dynamics import GeneralisedForce, Motion, carriage_load, point_force
from savgs_ident.model.effect import AbstractEffect, InternalState, Port, PortSignals
from savgs_ident.model.section import Section, SectionCurves, section
from savgs_ident.model.strut import Link, strut
from savgs_ident.model.tyre import Contact, Road, contact, radial_force
from savgs_ident.model.values import Values

HANDLED_PORTS = (Port.STRUT, Port.SUSPENSION, Port.TYRE_RADIAL, Port.TYRE_LATERAL, Port.RAIL)
"""Ports at which a force may act, in the order in which they are evaluated: the rail's load comes last."""


class Inputs(NamedTuple):
    """What drives the rig: road and link."""

    road: Road
    link: Link


class Loads(NamedTuple):
    """Forces [N] along the way to the residual, for reports and energy balances.

    ``strut`` pushes apart and ``strut_rate`` [m/s] is the rate of its length; ``vertical`` is F_tz;
    ``lateral`` the tyre friction on the upright; ``rail`` the friction on the sprung mass; ``carriage``
    |F_Nt| + |F_Nb|; ``reaction`` F_Ny [N] and M_Nx [N m]; ``touch`` the tyre's contact.
    """

    strut: Float[Array, ""]
    strut_rate: Float[Array, ""]
    vertical: Float[Array, ""]
    lateral: Float[Array, ""]
    rail: Float[Array, ""]
    carriage: Float[Array, ""]
    reaction: Float[Array, "2"]
    touch: Contact


class QuarterCar(eqx.Module):
    """The rig without friction, plus the effects that were added to it with ``+``.

    Adding raises :class:`InputError` for an effect at a port where no force can act, or one that is in the
    model already.
    """

    damper: DamperCurve
    effects: tuple[AbstractEffect, ...] = ()

    def __add__(self, effect: AbstractEffect) -> "QuarterCar":
        if effect.port not in HANDLED_PORTS:
            raise InputError(f"no force can act at port '{effect.port.value}'", source=effect.name)
        if effect.name in (present.name for present in self.effects):
            raise InputError(f"effect '{effect.name}' is in the model already")
        return QuarterCar(self.damper, (*self.effects, effect))

    @property
    def states(self) -> tuple[InternalState, ...]:
        """Internal states of all effects, in the order of the vector s."""
        return tuple(state for effect in self.effects for state in effect.states)

    def _at(self, port: Port, p: Values, signals: PortSignals, s: Array) -> tuple[Array, dict[str, Array]]:
        """Force of all effects at a port, and the rates of their states by effect name."""
        total, rates, start = jnp.zeros_like(signals.displacement), {}, 0
        for effect in self.effects:
            mine = s[start : start + len(effect.states)]
            start += len(effect.states)
            if effect.port is port:
                total = total + effect.force(p, signals, mine)
                rates[effect.name] = effect.rate(p, signals, mine)
        return total, rates

    def _evaluate(
        self, p: Values, at: Section, motion: Motion, s: Array, inputs: Inputs
    ) -> tuple[GeneralisedForce, Array, Loads]:
        zero = jnp.zeros_like(motion.q.z_s)
        omega = motion.qd.theta_LW

        leg = strut(p, at, omega, inputs.link)
        extra, rates = self._at(Port.STRUT, p, PortSignals(leg.length, leg.rate, zero), s)
        push = p["k_sd"] * (p["l_free"] - leg.length) + p["c_sd"] * self.damper(-leg.rate) + extra

        travel = PortSignals(at.W_z - p["W_z"], at.W_z_slope * omega, zero)
        joint, more = self._at(Port.SUSPENSION, p, travel, s)
        rates |= more

        touch = contact(p, at, motion, inputs.road)
        pressing = PortSignals(touch.compression, touch.compression_rate, zero)
        extra, more = self._at(Port.TYRE_RADIAL, p, pressing, s)
        rates |= more
        vertical = radial_force(p, touch, extra) / touch.cos_tilt
        scrub = PortSignals(touch.place[0], touch.lateral_velocity, vertical)
        lateral, more = self._at(Port.TYRE_LATERAL, p, scrub, s)
        rates |= more

        inertia = at.inertia @ jnp.stack([motion.qdd.z_s + p["g"], motion.qdd.theta_LW, omega**2])
        total = inertia + point_force(p, touch.place, touch.place_slope, (lateral, vertical))
        total += jnp.stack([zero, push * leg.slope + joint * at.W_z_slope, zero, zero])
        carriage = carriage_load(p, total)
        rail, more = self._at(Port.RAIL, p, PortSignals(motion.q.z_s, motion.qd.z_s, carriage), s)
        rates |= more
        total += jnp.stack([rail, zero, zero, zero])
        rate = jnp.concatenate([rates[effect.name] for effect in self.effects] or [jnp.zeros(0)])
        return total, rate, Loads(push, leg.rate, vertical, lateral, rail, carriage, -total[2:], touch)

    def residual(
        self,
        p: Values,
        motion: Motion,
        s: Array,
        sd: Array,
        inputs: Inputs,
        curves: SectionCurves | None = None,
    ) -> Array:
        """The residual, shape (2 + s,): force [N] and moment [N m] out of balance, rates out of balance.

        ``s`` and ``sd`` (s,) are the internal states and their rates, in the order of :attr:`states`.
        ``curves`` of the same parameters serve where many points share them; without, the kinematics are
        evaluated in closed form.
        """
        at = (curves or partial(section, p))(motion.q.theta_LW)
        total, rate, _ = self._evaluate(p, at, motion, s, inputs)
        return jnp.concatenate([total[:2], sd - rate])

    def loads(self, p: Values, motion: Motion, s: Array, inputs: Inputs) -> Loads:
        """Forces and reactions along a motion."""
        return self._evaluate(p, section(p, motion.q.theta_LW), motion, s, inputs)[2]
