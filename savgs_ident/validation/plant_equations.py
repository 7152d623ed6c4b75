"""The equations of a plant at random instants: what any solver relies on, told in words where it does not hold.

* They are finite numbers, and accelerations follow from them: the mass matrix is regular.
* Velocities at ports are the rates of their displacements, and a force pulls its port its own way: force times
  velocity is power.
* What gives way in series gives way under its load.
* Something acts at every port that is declared; effects at their null change nothing.
* Slopes are those of differences: nothing is hidden from differentiation.
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.core.values import Values, as_values
from savgs_ident.effects.base import InputSignal, Port, PortKind
from savgs_ident.effects.composition import nothing_imposed
from savgs_ident.plants.base import AbstractPlant, AtPorts, Motion
from savgs_ident.plants.from_file import fault_in
from savgs_ident.plants.model import PlantModel
from savgs_ident.validation.plant_declaration import Finding

INSTANTS = 3
"""Instants at which equations are looked at; what holds at three random ones holds nearly everywhere."""
STEP = 1e-6
"""Relative step of differences: rounding and curvature then err alike, by about 1e-9."""
SLOPE_TOLERANCE = 1e-4
"""Largest difference of slope and difference, relative to the largest slope of the same equation."""
NEGLIGIBLE = 1e-9
"""Relative size of what is zero but for rounding."""


@dataclass(frozen=True)
class Instant:
    """A plant at an instant of typical sizes.

    Attributes:
        x: coordinates, their rates and own states, then the time derivatives of the last two, (2 n + o + n + o,).
        value: the inputs, (m,).
        rate: their time derivatives, (m,).
    """

    x: NDArray[np.float64]
    value: NDArray[np.float64]
    rate: NDArray[np.float64]


class Equations(eqx.Module):
    """The equations and readings of a plant without effects, as functions of flat arrays."""

    plant: AbstractPlant
    names: tuple[str, ...] = eqx.field(static=True)

    def parts(self, x: Array, value: Array, rate: Array, imposed: Any) -> tuple[Motion, Array, Any]:
        """Motion, own states with their rates, (2, o), and the plant's inputs."""
        n, end, pack = len(self.plant.coordinates), self.size, self.plant.coordinate_type
        motion = Motion(*(pack(*jnp.unstack(x[i : i + n])) for i in (0, n, end)))
        own = jnp.stack([x[2 * n : end], x[end + n :]])
        signals = tuple(
            InputSignal(*pair) for pair in zip(jnp.unstack(value), jnp.unstack(rate), strict=True)
        )
        return motion, own, self.plant.drive(signals, None, imposed)

    @property
    def size(self) -> int:
        """How many states there are, (q, qd) and own ones."""
        return 2 * len(self.plant.coordinates) + len(self.plant.own_states)

    def _p(self, numbers: Array) -> Values:
        return dict(zip(self.names, jnp.unstack(numbers), strict=True))

    @eqx.filter_jit
    def residual(self, x: Array, value: Array, rate: Array, numbers: Array, imposed: Any) -> Array:
        """The equations of motion and of own states out of balance, (n + o,) [SI]."""
        motion, (s, sd), u = self.parts(x, value, rate, imposed)
        return self.plant.residual(self._p(numbers), motion, s, sd, u)

    @eqx.filter_jit
    def readings(self, x: Array, value: Array, rate: Array, numbers: Array, imposed: Any) -> Array:
        """What the channels show, (C,) [SI]."""
        motion, (s, sd), u = self.parts(x, value, rate, imposed)
        return jnp.stack([*self.plant.read(self._p(numbers), motion, s, sd, u)])

    @eqx.filter_jit
    def at_ports(self, x: Array, value: Array, rate: Array, numbers: Array, imposed: Any) -> AtPorts:
        """What laws see at the ports [SI]."""
        motion, (s, sd), u = self.parts(x, value, rate, imposed)
        return self.plant.at_ports(self._p(numbers), motion, s, sd, u)


