"""``savgs-ident posterior`` as a process, with either sampler: how fast it gives draws as good as independent."""

import json
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import get_args

from benchmarks.outcome import Outcome, Progress
from benchmarks.processes import Ran, run_process
from savgs_ident.inference.result import Sampler
from savgs_ident.plants.quarter_car.rig import default_campaign_path

CLI = ("-m", "savgs_ident.cli")

NOT_TRUSTED = 1
"""Exit code of a run that gave a result and does not vouch for it."""


def measure_posterior(target_ess: float, progress: Progress) -> Outcome:
    """Effective draws per second of whole processes, and how long the slower one takes, with programs cached.

    The model is what ``savgs-ident fit`` makes of the shipped campaign. For each sampler a first run, with
    few draws, fills the cache; the second is measured.
    """
    campaign, seconds, total = str(default_campaign_path()), [], Outcome()
    with TemporaryDirectory() as folder:
        progress("posterior: the fit that it starts from")
        run_process([*CLI, "fit", campaign, "--out", str(Path(folder) / "fit"), "--quiet"])

        def run(sampler: str, target: float) -> Ran:
            options = ["--sampler", sampler, "--target-ess", str(target), "--json", "--quiet"]
            places = [str(Path(folder) / "fit" / "model.toml"), campaign, "--out", str(Path(folder) / "out")]
            return run_process([*CLI, "posterior", *places, *options])

        for sampler in get_args(Sampler):
            progress(f"posterior: {sampler}, filling the cache")
            run(sampler, 1.0)
            progress(f"posterior: {sampler}, to an effective sample size of {target_ess:g}")
            ran = run(sampler, target_ess)
            total += outcome_of(sampler, ran)
            seconds.append(ran.seconds)
    if len(total.figures) < len(seconds):
        return total
    return total + Outcome({"posterior_wall_s": max(seconds)})


def outcome_of(sampler: str, ran: Ran) -> Outcome:
    """The least effective sample size of the identified parameters, over the time of the whole process."""
    if ran.code not in (0, NOT_TRUSTED):
        return Outcome({}, (f"posterior: {sampler} ended with exit code {ran.code}",))
    record = json.loads(ran.output)
    ess = float(record["ess_min"])
    notes = [
        f"posterior: {sampler}, effective sample size {ess:.0f} in {ran.seconds:.1f} s, interpreter start to exit, "
        "on all dwells of the campaign."
    ]
    if ran.code == NOT_TRUSTED:
        notes.append(f"posterior: {sampler} does not vouch for its result: {'; '.join(record['reasons'])}.")
    return Outcome({f"posterior_ess_per_s_{sampler}": ess / ran.seconds}, tuple(notes))
