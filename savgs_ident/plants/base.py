"""What a solver, a fit, a diagnosis or an export may know of a plant.

A plant is a test rig as one implicit residual

    r(q, qd, qdd, s, sd, u; p) = 0

with n coordinates q, the internal states s of its effects, the inputs u (what is recorded and imposed: the height of
a road, the angle of a link, a drive force) and the parameters p. The first n rows are the equations of motion, the
others those of the states. A plant declares its coordinates with their typical sizes, its inputs and its channels
(what its sensors read); every size that a solver needs follows from the declaration.

Periodic solutions use the residual as it stands; time integration solves it for (qdd, sd); an export translates it.
No equation is written twice.
"""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import inf
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple, Self

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float
from numpy.typing import NDArray

from savgs_ident.core.values import Values
from savgs_ident.effects.alternatives import Alternatives, AtOnePort
from savgs_ident.effects.base import (
    AbstractSensorLaw,
    Fundamental,
    InputSignal,
    InternalState,
    Load,
    Port,
    PortSignals,
)
from savgs_ident.effects.composition import (
    EffectsAtInstant,
    added,
    changed_numbers,
    sensor_transfer,
    states_of,
)
from savgs_ident.effects.effect import Effect
from savgs_ident.responses.harmonic_response import ComparedPart

Scalar = Float[Array, ""]


@dataclass(frozen=True)
class Coordinate:
    """One generalised coordinate.

    Attributes:
        name: its name in files and reports.
        unit: its unit, SI.
        about: what it is.
        size: typical displacement [``unit``]; with the two below it sets tolerances of solvers.
        rate_size: typical rate [``unit``/s].
        acceleration_size: typical acceleration [``unit``/s^2].
        travel: largest displacement for which the equations hold [``unit``].
    """

    name: str
    unit: str
    about: str
    size: float
    rate_size: float
    acceleration_size: float
    travel: float = inf


@dataclass(frozen=True)
class Input:
    """One input: a signal that is recorded and imposed on the model.

    Attributes:
        name: the channel in which it is recorded.
        unit: its unit, SI.
        about: what it is, in a word or two.
        details: the same with its sign, for exports; ``about`` where empty.
        rate_name: name of its rate in exports; ``<name>_rate`` where empty.
        moves: typical motion of each coordinate per unit of this input, (n,) [coordinate's unit per ``unit``].
        rest: name of the parameter that holds its value at rest; empty where that is zero.
        required: whether a recording without it is refused; otherwise it stays at rest.
        keeps_mean: whether its mean counts; where it is None, it does unless the plant moves along with the input as
            a whole (:func:`savgs_ident.plants.at_rest.carried_along`). A plate, say, has no absolute height.
        orders: highest order of its motion that is imposed; what lies above is below the sensor's resolution.
        stroke: name of the parameter that holds its motion in a test, peak to peak; empty where the sizes of the
            coordinates say how far it moves.
    """

    name: str
    unit: str
    about: str
    moves: tuple[float, ...]
    details: str = ""
    rate_name: str = ""
    rest: str = ""
    required: bool = True
    keeps_mean: bool | None = None
    orders: int | None = None
    stroke: str = ""


@dataclass(frozen=True)
class Channel:
    """What one sensor reads.

    Attributes:
        name: its name in recordings, files and reports.
        unit: its unit, SI.
        about: what it is.
        decay: power of the order with which a discrepancy of the model falls in this channel.
    """

    name: str
    unit: str
    about: str
    decay: int = 2


@dataclass(frozen=True)
class Output:
    """A force or another quantity, SI, that exports offer beside the readings."""

    name: str
    unit: str
    about: str


@dataclass(frozen=True)
class OperatingCondition:
    """How a plant could be run in a further test, as changes of how it was run.

    Attributes:
        text: the condition in words.
        scale: factor on the motion of the first input [1].
        offsets: what is added to the mean of inputs, by name [their unit].
        swings: what is added to the first order of inputs, by name [their unit].
        changes: what is added to parameters, by name [their unit].
    """

    text: str
    scale: float = 1.0
    offsets: Mapping[str, float] = field(default_factory=dict)
    swings: Mapping[str, float] = field(default_factory=dict)
    changes: Mapping[str, float] = field(default_factory=dict)