class Bench:
    """A plant without effects, its numbers, and the instants at which it is looked at."""

    def __init__(self, model: PlantModel) -> None:
        self.model = model
        self.plant = eqx.tree_at(lambda plant: plant.effects, model.plant, ())
        self.names = tuple(each.name for each in model.table.entries)
        self.equations = Equations(self.plant, self.names)
        self.numbers = jnp.asarray([model.table[name].value for name in self.names])
        self.nothing = nothing_imposed(self.plant.ports, jnp.zeros(()))
        self.n = len(self.plant.coordinates)

    @cached_property
    def instants(self) -> tuple[Instant, ...]:
        """The same at every call, each drawn at random."""
        random = np.random.default_rng(1)
        return tuple(self._instant(random) for _ in range(INSTANTS))

    def _instant(self, random: np.random.Generator) -> Instant:
        own = [each.scale for each in self.plant.own_states]
        q, qd, qdd = (
            [getattr(each, name) for each in self.plant.coordinates]
            for name in ("size", "rate_size", "acceleration_size")
        )
        pace = qd[0] / q[0]
        sizes = np.array([*q, *qd, *own, *qdd, *(each * pace for each in own)])
        # Both signs, and no number near zero: a plant may have a corner there.
        drawn = random.uniform(0.2, 1.0, sizes.size) * random.choice([-1.0, 1.0], sizes.size)
        table = self.model.table
        rests = np.array([table[each.rest].value if each.rest else 0.0 for each in self.plant.inputs])
        moved = np.array([self._amplitude(place) for place in range(rests.size)])
        share = random.uniform(0.2, 1.0, (2, rests.size)) * random.choice([-1.0, 1.0], (2, rests.size))
        return Instant(sizes * drawn, rests + moved * share[0], moved * share[1] * pace)

    def _amplitude(self, place: int) -> float:
        moves = self.plant.inputs[place].moves
        sizes = [each.size / abs(by) for each, by in zip(self.plant.coordinates, moves, strict=True) if by]
        return min(sizes, default=0.0)

    def arguments(self, at: Instant) -> tuple[Array, Array, Array, Array, Any]:
        """What the functions of :class:`Equations` take there, with nothing imposed."""
        return jnp.asarray(at.x), jnp.asarray(at.value), jnp.asarray(at.rate), self.numbers, self.nothing


def check_equations(model: PlantModel) -> Iterator[Finding]:
    """What of the equations of the plant of ``model`` would mislead a solver, a fit or a diagnosis."""
    bench = Bench(model)
    # Each rests on the ones before it: a port asks for accelerations, an effect for its port.
    for stage in (_values, _masses, _ports, _slopes, _nulls):
        found = list(stage(bench))
        yield from found
        if found:
            return


def _values(bench: Bench) -> Iterator[Finding]:
    """Whether equations and readings can be evaluated, to finite numbers of the right shapes."""
    for what, function, rows in (
        ("evaluate", bench.equations.residual, bench.n + len(bench.plant.own_states)),
        ("read", bench.equations.readings, len(bench.plant.channels)),
    ):
        arguments = [bench.arguments(at) for at in bench.instants]
        try:
            values = [np.asarray(function(*each)) for each in arguments]
        except Exception as error:
            file = Path(getattr(sys.modules[type(bench.plant).__module__], "__file__", ""))
            yield Finding(
                "fault",
                f"{what} cannot be evaluated: {fault_in(file, error)}",
                "mend it there; use jax.numpy for all that depends on motion, inputs and parameters",
            )
            continue
        if values[0].shape != (rows,):
            yield Finding(
                "fault",
                f"{what} gives an array of shape {values[0].shape}, not ({rows},)",
                "give one number for each coordinate and own state"
                if what == "evaluate"
                else "give one for each channel",
            )
        elif not all(np.all(np.isfinite(each)) for each in values):
            yield Finding(
                "fault",
                f"{what} gives what is no finite number at an instant of typical sizes",
                "look for divisions by zero and roots of what may be negative",
            )


