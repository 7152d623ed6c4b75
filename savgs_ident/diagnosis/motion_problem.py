"""The problem of a diagnosis along a measured motion: the force that a plant needs from its drive.

    problem, data = motion_problem(motion, Axis(), Axis.parameters, generic_effects(Axis.ports), free=("mass",))

Rows are the force that is needed (:mod:`savgs_ident.simulate.along_motion`), low-passed and thinned like the measured
one; rows of a second of time are left out together. The motion is taken as it was measured, so that errors of its
sensor are not among the candidates.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.parameter import ParameterTable
from savgs_ident.diagnosis.gap import CyclePosition, FurtherShrink, cycle_position
from savgs_ident.diagnosis.localisation import Localisation
from savgs_ident.diagnosis.loops import root_sum_square
from savgs_ident.diagnosis.problem import AbstractProblem, DrawnLaw, ModelPoint, spans_of_force
from savgs_ident.diagnosis.regimes import Cycles, find_regimes
from savgs_ident.diagnosis.result import DriveForces, ForceLoop, NextTest, Regime
from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.effects.base import Family, Port, PortKind, PortSignals
from savgs_ident.effects.effect import Effect
from savgs_ident.effects.learned_functions import STRETCHES
from savgs_ident.inference.background.locations import force_port, ports_by_location
from savgs_ident.inference.background.port_functions import (
    Functions,
    InputLocation,
    Law,
    laws_of_functions,
    motion_functions,
    prandtl_element,
)
from savgs_ident.inference.drive_force import force_data, force_rows, relative_miss, relative_noise
from savgs_ident.inference.laplace_fit import LaplaceFit, Search
from savgs_ident.inference.likely_mistake import mistaken_drive
from savgs_ident.inference.observations import Data, Prediction, Term
from savgs_ident.plants.base import AbstractPlant, AtPorts
from savgs_ident.responses.driven_motion import DrivenMotion
from savgs_ident.simulate.along_motion import (
    Samples,
    force_gain,
    needed_force,
    needed_forces,
    ports_along,
)
from savgs_ident.simulate.driven_plant import samples_of
from savgs_ident.simulate.program_cache import placed


class _Seen(NamedTuple):
    """What laws may be made of: signals at the force ports, and the force that the model needs from the drive [N]."""

    signals: Mapping[str, PortSignals]
    drive: NDArray[np.float64]


@dataclass(frozen=True)
class MotionProblem(AbstractProblem):
    """A plant with one coordinate, driven along a measured motion.

    Attributes:
        motion: what was measured.
    """

    motion: DrivenMotion = field(kw_only=True)

    @property
    def channels(self) -> tuple[str, ...]:
        """The force of the drive."""
        return (self.plant.inputs[0].name,)

    @property
    def channel(self) -> NDArray[np.intp]:
        """The channel of each row: there is one."""
        return np.zeros(self.motion.row_times.size, np.intp)

    @cached_property
    def samples(self) -> Samples:
        """The motion as the equations take it."""
        return samples_of(self.motion, self.plant)

    def start(self, values: Mapping[str, float]) -> None:
        """Nothing: the motion is known."""
        del values

    def predict(
        self, terms: tuple[str, ...], values: Mapping[str, float], names: Sequence[str], warm_start: Any
    ) -> Prediction:
        """Force rows [N] with ``terms`` at ``values`` [SI], with slopes in ``names``."""
        found = force_rows(self.model(terms), self.values(values), self.motion, names)
        return Prediction(found.rows, lambda: found.slopes, found.status, warm_start)

    def _slopes(
        self, model: AbstractPlant, values: Mapping[str, float], names: Sequence[str]
    ) -> NDArray[np.float64]:
        """Slopes of the rows in the named parameters [N per SI unit], (m, n)."""
        return force_rows(model, self.values(values), self.motion, names).slopes

    def sensitivities(
        self, terms: tuple[str, ...], values: Mapping[str, float], warm_start: Any, candidates: Sequence[Term]
    ) -> list[NDArray[np.float64]]:
        """First-order change of the rows per unit of each candidate's amplitudes, (tries, m, amplitudes).

        Slopes at the null, or secants to the typical size of one that has states.
        """
        base = self.predict(terms, values, (), warm_start).rows
        return [
            self._secants(terms, values, base, term)
            if self.catalogue[term.name].states
            else self._slopes_at_null(terms, values, term)
            for term in candidates
        ]

    def _slopes_at_null(
        self, terms: tuple[str, ...], values: Mapping[str, float], term: Term
    ) -> NDArray[np.float64]:
        names, everything = [each.name for each in term.amplitudes], self.complete(terms)
        tries = [dict(values) | shapes for shapes in term.tried]
        return np.stack([self._slopes(everything, each, names) for each in tries])

    def _secants(
        self, terms: tuple[str, ...], values: Mapping[str, float], base: NDArray[np.float64], term: Term
    ) -> NDArray[np.float64]:
        typical = np.array([self.constants.typical_coordinate * each.scale for each in term.amplitudes])
        points = [
            self.table.as_dict() | dict(values) | shapes | {each.name: each.centre + float(size)}
            for shapes in term.tried
            for each, size in zip(term.amplitudes, typical, strict=True)
        ]
        together = {name: np.array([each[name] for each in points]) for name in points[0]}
        model = self.model((*terms, term.name))
        forces = needed_forces(model, placed(together), self.samples, self.motion.step).force
        moved = (self.motion.rows(np.asarray(forces)) - base).reshape(-1, typical.size, base.size)
        return np.moveaxis(moved / typical[:, None], 1, 2)

    def port_signals(self, values: Mapping[str, float], warm_start: Any) -> Mapping[str, PortSignals]:
        """What laws see at the force ports at the samples."""
        del warm_start
        return self._at_ports((), values).signals

    def _at_ports(self, terms: tuple[str, ...], values: Mapping[str, float]) -> AtPorts:
        return ports_along(self.complete(terms), placed(self.values(values)), self.samples, self.motion.step)

    def locations(
        self, terms: tuple[str, ...], values: Mapping[str, float], warm_start: Any
    ) -> list[InputLocation]:
        """What an unknown signal at each location could do to the force that is needed."""
        del warm_start
        p = placed(self.values(values))
        needed = needed_force(self.model(terms), p, self.samples, self.motion.step)
        seen = _Seen(self._at_ports(terms, values).signals, np.asarray(needed.force))
        found = []
        for name, ports in ports_by_location(self.plant).items():
            kinds = {port.kind for port in ports}
            if kinds == {PortKind.NUMBER}:
                found.append(self._numbers(name, ports, terms, values))
            elif kinds & {PortKind.FORCE, PortKind.INPUT}:
                found.append(self._signals(name, ports, terms, values, seen))
        return found

    def _signals(
        self,
        name: str,
        ports: Sequence[Port],
        terms: tuple[str, ...],
        values: Mapping[str, float],
        seen: _Seen,
    ) -> InputLocation:
        """A location where a force acts, or the drive."""
        acting = [port for port in ports if port.kind in (PortKind.FORCE, PortKind.INPUT)]
        laws: list[Law] = []
        for port in acting:
            functions = self._functions(port, seen)
            columns = self._imposed(port, terms, values, np.stack(functions.values))
            laws += laws_of_functions(columns, functions.families, self.constants, functions.plain, port.name)
        return InputLocation(name, tuple(laws), self._imposed(acting[0], terms, values, self._free()))

    def _functions(self, port: Port, seen: _Seen) -> Functions:
        """Functions of what a force port sees; at the drive, of the force that the model needs from it.

        The recorded force is what is to be explained: a law of that would explain everything. At another input they
        are of what was recorded.
        """
        beside = self.motion.beside.get(port.location)
        if beside is not None:
            level = beside / max(float(np.abs(beside).max()), np.finfo(float).tiny)
            families = (Family.SHAPE, Family.GAIN, Family.SHAPE)
            return Functions([np.ones_like(level), level, level * np.abs(level)], families, (0, 1))
        if port.kind is PortKind.INPUT:
            drive = seen.drive / np.abs(seen.drive).max()
            families = (Family.SHAPE, Family.GAIN, Family.SHAPE)
            return Functions([np.ones_like(drive), drive, drive * np.abs(drive)], families, (0, 1))
        displacement, velocity, load = (np.asarray(each) for each in seen.signals[port.name][:3])
        held = [prandtl_element(displacement, share * port.displacement) for share in STRETCHES]
        return motion_functions(displacement, velocity, load, held)

    def _imposed(
        self,
        port: Port,
        terms: tuple[str, ...],
        values: Mapping[str, float],
        signals: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Change of the rows by signals (k, n) at a port [its unit], (m, k)."""
        model, p = self.complete(terms), placed(self.values(values))
        gain = np.asarray(force_gain(model, p, self.samples, self.motion.step, port.name))
        return self.motion.rows(gain * signals).T

    def _numbers(
        self, name: str, ports: Sequence[Port], terms: tuple[str, ...], values: Mapping[str, float]
    ) -> InputLocation:
        """A location of numbers alone: slopes in them."""
        numbers = [number for port in ports for number in port.numbers]
        columns = self._slopes(self.complete(terms), values, [each.name for each in numbers])
        columns = columns * np.array([each.change for each in numbers])
        laws = laws_of_functions(columns, (Family.NUMBER,) * len(numbers), self.constants)
        return InputLocation(name, laws, columns)

    def _free(self) -> NDArray[np.float64]:
        """Waves over a block of time and a constant [1], (f, n): what a signal free in every block is made of."""
        turned = 2.0 * np.pi * self.motion.step * np.arange(self.motion.position.size)
        orders = range(1, self.constants.free_orders_along_motion + 1)
        waves = [wave(order * turned) for order in orders for wave in (np.cos, np.sin)]
        return np.stack([np.ones_like(turned), *waves])

    def learned_spans(
        self, port: Port, values: Mapping[str, float], warm_start: Any
    ) -> Mapping[str, float] | None:
        """The range of what is seen at a force; nothing else is learned along a measured motion."""
        if port.kind is not PortKind.FORCE:
            return None
        return spans_of_force(port, self.port_signals(values, warm_start)[port.name], self.constants)

    def gap_map(self, data: Data, rows: NDArray[np.float64]) -> tuple[()]:
        """None: the force of a drive has no harmonics of its own."""
        del data, rows
        return ()

    def cycle_positions(self, data: Data, rows: NDArray[np.float64]) -> tuple[CyclePosition, ...]:
        """The gap at reversal, in mid-stroke and between, as shares of its square."""
        speed = np.abs(self.motion.rows(self.motion.velocity))
        squares = (data.measured - rows) ** 2
        return (cycle_position(self.channels[0], squares, speed / speed.max(), self.constants),)

    def regimes(self, data: Data, fit: LaplaceFit) -> tuple[Regime, ...]:
        """In which regimes the baseline misses: of the motion, and over time."""
        rows = self.motion.rows
        cycles = Cycles(
            waves=lambda forces: forces[:, None, None, :],
            velocity=rows(self.motion.velocity)[None],
            displacement=rows(self.motion.position)[None],
            frequency=np.array([1.0 / self.motion.period]),
            recorded=np.arange(data.tests, dtype=np.float64),
        )
        return find_regimes(cycles, data, fit, self.free, constants=self.constants)

    def loops(
        self,
        values: Mapping[str, float],
        warm_start: Any,
        found: Localisation,
        law: DrawnLaw | None,
        nearest: DrawnLaw | None,
    ) -> tuple[ForceLoop, ...]:
        """The force inferred at a location over one cycle, beside that of a named law and of the nearest one."""
        port = force_port(self.plant, found.name)
        if port is None:
            return ()
        base = self.predict((), values, (), warm_start)
        gain = self._imposed(port, (), values, np.ones((1, self.motion.position.size)))[:, 0]
        signals = self._at_ports((), values).signals[port.name]
        start, end = self._cycle()
        force = self._force_of(law)
        errors = [] if law is None else [self._force_of(replace(law, values=each)) for each in law.erring]
        return (
            ForceLoop(
                port=found.name,
                frequency_hz=1.0 / self.motion.period,
                displacement=self.motion.rows(np.asarray(signals.displacement))[start:end],
                velocity=self.motion.rows(np.asarray(signals.velocity))[start:end],
                inferred=((self.motion.rows(self.motion.drive) - base.rows) / gain)[start:end],
                law=force[start:end],
                unit=port.force_unit,
                motion_unit=port.displacement_unit,
                law_sd=root_sum_square([each[start:end] - force[start:end] for each in errors if each.size]),
                nearest=self._force_of(nearest)[start:end],
            ),
        )

    def _force_of(self, law: DrawnLaw | None) -> NDArray[np.float64]:
        """The force of a law along the motion [the port's unit], (m,); empty where there is none."""
        if law is None or law.effect.port.kind is not PortKind.FORCE:
            return np.zeros(0)
        effect = law.effect
        terms = () if effect.name in self.baseline else (effect.name,)
        # A learned law is none of the catalogue.
        there = replace(self, catalogue={**self.catalogue, effect.name: effect})
        own, without = (
            np.asarray(there._at_ports(terms, each).forces[effect.port.name])
            for each in (law.values, dict(law.values) | dict(effect.null))
        )
        return self.motion.rows(own - without)

    def _cycle(self) -> tuple[int, int]:
        """First row of the recording's first cycle and that after its last."""
        return 0, int(np.searchsorted(self.motion.row_times, self.motion.row_times[0] + self.motion.period))

    def next_tests(self, search: Search, one: LaplaceFit, other: LaplaceFit) -> tuple[NextTest, ...]:
        """None: which motions the axis could be given is not known."""
        del search, one, other
        return ()

    def mistaken(self, given: NDArray[np.float64]) -> str:
        """Whether the drive's force goes the other way than the model says, in words."""
        return mistaken_drive(self.motion.rows(self.motion.drive), given, self.plant)

    def responses(self, data: Data, *rows: NDArray[np.float64]) -> DriveForces:
        """The force along the motion, measured and needed by three models."""
        velocity = self.motion.rows(self.motion.velocity)
        return DriveForces(self.motion.source, self.motion.row_times, velocity, data.measured, *rows)


