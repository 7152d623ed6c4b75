"""How verdicts move when decision constants that steer the search are halved or doubled: everything is fitted anew.

    python -m benchmarks.refits out/blind --trials 20

Constants that decide among finished fits are varied by ``savgs-ident blind --sensitivity``, for next to nothing.
These here change what is fitted, so that each of their values costs a diagnosis of every trial. They are therefore
varied in groups (:data:`GROUPS`), all constants of a group together: where no verdict moves, none of them matters by
itself, unless two of them cancel. ``--each GROUP`` takes a group apart.

The trials are the first of a folder that ``savgs-ident blind`` wrote, on their recordings; what is compared is the
verdict there, marked by the same rules without looking at other ports. ``refits.jsonl`` in that folder keeps what is
done, and a run that was stopped goes on.
"""

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.plants.parameter_toml import file_content
from savgs_ident.plants.quarter_car.rig import default_rig_path, parse_rig
from savgs_ident.validation.blind_answer import Answer, envelope_of
from savgs_ident.validation.blind_marks import score_of
from savgs_ident.validation.blind_rates import rates_of
from savgs_ident.validation.blind_score import Score, said_words, truth_words
from savgs_ident.validation.blind_trial import diagnose_folder
from savgs_ident.validation.trials import TrialFile, run_trials

FILE = "refits.jsonl"

FACTORS = (0.5, 2.0)
"""By what each constant is multiplied. What is counted stays a whole number, and one at the least."""

GROUPS: Mapping[str, tuple[str, ...]] = {
    "effort": (
        *(
            "first_fits",
            "further_fits",
            "pairs_per_parent",
            "resonance_peaks",
            "resonance_steps",
            "first_order_pairs",
            "parents",
        ),
        *("refined_fits", "nearest_ports", "learned_fits", "learned_steps", "first_learned_steps"),
        *("likely_families", "held_out_fits", "held_out_steps", "drift_rounds"),
    ),
    "gates": (
        *("promising_log_evidence", "pair_log_evidence", "refined_log_evidence", "negligible_gain"),
        *(
            "explained_share_flexible",
            "alike_share",
            "significant_drift",
            "least_drift",
            "least_parameter_share",
        ),
    ),
    "widths of effects": ("amplitude_width", "shape_width"),
    "priors of learned laws": ("function_prior", "interaction_prior", "simple_law_prior"),
    "small errors": (
        "material_error",
        "input_error",
        "curve_tolerance",
        "drift_tolerance",
        "independent_error",
    ),
}
"""Constants by what they have in common."""

LEFT_OUT: Mapping[str, tuple[str, ...]] = {
    "grids": (
        *("family_widths", "curve_points", "law_widths", "resonances", "ripple_orders", "learned_places"),
        *("location_folds", "held_out_folds", "free_orders", "free_orders_along_motion"),
    ),
    "where fits begin": ("resonance_damping", "lag_of_play", "blocking_of_play", "motion_margin"),
    "resolutions": ("drift_convergence", "least_function_share", "cosine_resolution", "free_input_width"),
    "cannot be doubled": ("lookalike_cosine",),
    "what is shown": (
        *("reported_share", "visible_sigma", "assessable_sizes", "reversal_speed", "mid_stroke_speed"),
        *(
            "small_discrepancy",
            "noisiest",
            "same_regime_share",
            "fewest_trend_tests",
            "sweep_dwells",
            "proposed_tests",
        ),
        *("proposed_dwells", "curve_alike", "fewest_held_out_tests"),
    ),
}
"""Constants that are not varied, by the reason."""


class Variation(NamedTuple):
    """Constants that are multiplied by a factor together."""

    name: str
    factor: float
    constants: tuple[str, ...]

    def applied(self) -> DecisionConstants:
        """The constants with these moved."""
        moved: dict[str, Any] = {
            name: _moved(getattr(DEFAULTS, name), self.factor) for name in self.constants
        }
        return replace(DEFAULTS, **moved)


