"""Draws one after the other, each kept as soon as it is there."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from savgs_ident.cli.console import Progress, Voice, complain
from savgs_ident.cli.diagnosing import Job as DiagnosisJob
from savgs_ident.cli.diagnosing import baseline_of
from savgs_ident.cli.guard import NOT_TRUSTED, OK
from savgs_ident.cli.kept_trials import begin_trials, campaign_marks, completed, known_trials, rig_marks
from savgs_ident.cli.reading import read_response
from savgs_ident.core.records import record_of
from savgs_ident.core.rig import default_rig_path, parse_rig, rig_content
from savgs_ident.diagnose.false_alarms import AlarmBench, NullDraw, alarm_bench
from savgs_ident.report.false_alarms import alarms_figure, alarms_record, alarms_text
from savgs_ident.report.files import prepare_folder, write_json
from savgs_ident.report.picture import write_figure
from savgs_ident.report.terminal import plain
from savgs_ident.simulate.compilation import use_persistent_cache


@dataclass(frozen=True)
class Job:
    """What is diagnosed, how many campaigns are drawn from it, and how."""

    diagnosis: DiagnosisJob
    draws: int
    seed: int
    resume: bool

    @property
    def rig(self) -> Path:
        """The rig file."""
        return self.diagnosis.rig or default_rig_path()

    def marks(self, sheet: bytes) -> dict[str, object]:
        """What draws must have in common to be counted together, with ``sheet`` in the rig file.

        Raises :class:`InputError` where the campaign cannot be read.
        """
        campaign, channels = self.diagnosis.campaign, self.diagnosis.channels
        return {
            "campaign": str(campaign),
            "channels": str(channels),
            **campaign_marks(campaign, channels),
            "rig": str(self.rig),
            **rig_marks(sheet),
            "model": self.diagnosis.model and self.diagnosis.model.value,
            "max_frequency": self.diagnosis.max_frequency,
            "orders": self.diagnosis.orders,
            "seed": self.seed,
        }


def count_false_alarms(job: Job, voice: Voice, out: Path) -> int:
    """Draw, write and tell what came out; the exit code."""
    prepare_folder(out)
    use_persistent_cache()
    kept = out / "draws.jsonl"
    sheet = rig_content(job.rig)
    marks = job.marks(sheet)
    done = draws_in(kept, marks) if job.resume else []
    with voice.working() as progress:
        bench = _bench(job, sheet, progress)
        if not done:
            begin_trials(kept, marks)
        draws = completed(kept, done, job.draws, bench.draw, progress)
        record = alarms_record(draws, bench.odds, job.diagnosis.command)
        files = [write_json(out / "false_alarms.json", record), kept]
        files += write_figure(out, "false_alarms", alarms_figure(draws, bench.odds))
    voice.show(plain(alarms_text(record)), plain("Written: " + ", ".join(str(file) for file in files)))
    voice.hand_over(record)
    if record["few_enough"]:
        return OK
    complain("Not to be trusted: there are more false alarms than there may be.")
    return NOT_TRUSTED


def draws_in(kept: Path, marks: Mapping[str, object]) -> list[NullDraw]:
    """The draws of an earlier run; raises as :func:`savgs_ident.cli.kept_trials.known_trials` does."""
    return known_trials(kept, marks, partial(record_of, NullDraw))


def _bench(job: Job, sheet: bytes, progress: Progress) -> AlarmBench:
    asked = job.diagnosis
    rig, settings, values = baseline_of(parse_rig(sheet, job.rig), asked, job.rig)
    _, measured = read_response(asked.campaign, asked.channels, asked.orders, asked.max_frequency, progress)
    return alarm_bench(measured, rig, settings, values, job.seed, progress)