SAME_OR_SCALED = (
    OperatingCondition("the same programme again"),
    OperatingCondition("half the input", 0.5),
    OperatingCondition("1.4 times the input", 1.4),
)
"""What can be done with any plant."""


class Motion(NamedTuple):
    """Coordinates and their first and second time derivatives at an instant, n scalars each [SI]."""

    q: Any
    qd: Any
    qdd: Any


class Inputs(NamedTuple):
    """The inputs of a plant at an instant: a signal each, the angle of a periodic test, signals imposed at ports."""

    signals: tuple[InputSignal, ...]
    fundamental: Fundamental | None = None
    imposed: Mapping[str, Array] | None = None


class AtPorts(NamedTuple):
    """What laws see at the ports, by the port's name: signals at force ports, loads at series ports.

    ``forces`` are those at the force ports, the plant's own element there and all effects together.
    """

    signals: dict[str, PortSignals]
    loads: dict[str, Load]
    forces: dict[str, Scalar]


class AbstractPlant(eqx.Module):
    """Base of all plants; each one is final.

    A plant declares its coordinates, inputs, channels and ports, and implements :meth:`evaluate` and :meth:`read`.
    ``conditions`` are those among which the next test is chosen; ``location_words`` say what reports call the
    locations of ports, where not by their names.
    ``own_states`` are internal states of the plant itself, as the current of a motor.
    ``time_scale`` [1] is that of :mod:`savgs_ident.plants.time_scale`; None, which counts as 1, where nobody looked.
    ``alternatives`` are further effects of which one acts each, so that solvers need one program for all of them.
    ``coordinate_type`` makes n scalars a tuple with names. :meth:`prepare`, :meth:`drive` and :meth:`cold_start` have
    defaults that serve a plant without costly kinematics; one that has them may replace these three. What exports
    offer beside the readings are its :attr:`outputs`.

        plant = TwoMass() + effect
    """

    coordinates: eqx.AbstractClassVar[tuple[Coordinate, ...]]
    coordinate_type: eqx.AbstractClassVar[Any]
    inputs: eqx.AbstractClassVar[tuple[Input, ...]]
    channels: eqx.AbstractClassVar[tuple[Channel, ...]]
    ports: eqx.AbstractClassVar[tuple[Port, ...]]
    own_states: ClassVar[tuple[InternalState, ...]] = ()
    outputs: ClassVar[tuple[Output, ...]] = ()
    conditions: ClassVar[tuple[OperatingCondition, ...]] = SAME_OR_SCALED
    location_words: ClassVar[Mapping[str, str]] = MappingProxyType({})
    effects: tuple[Effect, ...] = eqx.field(default=(), kw_only=True)
    time_scale: float | None = eqx.field(default=None, static=True, kw_only=True)
    alternatives: tuple[Alternatives | AtOnePort, ...] = eqx.field(default=(), kw_only=True)

    @abstractmethod
    def evaluate(
        self, p: Values, motion: Motion, u: Any, acting: EffectsAtInstant, prepared: Any = None
    ) -> tuple[Float[Array, " n"], Any]:
        """The equations of motion out of balance, (n,) [SI], and a record of the forces on the way to them.

        A plant with o states of its own (:attr:`own_states`, which are ``acting.own``) gives (n + o,): what vanishes
        for their right rates comes after the equations of motion.

        ``p`` are the parameters with all changes by effects made. ``acting`` is asked for the effects' forces at
        every force port, for the deflections at every series port, and given the load that each of these carries.
        An instant may be evaluated twice, first without a force that then acts.
        """

    @abstractmethod
    def read(
        self, p: Values, motion: Motion, s: Array, sd: Array, u: Any, prepared: Any = None
    ) -> tuple[Scalar, ...]:
        """What the sensors would show if none had dynamics: one scalar for each of :attr:`channels`."""

    def prepare(self, p: Values) -> Any:
        """What depends on the parameters alone, computed once for many evaluations of the equations."""
        return None

    def drive(
        self,
        signals: tuple[InputSignal, ...],
        fundamental: Fundamental | None = None,
        imposed: Mapping[str, Array] | None = None,
    ) -> Any:
        """The inputs as the equations take them, from one signal for each of :attr:`inputs`.

        ``imposed`` are signals imposed at ports, as :func:`savgs_ident.effects.composition.nothing_imposed` arranges
        them. The record has a field of that name.
        """
        return Inputs(signals, fundamental, imposed)

    def read_outputs(self, loads: Any) -> tuple[Scalar, ...]:
        """One scalar for each of :attr:`outputs`, from the plant's record of its forces."""
        return ()

    def cold_start(self, u: Any) -> tuple[Any, Any, list[Array]]:
        """Coordinates, rates and internal states from which the search for a motion under ``u`` may begin: rest."""
        still = jnp.zeros_like(u.signals[0].value)
        rest = self.coordinate_type(*(still for _ in self.coordinates))
        return rest, rest, [still for _ in self.states]

    def __add__(self, effect: Effect) -> Self:
        return replace(self, effects=added(self.effects, effect))

    @property
    def states(self) -> tuple[InternalState, ...]:
        """Internal states: the plant's own, anchors of contacts that stick, then those of all effects in order.

        Of alternatives, which come last, those of the one that acts.
        """
        alternatives = (state for each in self.alternatives for state in each.states)
        return (*self.own_states, *states_of(self.effects), *alternatives)

    @property
    def scaled_ports(self) -> tuple[Port, ...]:
        """Its ports on its time scale."""
        scale = scale_of_time(self)
        return tuple(
            port if port.time_scale == scale else replace(port, time_scale=scale) for port in self.ports
        )

    @property
    def sensors_have_dynamics(self) -> bool:
        """Whether a sensor shows anything but the present truth."""
        return any(isinstance(effect.law, AbstractSensorLaw) for effect in self.effects)

    def effective(self, p: Values) -> Values:
        """The parameters with all changes by effects made, SI."""
        return changed_numbers(self.effects, p)

    def residual(
        self, p: Values, motion: Motion, s: Array, sd: Array, u: Any, prepared: Any = None
    ) -> Float[Array, " k"]:
        """The residual, (n + s,), at an instant [SI]: equations of motion, then the balances of the states.

        ``s`` and ``sd`` (s,) are the internal states and their rates; ``prepared`` is what :meth:`prepare` made of
        the same parameters, where many instants share them.
        """
        at, balance, _ = self._evaluated(p, motion, s, sd, u, prepared)
        return jnp.concatenate([balance, at.balance()])

    def loads(self, p: Values, motion: Motion, s: Array, sd: Array, u: Any, prepared: Any = None) -> Any:
        """The plant's record of the forces at an instant, for reports and energy balances."""
        return self._evaluated(p, motion, s, sd, u, prepared)[2]

    def at_ports(
        self, p: Values, motion: Motion, s: Array, sd: Array, u: Any, prepared: Any = None
    ) -> AtPorts:
        """What laws see at the ports at an instant [SI]."""
        at = self._evaluated(p, motion, s, sd, u, prepared)[0]
        return AtPorts(at.signals, at.loads, at.forces)

    def transfers(self, p: Values, frequency: Float[Array, "*f"]) -> Complex[Array, "C *f"]:
        """Reading over truth of each channel at frequencies [Hz]: errors of the sensors alone."""
        locations = [f"sensor.{each.name}" for each in self.channels]
        return jnp.stack([sensor_transfer(self.effects, each, p, frequency) for each in locations])

    def _evaluated(
        self, p: Values, motion: Motion, s: Array, sd: Array, u: Any, prepared: Any
    ) -> tuple[EffectsAtInstant, Array, Any]:
        p = self.effective(p)
        own = len(self.own_states)
        at = EffectsAtInstant(self.effects, p, s, sd, u.imposed, own, self.alternatives)
        if at.lacks_forces:
            self.evaluate(p, motion, u, at, prepared)
            at.push()
        balance, loads = self.evaluate(p, motion, u, at, prepared)
        return at, balance, loads


