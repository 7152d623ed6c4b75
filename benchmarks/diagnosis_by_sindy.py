"""Sparse regression by pySINDy on blind trials, beside what the diagnosis said of the same trials.

pySINDy gets all that can be given to it: the recalibrated baseline's residuals over all dwells, channels and orders,
in units of their noise; and for a library what each of our effects does to them at its typical shape, made
orthogonal to everything that calibration and tolerances can do. Its task is what it is made for: to find the few
terms that matter. The threshold below which it drops a term is chosen for it knowing all answers.
"""

import json
import os
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.outcome import Outcome, Progress
from savgs_ident.diagnosis.model_selection import recalibrate
from savgs_ident.diagnosis.quarter_car import SIMTR, quarter_car_problem
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.rig import Rig, default_rig_path, read_rig
from savgs_ident.plants.quarter_car.rig_recordings import load_campaign
from savgs_ident.responses.dwells import estimate_response
from savgs_ident.simulate.excitation import recorded_names
from savgs_ident.validation.trials import side_by_side

THRESHOLDS = tuple(np.geomspace(2.0, 200.0, 41).tolist())
"""Thresholds tried for the peer, in standard deviations of a coefficient."""

SAME = 1.0 - 1e-6
"""Cosine from which on two columns are one."""

Real = NDArray[np.float64]

Said = str | None
"""The term that matters most; None if none does."""


class Trial(NamedTuple):
    """A blind trial as the peer sees it, and the truth.

    Attributes:
        kind: what was drawn.
        truth: the effect, if it is one.
        ours: what the diagnosis named first; None if it said that nothing is missing.
        names: effects of each column of the library, split by a bar where several do the same.
        library: what each effect does to the residuals, of unit length, (m, k).
        residual: in units of the noise, (m,).
    """

    kind: str
    truth: str
    ours: Said
    names: tuple[str, ...]
    library: Real
    residual: Real


class Marks(NamedTuple):
    """Effects named first that are the true one, of ``effects``; alarms where there was nothing, of ``nothing``."""

    right: int
    effects: int
    alarms: int
    nothing: int


def measure(folder: Path, progress: Progress) -> Outcome:
    """Both on the trials of one effect or none in a folder that ``savgs-ident blind`` wrote."""
    folders = [each for each in sorted(folder.glob("trial_*")) if _is_wanted(each)]
    trials: list[Trial] = []
    for each in side_by_side(partial(_one_of, folders), range(len(folders)), os.cpu_count() or 1):
        trials.append(each)
        progress(f"sindy: {len(trials)} of {len(folders)} trials")
    if not trials:
        return Outcome({}, (f"sindy: no trials in {folder}; `savgs-ident blind --out {folder}` makes some.",))
    ours = marks_of([each.ours for each in trials], trials)
    figures: dict[str, float] = {"trials_effects": ours.effects, "trials_nothing": ours.nothing}
    for name, marks in {"ours": ours, **peers(trials)}.items():
        figures[f"top1_percent_{name}"] = 100.0 * marks.right / max(marks.effects, 1)
        figures[f"false_alarms_percent_{name}"] = 100.0 * marks.alarms / max(marks.nothing, 1)
    return Outcome(figures, ("sindy: thresholds chosen knowing all answers.",))


def _is_wanted(folder: Path) -> bool:
    """Whether the trial was diagnosed, and is one of one effect or of none."""
    if not (folder / "diagnosis.json").is_file():
        return False
    kind: str = json.loads((folder / "answer.json").read_text())["answer"]["kind"]
    return kind in ("none", "effect")


def _one_of(folders: Sequence[Path], place: int) -> Trial:
    return read_trial(folders[place], read_rig(default_rig_path()))


def peers(trials: Sequence[Trial]) -> dict[str, Marks]:
    """pySINDy's two greedy optimisers, each at the threshold that suits it best."""
    return {"stlsq": _best(by_stlsq, trials), "frols": _best(by_frols, trials)}


def _best(peer: Callable[[Trial, float], Said], trials: Sequence[Trial]) -> Marks:
    tried = [marks_of([peer(each, limit) for each in trials], trials) for limit in THRESHOLDS]
    return max(
        tried, key=lambda marks: marks.right / max(marks.effects, 1) - marks.alarms / max(marks.nothing, 1)
    )


