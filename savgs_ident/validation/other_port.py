"""Whether the recordings of a trial show at which of two ports a law acts, or which of two effects is there.

A force in the strut and the same beside it in the wishbone joints move the rig nearly alike. How far a campaign
distinguishes two such ports is not a matter of the diagnosis alone: here the drawn law itself is fitted at its own
port and at another one, with the search, the priors and the background of a diagnosis. The difference of their log
evidences is all that a diagnosis could have to go on that knew the formula. Ports count their displacements to
different sides, so that a law which knows up from down, as a stop does, is fitted the other way round, too. What is
known of the law at its own port, as how far a joint gives before it slides, is estimated at the other one.
"""

from collections.abc import Mapping
from dataclasses import fields, replace
from types import new_class
from typing import Any

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.presentation import no_progress
from savgs_ident.core.values import Values
from savgs_ident.diagnosis.diagnose import baseline_problem
from savgs_ident.diagnosis.model_selection import recalibrate
from savgs_ident.diagnosis.result import DiagnosisSettings
from savgs_ident.diagnosis.search import single_effects, singles_among
from savgs_ident.effects.base import AbstractForceLaw, Port, PortSignals
from savgs_ident.effects.effect import Effect, effect_at, typical_effect
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.responses.harmonic_response import HarmonicResponse

ELSEWHERE = "elsewhere"
"""The name of the effect at the other port."""

TURNED = "elsewhere_turned"
"""That of the same the other way round."""


def log_odds_of_port(
    measured: HarmonicResponse, rig: Rig, drawn: Effect, location: str, settings: DiagnosisSettings
) -> float | None:
    """Log odds [nat] of an effect at its own port against its law at another ``location``.

    None where the law cannot act there, or where one of the two fits has no solution.
    """
    port = _port_for(drawn, location)
    if port is None:
        return None
    laws = {ELSEWHERE: drawn.law}
    if isinstance(drawn.law, AbstractForceLaw):
        laws[TURNED] = turned(drawn.law)
    there = {
        name: estimated(typical_effect(name, port, law, symptom=drawn.symptom, reference=drawn.reference))
        for name, law in laws.items()
    }
    evidence = _log_evidences(measured, rig, {drawn.name: drawn, **there}, settings)
    found = [evidence[name] for name in there if name in evidence]
    return evidence[drawn.name] - max(found) if drawn.name in evidence and found else None


def log_odds_of_stand_in(
    measured: HarmonicResponse, rig: Rig, drawn: Effect, named: str, settings: DiagnosisSettings
) -> float | None:
    """Log odds [nat] of an effect against one of the catalogue that is ``named`` instead of it.

    None where one of the two fits has no solution.
    """
    evidence = _log_evidences(measured, rig, {drawn.name: drawn, named: CATALOGUE[named]}, settings)
    return evidence[drawn.name] - evidence[named] if len(evidence) == 2 else None


def estimated(effect: Effect) -> Effect:
    """The effect with parameters in place of the numbers of its law, but for those that are 0."""
    own: dict[str, Parameter | str] = {each.name: each for each in effect.parameters}
    numbers: dict[str, Parameter | str | float] = {
        role: own.get(given, given)
        if isinstance(given, str)
        else given and Parameter(f"{effect.name}_{role}", given, "SI", lower=0.0, about=role)
        for role, given in effect.numbers
    }
    return effect_at(
        effect.name,
        effect.port,
        effect.law,
        numbers,
        states=effect.state_names,
        symptom=effect.symptom,
        reference=effect.reference,
    )


def turned(law: AbstractForceLaw) -> AbstractForceLaw:
    """The law with both directions of its port exchanged: a stop at the other end."""
    base = type(law)

    def seen(signals: PortSignals) -> PortSignals:
        return PortSignals(-signals.displacement, -signals.velocity, signals.load, -signals.rest)

    def force(self: Any, v: Values, signals: PortSignals, state: Any) -> Any:
        return -law.force(v, seen(signals), state)

    def rate(self: Any, v: Values, signals: PortSignals, state: Any) -> Any:
        return law.rate(v, seen(signals), state)

    body = {"force": force, "rate": rate, "__module__": __name__, "__doc__": "The other way round."}
    other = new_class(f"Turned{base.__name__}", (base,), exec_body=lambda names: names.update(body))
    found = other(**{each.name: getattr(law, each.name) for each in fields(law)})
    assert isinstance(found, AbstractForceLaw)
    return found


def _port_for(drawn: Effect, location: str) -> Port | None:
    """The port of a location at which the law of an effect could act, too."""
    kind = drawn.port.kind
    suitable = (each for each in QuarterCar.ports if each.location == location and each.kind is kind)
    return next((each for each in suitable if drawn.law.suits(each)), None)


def _log_evidences(
    measured: HarmonicResponse, rig: Rig, effects: Mapping[str, Effect], settings: DiagnosisSettings
) -> dict[str, float]:
    """The log evidence of each effect alone that could be fitted, by name."""
    given = RigModel(rig, settings.baseline)
    known = {name: CATALOGUE[name] for name in settings.baseline} | dict(effects)
    bare = replace(given.build(), effects=())
    plant, data = baseline_problem(measured, bare, given.table, known, replace(settings, without=()))
    problem = recalibrate(plant, data, {}, no_progress)
    first = single_effects(problem.search, problem.base, plant.candidates, no_progress)
    both = singles_among(problem.search, first, plant.candidates, plant.candidates, no_progress)
    return {mode.terms[0]: mode.evidence for mode in both.modes}
