"""Blind trials as regressions: what is left of the recordings, and what each effect of the catalogue does to it.

    residual = library @ coefficients + noise of unit variance

The residual is that of the recalibrated baseline over all dwells, channels and orders. The columns of the library are
those by which the diagnosis scores effects: the first-order change of the same rows by an effect at its null. All are
whitened and made orthogonal to everything that calibration and tolerances can do. Columns have unit length, so that a
coefficient is in standard deviations.

What whitens the rows, and at which shapes effects are tried, is a :class:`Variant`: there is a regression for each.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.diagnosis.evidence import DiagnosisProblem
from savgs_ident.diagnosis.model_selection import recalibrate
from savgs_ident.diagnosis.public import SIMTR, problem_of_dwells
from savgs_ident.inference.observations import Term
from savgs_ident.inference.prior import bounds_of
from savgs_ident.plants.parameter_toml import file_content
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.rig import Rig, default_rig_path, parse_rig
from savgs_ident.plants.quarter_car.rig_recordings import load_campaign
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.compared_tests import measured_response
from savgs_ident.validation.blind_answer import Answer, Seal, envelope_of, opened
from savgs_ident.validation.blind_marks import score_of
from savgs_ident.validation.blind_score import Score
from savgs_ident.validation.trials import rig_marks

SAME = 1.0 - 1e-6
"""Cosine from which on two columns are one."""

SEEN = 1e-3
"""Standard deviations by which an effect of a typical size must stand out of what calibration can do."""

Real = NDArray[np.float64]

Errors = Literal["noise", "tolerances", "background"]
"""What the rows are whitened by: the noise of the sensors; and the damper's table and drifts within tolerances; and
the background of small errors, all at the sizes that fit the recalibrated baseline."""

Shapes = Literal["typical", "tried"]
"""At which shapes an effect has columns: the typical one, or all that the diagnosis tries."""


class Variant(NamedTuple):
    """How a regression is set up."""

    errors: Errors
    shapes: Shapes

    def __str__(self) -> str:
        return f"rows whitened by {self.errors}, {self.shapes} shapes"


VARIANTS = (
    Variant("noise", "typical"),
    Variant("noise", "tried"),
    Variant("tolerances", "typical"),
    Variant("tolerances", "tried"),
    Variant("background", "typical"),
    Variant("background", "tried"),
)
"""All of them."""


class Regression(NamedTuple):
    """What a sparse regression is given.

    Attributes:
        names: effects of each column, split by a bar where several do the same.
        library: what each does to the residuals, of unit length, (m, k).
        either_sign: whether its size may be negative, (k,).
        residual: in standard deviations, (m,).
    """

    names: tuple[str, ...]
    library: Real
    either_sign: NDArray[np.bool_]
    residual: Real


@dataclass(frozen=True)
class Trial:
    """A blind trial.

    Attributes:
        place: its folder.
        answer: the truth.
        ours: the marks of the diagnosis that is in the folder.
        regressions: the same recordings as regressions.
    """

    place: Path
    answer: Answer
    ours: Score
    regressions: Mapping[Variant, Regression]


def trial_folders(folder: Path) -> list[Path]:
    """Folders of the trials in ``folder`` that were diagnosed, and are of one effect or of none."""
    return [each for each in sorted(folder.glob("trial_*")) if _is_wanted(each)]


def _is_wanted(folder: Path) -> bool:
    if not (folder / "diagnosis.json").is_file():
        return False
    kind: str = json.loads((folder / "answer.json").read_text())["answer"]["kind"]
    return kind in ("none", "effect", "foreign")


def read_trial(folder: Path) -> Trial:
    """A trial from its folder, on the recordings that were sealed.

    Raises :class:`InputError` for recordings or an answer that are not those, and for trials of another rig.
    """
    record, seal, diagnosis = (
        json.loads((folder / name).read_text())
        for name in ("answer.json", "campaign/seal.json", "diagnosis.json")
    )
    campaign = load_campaign(folder / "campaign")
    answer = opened(Seal(**seal["seal"]), envelope_of(record), campaign.sha256)
    sheet = file_content(default_rig_path())
    if record["settings"].get("rig_sha256") not in (None, rig_marks(sheet)["rig_sha256"]):
        raise InputError("is a trial of another rig", source=folder, remedy="name trials of the shipped rig")
    measured = measured_response(campaign, QuarterCar, SIMTR.orders)
    regressions = regressions_of(measured, parse_rig(sheet, default_rig_path()))
    return Trial(folder, answer, score_of(answer, diagnosis), regressions)


def regressions_of(measured: HarmonicResponse, rig: Rig) -> dict[Variant, Regression]:
    """The regressions of a measured response."""
    plant, data = problem_of_dwells(measured, RigModel(rig, SIMTR.baseline), SIMTR)
    problem = recalibrate(plant, data, {}, lambda line: None)
    base, terms = problem.base, problem.plant.candidates
    changes = problem.plant.sensitivities((), base.values, base.prediction.warm_start, terms)
    columns: dict[Shapes, _Columns] = {
        "typical": _columns(terms, [each[len(each) // 2 :][:1] for each in changes]),
        "tried": _columns(terms, changes),
    }
    return {
        variant: _regression(problem, columns[variant.shapes], _whitening(problem, variant.errors))
        for variant in VARIANTS
    }


class _Columns(NamedTuple):
    """What effects of a typical size do to the rows [units of the rows], (m, k), by the effects' names."""

    names: list[str]
    rows: Real
    either_sign: NDArray[np.bool_]


