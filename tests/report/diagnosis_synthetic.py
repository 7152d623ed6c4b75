"""Diagnoses whose every number is known, one of each kind, about the shipped campaign.

What the models answer is what was measured, moved by noise (after), by a smooth relative gap that is largest near
the resonance (recalibrated) and by twice as much with another phase (before). The map, the gaps and the shares
follow from these; the force at the rail follows from a law of friction.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnosis.gap import CyclePosition, FurtherShrink, MapCell, Shrink
from savgs_ident.diagnosis.result import (
    NONE,
    UNKNOWN,
    Candidate,
    Confusable,
    Diagnosis,
    Estimate,
    ForceLoop,
    Hypothesis,
    Kind,
    NextTest,
    NotJudgeable,
    PortShare,
    Regime,
    Responses,
    Verdict,
)
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.rig import default_rig_path, read_rig
from savgs_ident.plants.quarter_car.rig_recordings import RIG_LAYOUT
from savgs_ident.responses.harmonic_response import HarmonicResponse

KINDS: tuple[Kind, ...] = ("none", "effect", "several", "unknown")

SENTENCES = {
    "none": "Nothing is missing: the recalibrated simtr explains the measurement to its noise.",
    "effect": "The rail's friction rises at low speed (rail_stribeck, 98.2 %), which closes 99.9 % of the gap.",
    "several": "Two effects are missing: rail_stribeck at the rail and accel_lag at the accelerometer.",
    "unknown": "Something is missing at the rail that the catalogue does not have.",
}

VERDICTS: dict[Kind, Verdict] = {
    "none": Verdict("none", (), (), (), SENTENCES["none"]),
    "effect": Verdict("effect", ("rail_stribeck",), ("rail",), ("rail_preload",), SENTENCES["effect"]),
    "several": Verdict(
        "several",
        ("rail_stribeck", "accel_lag"),
        ("rail", "sensor.sprung_accel"),
        (),
        SENTENCES["several"],
    ),
    "unknown": Verdict("unknown", (), ("rail",), (), SENTENCES["unknown"]),
}

SHARES = {
    "rail": (0.942, 0.981),
    "suspension": (0.412, 0.655),
    "strut": (0.305, 0.583),
    "frame": (0.121, 0.342),
    "tyre_lateral": (0.083, 0.262),
    "sensor.sprung_accel": (0.057, 0.204),
    "tyre_radial": (0.031, 0.177),
    "inertia": (0.012, 0.031),
    "link": (0.004, 0.112),
    "road": (-0.021, 0.156),
    "sensor.susp_deflection": (-0.034, 0.081),
}
"""Share and reach of each port."""

STRIBECK = (
    Estimate("stribeck_rise", 0.2487, 0.2391, 0.2583, "1"),
    Estimate("stribeck_velocity", 0.1012, 0.0957, 0.1066, "m/s"),
)
LAG = (Estimate("accel_lag", 0.01503, 0.01498, 0.01508, "s"),)
SHRINK = Shrink(0.1732, 0.0871, 0.0047, 0.0021, 0.9994, (0.9985, 0.9998))
BY_CHANNEL = {
    "sprung_accel": Shrink(0.2313, 0.1102, 0.0059, 0.0028, 0.9996, (0.9988, 0.9999)),
    "susp_deflection": Shrink(0.0814, 0.0543, 0.0031, 0.0009, 0.9986, (0.9971, 0.9995)),
}
NO_SHRINK = Shrink(0.0035, 0.0022, 0.0022, 0.0021, float("nan"), (float("nan"), float("nan")))


REGIMES = (
    Regime("low speed or large stroke", 9.2, 0.012),
    Regime("drift over time", 1.3, 0.041),
    Regime("slow tests or small response", 8.8, 0.34),
    Regime("high speed or small stroke", 3.1, 1.0),
    Regime("positive direction", 6.9, 1.0),
    Regime("negative direction", 6.4, 1.0),
    Regime("high load", 6.2, 1.0),
    Regime("low load", 6.6, 1.0),
    Regime("fast tests or large response", 2.0, 1.0),
)
NO_REGIMES = tuple(Regime(each.name, 0.02, 1.0) for each in REGIMES)


def synthetic_diagnosis(measured: HarmonicResponse, kind: Kind = "effect") -> Diagnosis:
    """A converged diagnosis of this kind."""
    rig = read_rig(default_rig_path())
    verdict = VERDICTS[kind]
    responses = _responses(measured, 0.0 if kind == "none" else 1.0)
    named = Hypothesis(verdict.effects, unknown=kind == "unknown")
    return Diagnosis(
        model="simtr",
        effects=("rail_coulomb", "tyre_friction"),
        given=RigModel(rig),
        parameters=rig.parameters.as_dict() | {"c_sd": 5391.2, "k_t": 264_830.0, "mu_r": 0.0362},
        identified=rig.parameters.as_dict()
        | {"c_sd": 5386.1, "k_t": 264_100.0, "mu_r": 0.0300}
        | {each.name: each.value for each in _parameters(verdict.effects)},
        intervals=(Estimate("mu_r", 0.0300, 0.0297, 0.0303, "1"),),
        verdict=verdict,
        ports=tuple(
            PortShare(port, *((0.0, 0.04) if kind == "none" else shares)) for port, shares in SHARES.items()
        ),
        map=_map(measured, responses.recalibrated),
        cycle=(
            CyclePosition("sprung_accel", 0.71, 0.11, 0.18),
            CyclePosition("susp_deflection", 0.42, 0.23, 0.35),
        ),
        regimes=NO_REGIMES if kind == "none" else REGIMES,
        candidates=_candidates(named),
        shrink=NO_SHRINK if kind == "none" else SHRINK,
        by_channel={name: NO_SHRINK if kind == "none" else each for name, each in BY_CHANNEL.items()},
        further=FurtherShrink("recorded sweep, first harmonic", 0.0142, 0.0133, 0.0133, 0.0021)
        if kind == "none"
        else FurtherShrink("recorded sweep, first harmonic", 0.1881, 0.0942, 0.0132, 0.0021),
        next_tests=(
            NextTest(
                "dwell at 0.35 Hz, plate at half its stroke", _either("rail_stribeck", "rail_preload"), 14.2
            ),
            NextTest("standstill, then a step of 2 mm", _either("rail_stribeck", "joint_friction"), 6.1),
        ),
        not_judgeable=(
            NotJudgeable("bump_stop", "bump_stop_stiffness", 3.2e4, "N/m"),
            NotJudgeable("link_offset", "link_offset", 0.021, "rad"),
        ),
        confusable=(
            Confusable(("rail_stribeck", "rail_preload"), 0.973),
            Confusable(("gear_compliance", "mount_compliance"), -0.951),
        ),
        loops=() if kind == "none" else _loops(verdict, (0.5, 1.1, 2.35, 4.0)),
        responses=responses,
        measured=measured,
        converged=True,
        warnings=("The dwell at 6 Hz was left out: the wheel lifts off.",),
        wall_s=61.3,
    )


def _either(one: str, other: str) -> tuple[Hypothesis, Hypothesis]:
    return Hypothesis((one,)), Hypothesis((other,))


def unconverged(diagnosis: Diagnosis) -> Diagnosis:
    """The same, with a search that did not end well."""
    return replace(diagnosis, converged=False)


def hostile(diagnosis: Diagnosis, text: str) -> Diagnosis:
    """The same, with ``text`` wherever a name can come from a file or from outside."""
    first, *others = diagnosis.candidates
    table = replace(diagnosis.given.rig, name=text)
    return replace(
        diagnosis,
        model=text,
        effects=(text,),
        given=replace(diagnosis.given, rig=table),
        verdict=replace(
            diagnosis.verdict,
            effects=(text,),
            ports=("rail", text),
            confusable_with=(text,),
            sentence=text,
            confusable_ports=(text,),
        ),
        ports=(*diagnosis.ports, PortShare(text, 0.3, 0.4)),
        map=(*diagnosis.map, MapCell(text, 2.0, 1, 3.0, 4.0)),
        cycle=(*diagnosis.cycle, CyclePosition(text, 0.1, 0.2, 0.7)),
        regimes=(*diagnosis.regimes, Regime(text, 3.0, 0.02)),
        candidates=(
            replace(first, hypothesis=Hypothesis((text,)), parameters=(Estimate(text, 1.0, 0.9, 1.1, text),)),
            *others,
        ),
        by_channel={**diagnosis.by_channel, text: SHRINK},
        next_tests=(NextTest(text, _either(text, text), 3.0),),
        not_judgeable=(NotJudgeable(text, text, 1.0, text),),
        confusable=(Confusable((text, text), 0.99),),
        loops=tuple(replace(loop, port=text, unit=text) for loop in diagnosis.loops[:1]),
        identified={**diagnosis.identified, text: 1.0},
        warnings=(text,),
    )


def friction(velocity: NDArray[np.float64]) -> NDArray[np.float64]:
    """Friction [N] above that of fast sliding: greatest at low speed."""
    return np.asarray(-45.0 * np.tanh(velocity / 0.002) * np.exp(-((velocity / 0.1) ** 2)))


def candidate_of(hypothesis: Hypothesis, probability: float) -> Candidate:
    """A hypothesis with a probability, with ports and families as a diagnosis gives them."""
    if hypothesis.flexible:
        kinds = [(hypothesis.flexible.port, hypothesis.flexible.family.value)]
    else:
        effects = [CATALOGUE[name] for name in hypothesis.effects]
        kinds = [(each.port.location, each.law.family.value) for each in effects]
    ports, families = (tuple(dict.fromkeys(each[place] for each in kinds)) for place in (0, 1))
    return Candidate(hypothesis, probability, 0.0, 0.0, float("nan"), (), False, ports, families)


def _parameters(effects: tuple[str, ...]) -> tuple[Estimate, ...]:
    of = {"rail_stribeck": STRIBECK, "accel_lag": LAG}
    return tuple(each for name in effects for each in of[name])


def _responses(measured: HarmonicResponse, gap: float) -> Responses:
    rng = np.random.default_rng(20170912)
    rows = [measured.channel(name) for name in RIG_LAYOUT.responses]
    seen = measured.harmonics[:, rows]
    noise = np.sqrt(np.trace(measured.covariance[:, rows], axis1=-2, axis2=-1) / 2.0)
    after = seen + noise * (rng.standard_normal(seen.shape) + 1j * rng.standard_normal(seen.shape))
    bump = 0.12 * np.exp(-(((measured.frequency - 2.0) / 0.8) ** 2))[:, None, None]
    order = 1.0 + 0.4 * np.arange(seen.shape[2])
    off = gap * bump * np.exp(0.8j) * order
    return Responses(after * (1.0 + 2.0 * np.exp(1.1j) * off), after * (1.0 + off), after)


def _map(measured: HarmonicResponse, predicted: NDArray[np.complex128]) -> tuple[MapCell, ...]:
    cells = []
    for c, name in enumerate(RIG_LAYOUT.responses):
        channel = measured.channel(name)
        for d, frequency in enumerate(measured.frequency):
            response = np.sqrt(np.sum(np.abs(measured.harmonics[d, channel, 1:]) ** 2))
            for k in range(1, predicted.shape[2]):
                if measured.valid[d, channel, k]:
                    miss = abs(predicted[d, c, k] - measured.harmonics[d, channel, k])
                    noise = np.sqrt(np.trace(measured.covariance[d, channel, k]))
                    cells.append(
                        MapCell(
                            name, float(frequency), k, float(100.0 * miss / response), float(miss / noise)
                        )
                    )
    return tuple(cells)


def _candidates(named: Hypothesis) -> tuple[Candidate, ...]:
    first = _fitted(named, 0.982, (61.2, 3.413, 0.9994), _parameters(named.effects))
    others = [
        _fitted(Hypothesis(("rail_preload",)), 0.017, (58.7, 3.391, 0.9712)),
        _fitted(NONE, 0.0007, (0.0, 0.0, 0.0)),
        _fitted(UNKNOWN, 0.0003, (22.4, 1.02, 0.741)),
    ]
    rest = [name for name in CATALOGUE if name not in {"rail_preload", "rail_coulomb", "tyre_friction"}]
    found = [first, *(each for each in others if each.hypothesis != named)]
    left = 1.0 - sum(each.probability for each in found)
    for place, name in enumerate(rest):
        hypothesis = Hypothesis((name,))
        if hypothesis != named:
            share = left if place == len(rest) - 1 else 0.0
            scored = candidate_of(hypothesis, share)
            found.append(replace(scored, score_sigma=9.0 / (1 + place), heldout_gain=-0.01 * place))
    return tuple(found)


def _fitted(
    hypothesis: Hypothesis,
    probability: float,
    found: tuple[float, float, float],
    parameters: tuple[Estimate, ...] = (),
) -> Candidate:
    """A hypothesis that was fitted, with score, gain and share closed."""
    sigma, gain, closed = found
    return replace(
        candidate_of(hypothesis, probability),
        score_sigma=sigma,
        heldout_gain=gain,
        share_closed=closed,
        parameters=parameters,
        refitted=True,
    )


def _loops(verdict: Verdict, frequencies: tuple[float, ...]) -> tuple[ForceLoop, ...]:
    rng = np.random.default_rng(7)
    phase = 2.0 * np.pi * np.arange(256) / 256
    loops = []
    for frequency in frequencies:
        velocity = 0.012 * 2.0 * np.pi * frequency * np.cos(phase)
        law = friction(velocity)
        ripple = sum(rng.normal(0.0, 2.0) * np.cos(k * phase + rng.uniform(0.0, 6.3)) for k in range(1, 8))
        named = law if verdict.effects else np.zeros(0)
        loops.append(ForceLoop("rail", frequency, 0.012 * np.sin(phase), velocity, law + ripple, named, "N"))
    return tuple(loops)
