"""The draw of a foreign trial: a rig with small errors, and nothing else or an effect by a foreign law.

Parameters are off the sheet by their tolerances, as in any trial. Besides, in every foreign trial,

* the damper's table is off point by point, by 0.5 to 2 % rms, the more alike the nearer two points are;
* the rail's friction drifts over the campaign, by up to 3 %;
* the sensors' noise is coloured;
* the road's signal leads or lags by up to 0.5 mrad.

An effect changes the response by 3 to 25 % somewhere. Nothing is drawn again because it is hard to see or easily
imitated: how far it stands out is recorded, and whether calibration leaves so little of it that it does not matter.
Only where no size gives the change that was drawn is there another draw.

The recording is integrated with a fixed step (:mod:`savgs_ident.validation.virtual_motions`) and passes anti-aliasing
filters and converters.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.diagnosis.verdict import Change
from savgs_ident.effects.effect import Effect
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.validation.blind_answer import Answer, SmallErrors
from savgs_ident.validation.blind_draw import ATTEMPTS, Drawing, Present, Shares, drawing_of
from savgs_ident.validation.foreign_laws import FOREIGN, foreign_laws
from savgs_ident.validation.lookalikes import closest, rows_of
from savgs_ident.validation.virtual_rig import Bench, draw_rig

DAMPER_ERROR = (0.005, 0.02)
"""Least and largest rms error of the damper's table [1]."""

DRIFT = 0.03
"""Largest relative change of the rail's friction over the campaign [1]."""

COLOUR = 0.6
"""Largest correlation of the noise from one sample to the next [1]."""

PHASE = 5e-4
"""Largest angle by which the road's signal is off [rad]."""

STEP = 2.5e-4
"""Longest step of the integration that is recorded [s]."""

CORNER = 0.4
"""Corner of the anti-aliasing filters over the sampling rate [1]."""

BITS = 16
"""Of the logger's converters."""

NEIGHBOURS = (0.25, 0.5, 0.25)
"""Weights with which errors of the damper's table are averaged over neighbouring points."""


def draw_small_errors(rig: Rig, random: np.random.Generator) -> SmallErrors:
    """The small errors of a rig."""
    velocity = np.array(rig.damper_velocity)
    size = random.uniform(*DAMPER_ERROR)
    rough = random.standard_normal(velocity.size + 2)
    errors = np.convolve(rough, NEIGHBOURS, mode="valid")
    errors[velocity == 0.0] = 0.0
    errors *= size / np.sqrt(np.mean(errors[velocity != 0.0] ** 2))
    return SmallErrors(
        damper=tuple(errors.tolist()),
        drift=float(random.uniform(-DRIFT, DRIFT)),
        colour=float(random.uniform(0.0, COLOUR)),
        phase=float(random.uniform(-PHASE, PHASE)),
    )


def draw_foreign(bench: Bench, shares: Shares, number: int, random: np.random.Generator) -> Answer:
    """The truth of a foreign trial; the same for the same state of ``random``.

    Of the ``shares``, the first is for nothing and the second for an effect; the others must be zero. Raises
    :class:`InputError` if no size of anything that was drawn in :data:`ATTEMPTS` attempts gives the change drawn.
    """
    errors = draw_small_errors(bench.rig, random)
    nothing = shares.draw(random) == "none"
    plain = true_bench(bench, _answer(number, {}, errors))
    drawing = drawing_of(plain, draw_rig(bench, random))
    while drawing is None:
        drawing = drawing_of(plain, draw_rig(bench, random))
    if nothing:
        return _answer(number, drawing.rig, errors)
    laws = foreign_laws()
    for _ in range(ATTEMPTS):
        law = str(random.choice(list(laws)))
        present = _present(drawing, str(random.choice(laws[law])), random)
        if present is not None:
            return _with_effect(_answer(number, drawing.rig, errors), drawing, present)
    raise InputError(
        "no foreign effect reaches the change that was drawn",
        source=f"trial {number}",
        remedy="name another --seed",
    )


def _answer(number: int, rig: Mapping[str, float], errors: SmallErrors) -> Answer:
    """The truth of a trial with nothing but small errors; ``rig`` are parameters in SI."""
    return Answer(number, "none", (), (), {}, {}, (), {}, rig, (), small_errors=errors)


def _with_effect(nothing: Answer, drawing: Drawing, present: Present) -> Answer:
    foreign = FOREIGN[present.name]
    change = rows_of(present.response) - rows_of(drawing.response)
    # To first order: what calibration and tolerances can do taken off.
    nearest = closest(drawing.hiding, change, np.zeros((change.size, 0)))
    return replace(
        nothing,
        kind="foreign",
        effects=(present.name,),
        ports=(foreign.effect.port.location,),
        changes={present.name: present.change},
        sigmas={present.name: nearest.sigma},
        parameters=dict(present.parameters),
        accepted=foreign.ports,
        families=foreign.families,
        hidden=not _share_of(nearest.left, present.response).matters(),
    )


def _share_of(left: NDArray[np.float64], response: NDArray[np.complex128]) -> Change:
    """Rows (m,) as a share of a response (D, 2, K), in the channel where they are most; both in its units."""
    dwells, channels, _ = response.shape
    parts, whole = (
        np.sum(rows.reshape(dwells, channels, -1) ** 2, axis=-1) for rows in (left, rows_of(response))
    )
    overall = np.max(parts.sum(axis=0) / whole.sum(axis=0))
    return Change(float(np.sqrt(overall)), float(np.sqrt(np.max(parts / whole))))


def _present(drawing: Drawing, name: str, random: np.random.Generator) -> Present | None:
    """A foreign effect of a size drawn; None where no size within its bounds does that much."""
    bench = replace(drawing.bench, catalogue=_catalogue(drawing.bench, (name,)))
    return replace(drawing, bench=bench, starts=dict(drawing.starts)).present(name, random)


def _catalogue(bench: Bench, names: tuple[str, ...]) -> Mapping[str, Effect]:
    """The effects of the baseline and the foreign ones with these names, no other."""
    known = {name: CATALOGUE[name] for name in CATALOGUE if name in bench.baseline}
    return known | {name: FOREIGN[name].effect for name in names}


def true_bench(bench: Bench, answer: Answer) -> Bench:
    """The rig and its sensors as they truly are in a trial; the same as known in one without small errors."""
    errors = answer.small_errors
    if errors is None:
        return bench
    sensors = replace(
        bench.sensors,
        colour=errors.colour,
        phase=errors.phase,
        corner=CORNER * bench.sensors.rate,
        bits=BITS,
    )
    return replace(
        bench,
        rig=_with_damper(bench.rig, errors.damper),
        sensors=sensors,
        catalogue=_catalogue(bench, answer.effects),
        drift={"mu_r": errors.drift},
        step=STEP,
    )


def _with_damper(rig: Rig, errors: tuple[float, ...]) -> Rig:
    """The rig with the forces of its damper's table off by relative errors [1]; a curve that fell is level there."""
    off = np.array(rig.damper_force) * (1.0 + np.array(errors))
    below = np.array(rig.damper_velocity) < 0.0
    force = np.where(below, np.minimum.accumulate(off[::-1])[::-1], np.maximum.accumulate(off))
    return replace(rig, damper_force=tuple(force.tolist()))