def _moved(value: float, factor: float) -> float:
    return max(1, round(factor * value)) if isinstance(value, int) else factor * value


def variations(apart: Sequence[str] = ()) -> list[Variation]:
    """All groups by all factors; those to be taken ``apart`` one constant at a time, and nothing else then."""
    if apart:
        single = [name for group in apart for name in GROUPS[group]]
        return [Variation(name, factor, (name,)) for name in single for factor in FACTORS]
    return [Variation(name, factor, group) for name, group in GROUPS.items() for factor in FACTORS]


@dataclass(frozen=True)
class Refit:
    """What a diagnosis by other constants says of a trial: the parts of its ``diagnosis.json`` that are marked."""

    number: int
    trial: str
    variation: str
    factor: float
    said: Mapping[str, Any]


class Task(NamedTuple):
    """A trial and the constants that it is to be diagnosed by."""

    folder: Path
    variation: Variation


def refit(tasks: Sequence[Task], number: int) -> Refit:
    """The trial diagnosed anew."""
    folder, variation = tasks[number]
    rig = parse_rig(file_content(default_rig_path()), default_rig_path())
    found = diagnose_folder(folder / "campaign", rig, _answer(folder).without, constants=variation.applied())
    said = {name: found[name] for name in ("verdict", "which", "shrink", "wall_s")}
    return Refit(number, folder.name, variation.name, variation.factor, said)


def _answer(folder: Path) -> Answer:
    return envelope_of(json.loads((folder / "answer.json").read_text())).answer


def table_of(folder: Path, refits: Sequence[Refit]) -> list[str]:
    """A line for each variation: how many verdicts moved, which, and the marks of all; first those as they were."""
    trials = sorted({each.trial for each in refits})
    before = {
        name: score_of(_answer(folder / name), json.loads((folder / name / "diagnosis.json").read_text()))
        for name in trials
    }
    lines = [f"as they are: {_marks(list(before.values()))}"]
    for name, factor in dict.fromkeys((each.variation, each.factor) for each in refits):
        after = {
            each.trial: score_of(_answer(folder / each.trial), each.said)
            for each in refits
            if (each.variation, each.factor) == (name, factor)
        }
        moved = [
            f"    trial {one.number}, {truth_words(one)}: {said_words(one)} -> {said_words(after[trial])}"
            for trial, one in before.items()
            if trial in after and said_words(one) != said_words(after[trial])
        ]
        lines.append(
            f"{name} x {factor:g}: {len(moved)} of {len(after)} move; {_marks(list(after.values()))}"
        )
        lines += moved
    return lines


def _marks(scores: Sequence[Score]) -> str:
    return ", ".join(
        f"{name} {each.count}/{each.total}" for name, each in rates_of(scores).items() if each.total
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.refits", description=__doc__.split("\n\n")[0])
    parser.add_argument("folder", type=Path, help="folder that `savgs-ident blind` wrote")
    parser.add_argument("--trials", type=int, default=20, help="how many of its first trials (20)")
    parser.add_argument("--each", nargs="+", default=(), choices=[*GROUPS], help="groups to take apart")
    parser.add_argument("--jobs", type=int, help="diagnoses at a time; one for each core if not given")
    given = parser.parse_args(arguments)
    folders = sorted(each.parent for each in given.folder.glob("trial_*/diagnosis.json"))[: given.trials]
    if not folders:
        parser.error(f"{given.folder} has no trials; `savgs-ident blind --out {given.folder}` makes some")
    tasks = [Task(folder, each) for each in variations(given.each) for folder in folders]
    marks = {"tasks": [[task.folder.name, task.variation.name, task.variation.factor] for task in tasks]}
    file = TrialFile(given.folder / FILE, marks, resume=True)
    done = file.earlier(lambda kept: Refit(**kept))
    refits = run_trials(
        partial(refit, tasks),
        len(tasks),
        file,
        done,
        jobs=given.jobs,
        progress=partial(print, file=sys.stderr),
    )
    print("\n".join(table_of(given.folder, refits)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