class Excitation(NamedTuple):
    """Inputs of D periodic tests as complex harmonics, x(t) = X_0 + Re sum_k X_k exp(2 pi i k f t).

    Attributes:
        frequency: fundamental [Hz], (D,).
        harmonics: of each input by its name [its unit], (D, K + 1), with as many orders as each needs.
        part: of each period that is compared of what sensors read; None where all of it is, at all orders.
        initial_states: states of the plant in tests that do not begin at rest [SI], (D, m); None where none does, or
            where these begin at rest as long as nothing better is known.
    """

    frequency: Float[Array, " D"]
    harmonics: Mapping[str, Complex[Array, "D K"]]
    part: ComparedPart | None = None
    initial_states: Float[Array, "D m"] | None = None

    @property
    def spacing(self) -> Float[Array, " D"]:
        """From one order of what sensors read to the next [Hz]."""
        return self.frequency if self.part is None else self.frequency * self.part.every

    @property
    def windows(self) -> NDArray[np.intp]:
        """Places of the tests of which a part is compared."""
        none = np.zeros(0, np.intp)
        return none if self.part is None else np.flatnonzero(~self.part.repeats)

    @property
    def opened(self) -> tuple[int, ...]:
        """Places of the windows that begin with a state which is known or estimated."""
        return () if self.part is None else tuple(np.flatnonzero(self.part.opens).tolist())

    @property
    def moving(self) -> NDArray[np.intp]:
        """Places of the windows that begin with a state which is estimated."""
        none = np.zeros(0, np.intp)
        return none if self.part is None else np.flatnonzero(np.asarray(self.part.begins_moving))


