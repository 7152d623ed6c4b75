"""Draws one after the other, each kept as soon as it is there."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from savgs_ident.cli.console import Progress, Voice, complain
from savgs_ident.cli.diagnosing import Job as DiagnosisJob
from savgs_ident.cli.diagnosing import baseline_of
from savgs_ident.cli.guard import NOT_TRUSTED, OK
from savgs_ident.cli.kept_trials import begin_trials, completed, known_trials
from savgs_ident.cli.reading import read_response
from savgs_ident.core.records import record_of
from savgs_ident.core.rig import default_rig_path, read_rig
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

    def marks(self) -> dict[str, object]:
        """What draws must have in common to be counted together."""
        return {
            "campaign": str(self.diagnosis.campaign),
            "channels": str(self.diagnosis.channels),
            "rig": str(self.diagnosis.rig or default_rig_path()),
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
    done = draws_in(kept, job.marks()) if job.resume else []
    with voice.working() as progress:
        bench = _bench(job, progress)
        if not done:
            begin_trials(kept, job.marks())
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


def _bench(job: Job, progress: Progress) -> AlarmBench:
    asked = job.diagnosis
    source = asked.rig or default_rig_path()
    rig, settings, values = baseline_of(read_rig(source), asked, source)
    _, measured = read_response(asked.campaign, asked.channels, asked.orders, asked.max_frequency, progress)
    return alarm_bench(measured, rig, settings, values, job.seed, progress)
