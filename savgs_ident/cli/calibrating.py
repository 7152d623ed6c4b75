"""Trials one after the other, each kept as soon as it is there."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from savgs_ident.cli.console import Progress, Voice, complain
from savgs_ident.cli.guard import NOT_TRUSTED, OK
from savgs_ident.cli.kept_trials import begin_trials, campaign_marks, completed, known_trials, rig_marks
from savgs_ident.cli.models import effects_in, identified_in, rig_before
from savgs_ident.cli.reading import read_response
from savgs_ident.cli.selection import every_so_many
from savgs_ident.core.records import record_of
from savgs_ident.core.rig import Rig, parse_rig, rig_content
from savgs_ident.posterior.calibration import RANKED, Trial, calibrator
from savgs_ident.posterior.result import Sampler
from savgs_ident.posterior.sample import Question
from savgs_ident.posterior.settings import SamplingSettings
from savgs_ident.report.calibration import calibration_figure, calibration_record, calibration_text
from savgs_ident.report.files import prepare_folder, write_json
from savgs_ident.report.picture import write_figure
from savgs_ident.report.terminal import plain
from savgs_ident.simulate.compilation import use_persistent_cache

DRAWS = 100.0
"""Effective sample size of a trial's posterior: enough for its ranks and the ends of its intervals."""


@dataclass(frozen=True)
class Job:
    """What to calibrate, and how."""

    model: Path
    campaign: Path
    channels: Path | None
    trials: int
    sampler: Sampler
    every: int
    seed: int
    resume: bool
    command: Sequence[str]

    def marks(self, content: bytes) -> dict[str, object]:
        """What trials must have in common to be counted together, with ``content`` in the model's rig file.

        Raises :class:`InputError` where the campaign cannot be read.
        """
        return {
            "model": str(self.model),
            **rig_marks(content),
            "campaign": str(self.campaign),
            "channels": str(self.channels),
            **campaign_marks(self.campaign, self.channels),
            "sampler": self.sampler,
            "every": self.every,
            "seed": self.seed,
        }


def calibrate_by_trials(job: Job, voice: Voice, out: Path) -> int:
    """Run the trials, write and tell what they say; the exit code."""
    prepare_folder(out)
    use_persistent_cache()
    kept = out / "trials.jsonl"
    content = rig_content(job.model)
    rig = parse_rig(content, job.model)
    marks = job.marks(content)
    done = trials_in(kept, marks) if job.resume else []
    with voice.working() as progress:
        trials = _run(job, rig, kept, marks, done, progress)
        first = identified_in(rig, effects_in(rig, job.model), job.model)[0]
        ranked = next((each.rank for each in trials if each.rank), {})
        names = sorted(ranked, key=lambda name: name not in first)
        record = calibration_record(trials, names, job.command)
        files = [write_json(out / "calibration.json", record), kept]
        files += write_figure(out, "calibration", calibration_figure(trials, names))
    voice.show(calibration_text(record), plain("Written: " + ", ".join(str(file) for file in files)))
    voice.hand_over(record)
    if record["calibrated"]:
        return OK
    complain("Not to be trusted: coverage or ranks are not what they should be.")
    return NOT_TRUSTED


def trials_in(kept: Path, marks: Mapping[str, object]) -> list[Trial]:
    """The trials of an earlier run; raises as :func:`savgs_ident.cli.kept_trials.known_trials` does."""
    ranked: set[str] = set()

    def trial(fields: Mapping[str, object]) -> Trial:
        found = record_of(Trial, fields)
        ranked.update(found.rank)
        if found.rank.keys() != found.inside.keys() or (found.rank and found.rank.keys() != ranked):
            raise ValueError("trials are of different parameters")
        if not all(0 <= rank <= RANKED for rank in found.rank.values()):
            raise ValueError("a rank is none")
        return found

    return known_trials(kept, marks, trial)


def _run(
    job: Job, rig: Rig, kept: Path, marks: Mapping[str, object], done: list[Trial], progress: Progress
) -> list[Trial]:
    effects = effects_in(rig, job.model)
    _, response = read_response(job.campaign, job.channels, SamplingSettings.orders, None, progress)
    measured = every_so_many(response, job.every)
    free, values = identified_in(rig, effects, job.model)
    question = Question(measured, rig_before(rig, effects, job.model), values, effects, free)
    progress("preparing")
    settings = SamplingSettings(job.sampler, target_ess=DRAWS, seed=job.seed)
    work = calibrator(question, settings)
    # Not before all else is known to be well: what an earlier run left is gone then.
    if not done:
        begin_trials(kept, marks)
    return completed(kept, done, job.trials, work.trial, progress)