class AbstractSource(eqx.Module):
    """What drives a plant over time; it may have k states of its own, as a motor has."""

    @property
    @abstractmethod
    def scales(self) -> tuple[float, ...]:
        """Typical sizes of its states, in their units, for tolerances."""

    @abstractmethod
    def at_rest(self, plant: Any, t: Scalar) -> Any:
        """The plant's inputs where a motion begins at rest at time ``t`` [s]."""

    @abstractmethod
    def start(self, p: Values, t: Scalar, loads: Any) -> Float[Array, " k"]:
        """States (k,) with which it rests there against the ``loads`` of the plant."""

    @abstractmethod
    def inputs(self, plant: Any, t: Scalar, state: Float[Array, " k"]) -> Any:
        """The plant's inputs at time ``t`` [s]."""

    @abstractmethod
    def rate(self, p: Values, t: Scalar, state: Float[Array, " k"], loads: Any) -> Float[Array, " k"]:
        """Time derivatives of its states under the ``loads`` of the plant."""


def scale_of_time(plant: AbstractPlant | type[AbstractPlant]) -> float:
    """The time scale of a plant [1]; 1 where nobody looked for it."""
    return plant.time_scale or 1.0


def input_size(plant: AbstractPlant | type[AbstractPlant], given: Input) -> float:
    """The largest amplitude of an input [its unit] with which no coordinate moves by more than its typical size."""
    moved = zip(plant.coordinates, given.moves, strict=True)
    return min((each.size / abs(moves) for each, moves in moved if moves), default=1.0)


def state_sizes(plant: AbstractPlant) -> tuple[float, ...]:
    """Typical sizes of x = (q, qd, s), (2 n + s,) [SI]."""
    sizes = [each.size for each in plant.coordinates]
    rates = [each.rate_size for each in plant.coordinates]
    return (*sizes, *rates, *(float(state.scale) for state in plant.states))