def motion_problem(
    motion: DrivenMotion,
    plant: AbstractPlant,
    parameters: ParameterTable,
    catalogue: Mapping[str, Effect],
    baseline: tuple[str, ...] = (),
    free: tuple[str, ...] = (),
    constants: DecisionConstants = DEFAULTS,
) -> tuple[MotionProblem, Data]:
    """The problem of a measured motion, and the force of its drive as data."""
    offered = {name: each for name, each in catalogue.items() if each.port.kind is not PortKind.SENSOR}
    problem = MotionProblem(plant, parameters, offered, baseline, free, motion=motion, constants=constants)
    return problem, force_data(motion)


def further_motion(motion: DrivenMotion, points: Sequence[ModelPoint]) -> FurtherShrink:
    """The gap of another motion by models that nothing of it was fitted to: as given, recalibrated, with more.

    Nothing comes after where there are two ``points``, which are models along motions.
    """
    measured, gaps = motion.rows(motion.drive), []
    for problem, terms, values in points:
        there = replace(cast(MotionProblem, problem), motion=motion)
        gaps.append(relative_miss(measured, there.predict(terms, values, (), None).rows))
    after = gaps[2] if len(gaps) > 2 else np.nan
    return FurtherShrink(Path(motion.source).name, gaps[0], gaps[1], after, relative_noise(motion))