def marks_of(said: Sequence[Said], trials: Sequence[Trial]) -> Marks:
    """Marks of what was said of every trial."""
    pairs = list(zip(said, trials, strict=True))
    return Marks(
        right=sum(trial.kind == "effect" and trial.truth in (name or "").split("|") for name, trial in pairs),
        effects=sum(trial.kind == "effect" for _, trial in pairs),
        alarms=sum(trial.kind == "none" and name is not None for name, trial in pairs),
        nothing=sum(trial.kind == "none" for _, trial in pairs),
    )


def by_stlsq(trial: Trial, threshold: float) -> Said:
    """Sequentially thresholded least squares: the largest of the terms that are left."""
    from pysindy import STLSQ

    # Where nothing is left it warns; that is an answer here.
    return _largest(STLSQ(threshold=threshold, alpha=1e-6), trial, threshold)


def by_frols(trial: Trial, threshold: float) -> Said:
    """Forward orthogonal least squares: the first term, if its coefficient is above the threshold."""
    from pysindy import FROLS

    return _largest(FROLS(max_iter=1, alpha=1e-6), trial, threshold)


def _largest(optimizer: Any, trial: Trial, threshold: float) -> Said:
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        optimizer.fit(trial.library, trial.residual[:, None])
    sizes = np.abs(np.asarray(optimizer.coef_)[0])
    place = int(np.argmax(sizes))
    return trial.names[place] if sizes[place] >= threshold else None


def read_trial(folder: Path, rig: Rig) -> Trial:
    """A trial from its folder."""
    answer = json.loads((folder / "answer.json").read_text())["answer"]
    verdict = json.loads((folder / "diagnosis.json").read_text())["verdict"]
    campaign = load_campaign(folder / "campaign")
    measured = estimate_response(campaign.only(recorded_names(QuarterCar)), SIMTR.orders)
    names, library, residual = regression_of(measured, rig)
    return Trial(
        kind=answer["kind"],
        truth="".join(answer["effects"][:1]),
        ours=None if verdict["kind"] == "none" else "".join(verdict["effects"][:1]) or verdict["kind"],
        names=names,
        library=library,
        residual=residual,
    )


def regression_of(measured: Any, rig: Rig) -> tuple[tuple[str, ...], Real, Real]:
    """Names, library and residual of a measured response, calibration projected out."""
    plant, data = quarter_car_problem(measured, rig, SIMTR)
    problem = recalibrate(plant, data, {}, lambda line: None)
    base, terms = problem.base, problem.plant.candidates
    weight = 1.0 / np.sqrt(problem.data.variance)
    columns = problem.plant.columns((), base.values, base.prediction.warm_start, terms)
    named = _columns(dict(zip((term.name for term in terms), columns, strict=True)))
    # The prior of what calibration may do counts as further rows.
    prior = np.eye(base.x.size)
    nuisances = np.concatenate([base.slopes * weight[:, None], prior])
    basis, _ = np.linalg.qr(nuisances)

    def apart(rows: Real, tail: Real) -> Real:
        whole = np.concatenate([rows, tail])
        return np.asarray(whole - basis @ (basis.T @ whole))

    residual = apart(problem.search.residual(base.prediction) * weight, -base.x)
    nothing = np.zeros((base.x.size, len(named)))
    library = apart(np.stack([each for _, each in named], axis=1) * weight[:, None], nothing)
    size = np.linalg.norm(library, axis=0)
    seen = size > 1e-9 * size.max()
    names = [name for (name, _), kept in zip(named, seen, strict=True) if kept]
    return *_apart(names, library[:, seen] / size[seen]), residual


def _apart(names: Sequence[str], library: Real) -> tuple[tuple[str, ...], Real]:
    """Effects that do exactly the same as one column, under all their names: the peer cannot do with both."""
    kept: list[int] = []
    shared: list[str] = []
    for place, name in enumerate(names):
        same = [one for one, other in enumerate(kept) if abs(library[:, other] @ library[:, place]) > SAME]
        if same:
            shared[same[0]] += f"|{name}"
        else:
            kept.append(place)
            shared.append(name)
    return tuple(shared), library[:, kept]


def _columns(columns: Mapping[str, Real]) -> list[tuple[str, Real]]:
    """One column for each amplitude, at the middle one of the shapes tried."""
    return [
        (name, each[len(each) // 2][:, place])
        for name, each in columns.items()
        for place in range(each.shape[2])
    ]