def _masses(bench: Bench) -> Iterator[Finding]:
    for at in bench.instants:
        mass = _mass(bench, at)
        scale = np.array([each.acceleration_size for each in bench.plant.coordinates])
        values = np.linalg.svd(
            mass * scale / np.max(np.abs(mass * scale), axis=1, keepdims=True).clip(1e-300)
        )[1]
        if values[-1] <= NEGLIGIBLE * values[0]:
            yield Finding(
                "fault",
                "the accelerations do not follow from the equations: the mass matrix is singular",
                "give every coordinate an equation with its acceleration in it, every own state one with its rate",
            )
            return


def _mass(bench: Bench, at: Instant) -> NDArray[np.float64]:
    x, *rest = bench.arguments(at)
    return -np.asarray(jax.jacfwd(bench.equations.residual)(x, *rest))[:, bench.equations.size :]


def _imposed_slopes(bench: Bench, at: Instant, port: Port) -> tuple[NDArray[np.float64], ...]:
    """Slopes of equations and readings in what is imposed at a port, (n, ...) and (C, ...)."""
    *rest, nothing = bench.arguments(at)

    def of(function: Any) -> NDArray[np.float64]:
        return np.asarray(
            jax.jacfwd(lambda v: function(*rest, {**nothing, port.name: v}))(nothing[port.name])
        )

    return of(bench.equations.residual), of(bench.equations.readings)


def _ports(bench: Bench) -> Iterator[Finding]:
    for port in bench.plant.ports:
        yield from _port(bench, port)


def _port(bench: Bench, port: Port) -> Iterator[Finding]:
    if port.kind not in (PortKind.FORCE, PortKind.SERIES, PortKind.INPUT):
        return
    at = bench.instants[0]
    residual, readings = _imposed_slopes(bench, at, port)
    if not (np.any(residual) or np.any(readings)):
        ask = {
            PortKind.FORCE: "add acting.force(PORT, PortSignals(...)) to the equations",
            PortKind.SERIES: "take acting.deflection(PORT) off what is in series, and acting.carry(PORT, load, rest)",
            PortKind.INPUT: "use acting.input(PORT, u.signals[...], u.fundamental) for the input",
        }[port.kind]
        yield Finding("fault", f"nothing acts at port '{port.name}', which is declared", ask)
    elif port.kind is PortKind.FORCE:
        yield from _force_port(bench, port)
    elif port.kind is PortKind.SERIES:
        yield from _series_port(bench, port)


def _force_port(bench: Bench, port: Port) -> Iterator[Finding]:
    """Velocity is the rate of displacement, and the force accelerates its port its own way."""
    n, size = bench.n, bench.equations.size
    for at in bench.instants:
        x, value, rate, numbers, nothing = bench.arguments(at)
        signals = bench.equations.at_ports(x, value, rate, numbers, nothing).signals[port.name]

        def displacement(x: Array, value: Array, rest: Any = (rate, numbers, nothing)) -> Array:
            return bench.equations.at_ports(x, value, *rest).signals[port.name].displacement

        by_x, by_value = (np.asarray(each) for each in jax.jacfwd(displacement, argnums=(0, 1))(x, value))
        rates = np.concatenate([at.x[n : 2 * n], np.zeros(n), at.x[size + n :]])
        parts = np.concatenate([by_x[:size] * rates, by_value * at.rate])
        moving, velocity = np.sum(parts), float(signals.velocity)
        if abs(moving - velocity) > SLOPE_TOLERANCE * max(np.sum(np.abs(parts)), abs(velocity)):
            yield Finding(
                "fault",
                f"port '{port.name}': its velocity is {velocity:.4g} where its displacement changes "
                f"by {moving:.4g} {port.displacement_unit}/s",
                "give the rate of the very displacement, with the motion of inputs in it",
            )
            return
        force = _imposed_slopes(bench, at, port)[0]
        pulled = float(by_x[:n] @ np.linalg.solve(_mass(bench, at), force)[:n]) * port.sense
        if pulled < 0.0:
            yield Finding(
                "fault",
                f"port '{port.name}': a force there pulls against its own displacement",
                "turn the sign of the force in the equations, or of displacement and velocity, or give sense = -1",
            )
            return