def _columns(terms: Sequence[Term], changes: Sequence[Real]) -> _Columns:
    """A column for each amplitude at each shape, from ``changes`` (shapes, m, amplitudes) per unit of each."""
    names, rows, either_sign = [], [], []
    for term, change in zip(terms, changes, strict=True):
        lower, upper = bounds_of(term.amplitudes)
        for at_shape in change[np.isfinite(change).all(axis=(1, 2))]:
            names += [term.name] * len(term.amplitudes)
            rows += [at_shape[:, place] * each.scale for place, each in enumerate(term.amplitudes)]
            either_sign += ((lower < 0.0) & (upper > 0.0)).tolist()
    return _Columns(names, np.stack(rows, axis=1), np.array(either_sign))


def _whitening(problem: DiagnosisProblem, errors: Errors) -> Callable[[Real], Real]:
    """What turns changes of the rows, (m,) or (m, n), into independent ones of unit variance."""
    search = problem.search
    if errors == "noise":
        return partial(_over, np.sqrt(problem.data.variance))
    variance = search.rows.variance if errors == "tolerances" else problem.base.noise_scales.spread
    return lambda rows: _over(np.sqrt(variance), search.turned(rows))


def _over(sd: Real, rows: Real) -> Real:
    return np.asarray((rows.T / sd).T)


def _regression(problem: DiagnosisProblem, columns: _Columns, whiten: Callable[[Real], Real]) -> Regression:
    """Residual and library, calibration projected out."""
    base = problem.base
    # The prior of what calibration may do counts as further rows.
    basis, _ = np.linalg.qr(np.concatenate([whiten(base.slopes), np.eye(base.x.size)]))

    def apart(rows: Real, tail: Real) -> Real:
        whole = np.concatenate([rows, tail])
        return np.asarray(whole - basis @ (basis.T @ whole))

    residual = apart(whiten(problem.search.residual(base.prediction)), -base.x)
    library = apart(whiten(columns.rows), np.zeros((base.x.size, len(columns.names))))
    size = np.linalg.norm(library, axis=0)
    seen = np.flatnonzero(size > SEEN)
    names = [columns.names[place] for place in seen]
    return merged(
        Regression(tuple(names), library[:, seen] / size[seen], columns.either_sign[seen], residual)
    )


def merged(regression: Regression) -> Regression:
    """Effects that do exactly the same as one column, under all their names: a regression cannot do with both."""
    kept: list[int] = []
    shared: list[list[str]] = []
    either_sign = regression.either_sign.copy()
    library = regression.library
    for place, name in enumerate(regression.names):
        cosines = library[:, kept].T @ library[:, place]
        same = np.flatnonzero(np.abs(cosines) > SAME)
        if same.size:
            first = int(same[0])
            either_sign[kept[first]] |= either_sign[place] or cosines[first] < 0.0
            shared[first] += [name] if name not in shared[first] else []
        else:
            kept.append(place)
            shared.append([name])
    names = tuple("|".join(each) for each in shared)
    return Regression(names, library[:, kept], either_sign[kept], regression.residual)