def _series_port(bench: Bench, port: Port) -> Iterator[Finding]:
    x, value, rate, numbers, nothing = bench.arguments(bench.instants[0])

    def load(way: Array) -> Array:
        there = bench.equations.at_ports(x, value, rate, numbers, {**nothing, port.name: way})
        return there.loads[port.name].total

    if port.name not in bench.equations.at_ports(x, value, rate, numbers, nothing).loads:
        yield Finding(
            "fault",
            f"port '{port.name}' is given no load",
            "call acting.carry(PORT, load, load at rest) once the load is known",
        )
    elif np.any(np.asarray(jax.jacfwd(load)(nothing[port.name])) > 0.0):
        yield Finding(
            "fault",
            f"port '{port.name}': what gives way there adds to its own load",
            "take the deflection off the displacement of what carries the load",
        )


def _slopes(bench: Bench) -> Iterator[Finding]:
    """Slopes in motion, inputs and parameters against differences."""
    coordinates = [each.name for each in bench.plant.coordinates]
    own = [each.name for each in bench.plant.own_states]
    labels = [
        *coordinates,
        *(f"rate of {name}" for name in coordinates),
        *own,
        *(f"acceleration of {name}" for name in coordinates),
        *(f"rate of {name}" for name in own),
        *(each.name for each in bench.plant.inputs),
        *(f"rate of {each.name}" for each in bench.plant.inputs),
        *bench.names,
    ]
    cuts = np.cumsum([bench.instants[0].x.size, len(bench.plant.inputs), len(bench.plant.inputs)])

    def both(flat: Array) -> Array:
        x, value, rate, numbers = jnp.split(flat, cuts)
        arguments = (x, value, rate, numbers, bench.nothing)
        return jnp.concatenate([bench.equations.residual(*arguments), bench.equations.readings(*arguments)])

    wrong: dict[str, None] = {}
    slope = jax.jit(jax.jacfwd(both))
    for at in bench.instants:
        flat = np.concatenate([at.x, at.value, at.rate, np.asarray(bench.numbers)])
        exact = np.asarray(slope(jnp.asarray(flat)))
        steps = STEP * np.where(flat != 0.0, np.abs(flat), 1.0)
        sides = np.asarray(
            jax.lax.map(both, jnp.asarray(np.concatenate([flat + np.diag(steps), flat - np.diag(steps)])))
        )
        found = (sides[: flat.size] - sides[flat.size :]).T / (2.0 * steps)
        rounding = np.max(np.abs(sides), axis=0)[:, None] * 1e-15 / steps
        scale = np.max(np.abs(exact) * np.abs(flat), axis=1, keepdims=True) / np.maximum(np.abs(flat), 1e-300)
        off = ~(np.abs(found - exact) <= SLOPE_TOLERANCE * scale + 100.0 * rounding)
        wrong |= dict.fromkeys(labels[place] for place in np.flatnonzero(np.any(off, axis=0)))
    if wrong:
        yield Finding(
            "fault",
            "slopes are not those of differences in: " + ", ".join(wrong),
            "use functions of jax.numpy that can be differentiated: no rounding, no stop_gradient, no numpy",
        )


def _nulls(bench: Bench) -> Iterator[Finding]:
    """No effect of the catalogue changes the equations at its null."""
    x, value, rate, numbers, nothing = bench.arguments(bench.instants[0])
    before = np.asarray(bench.equations.residual(x, value, rate, numbers, nothing))
    motion, own, u = bench.equations.parts(x, value, rate, nothing)
    size = np.max(np.abs(before))
    for effect in bench.model.catalogue.values():
        plant = bench.plant + effect
        values = {each.name: each.value for each in effect.parameters} | dict(effect.null)
        p = as_values(bench.model.parameters.as_dict() | values)
        still = jnp.zeros((2, len(plant.states) - own.shape[1]))
        after = np.asarray(plant.residual(p, motion, *jnp.concatenate([own, still], axis=1), u))[
            : before.size
        ]
        if not np.all(np.abs(after - before) <= 1e-6 * size):
            yield Finding(
                "fault",
                f"effect '{effect.name}' changes the equations at its null",
                "let the plant add what acting gives it as it is, and change nothing else by it",
            )
