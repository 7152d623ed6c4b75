"""Reports of checks: of a plant of one's own, of false alarms and of the posterior where nothing is missing.

What draws is loaded when something is drawn.
"""

from collections.abc import Iterable, Iterator, Mapping
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Group, RenderableType
from scipy.stats import binom

from savgs_ident.core.files import write_bytes
from savgs_ident.diagnosis.thresholds import DEFAULTS
from savgs_ident.report.presenters import AbstractPresenter, Figures
from savgs_ident.report.text import decimal, percentage, plain, table
from savgs_ident.validation.calibration import BINS, INTERVAL, RANKED, CalibrationStudy
from savgs_ident.validation.check_plant import PlantCheck
from savgs_ident.validation.false_alarms import CONFIDENCE, AlarmStudy

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from savgs_ident.validation.plan import CampaignPlan


def alarms_record(study: AlarmStudy) -> dict[str, Any]:
    """How many of the draws were false alarms, the rate that they leave possible, and all odds.

    Odds are log odds.
    """
    return {
        "schema": 1,
        "few_enough": study.trusted,
        "drawn": len(study.solved),
        "not_solved": len(study.draws) - len(study.solved),
        "alarms": study.alarms,
        "rate_at_most": study.rate_at_most,
        "confidence": CONFIDENCE,
        "threshold": DEFAULTS.alarm_log_odds,
        "odds": study.odds,
        "drawn_odds": list(study.solved),
        "named": [list(each.named) for each in study.draws if each.alarm],
        "command": study.origin.command_line,
    }


def alarms_text(record: Mapping[str, Any]) -> str:
    """The same in two sentences."""
    lost = f" ({record['not_solved']} more could not be solved)" if record["not_solved"] else ""
    sentence = (
        f"Of {record['drawn']} campaigns like this one with nothing missing{lost}, the diagnosis reported something "
        f"missing in {record['alarms']}: the rate of false alarms is at most {percentage(record['rate_at_most'])} "
        f"({percentage(record['confidence'], 0)} confidence)."
    )
    if not record["drawn_odds"]:
        return sentence
    return (
        f"{sentence} Their log odds that something is missing are {decimal(min(record['drawn_odds']), 1)} to "
        f"{decimal(max(record['drawn_odds']), 1)}, those of this campaign {decimal(record['odds'], 1)}; the "
        f"threshold of an alarm is {decimal(record['threshold'], 0)}."
    )


def alarms_figure(study: AlarmStudy) -> "Figure":
    """Histogram of the log odds of the draws, with those of the campaign and the threshold."""
    from savgs_ident.report.theme import BLUE, INK, ORANGE, new_figure, styled

    solved, odds = np.array(study.solved), study.odds
    with styled():
        figure = new_figure(6.4, 3.4)
        axes = figure.subplots()
        axes.hist(
            solved, bins="sturges", color=BLUE, alpha=0.75, rwidth=0.9, label="campaigns with nothing missing"
        )
        axes.axvline(DEFAULTS.alarm_log_odds, color=INK, linestyle="--", label="threshold of an alarm")
        # Odds of a campaign in which something is missing are in the thousands: they would leave the rest no room.
        shown = min(odds, 2.0 * DEFAULTS.alarm_log_odds)
        there = "this campaign" if odds <= shown else f"this campaign: {odds:.0f}, far to the right"
        axes.axvline(shown, color=ORANGE, label=there)
        axes.set_xlabel("log odds that something is missing [nat]")
        axes.set_ylabel("campaigns")
        axes.set_title(f"{solved.size} campaigns with nothing missing, diagnosed")
        axes.legend(loc="upper center", fontsize=8)
    return figure


class _AlarmStudy(AbstractPresenter[AlarmStudy]):
    stem = "false_alarms"

    def record(self, result: AlarmStudy) -> Mapping[str, Any]:
        return alarms_record(result)

    def text(self, result: AlarmStudy) -> RenderableType:
        return plain(alarms_text(self.record(result)))

    def doubts(self, result: AlarmStudy) -> tuple[str, ...]:
        return () if result.trusted else ("there are more false alarms than there may be.",)

    def figures(self, result: AlarmStudy) -> Figures:
        return {"false_alarms": lambda: alarms_figure(result)}


ALARM_STUDY = _AlarmStudy()


def calibration_record(study: CalibrationStudy) -> dict[str, object]:
    """Coverage and rank statistics by parameter, how many trials failed, and whether all is as it should be."""
    found, ranked = study.coverage, [trial for trial in study.trials if trial.solved and trial.found]
    solved = sum(trial.solved for trial in study.trials)
    return {
        "schema": 1,
        "calibrated": found.calibrated,
        "coverage": found.overall,
        "interval": INTERVAL,
        "ranks_even": found.even,
        "trials": len(study.trials),
        "not_solved": len(study.trials) - solved,
        "mode_not_found": solved - len(ranked),
        "places": RANKED + 1,
        "parameters": {
            name: {
                "coverage": found.inside[name],
                "uniformity": found.uniformity[name],
                "ranks": [trial.rank[name] for trial in ranked],
            }
            for name in study.names
        },
        "command": study.origin.command_line,
    }


def calibration_text(record: Mapping[str, Any]) -> RenderableType:
    """Coverage of every parameter in a table, and the sum of it in words."""
    rows = [
        [name, f"{100.0 * each['coverage']:.0f}", f"{each['uniformity']:.2g}"]
        for name, each in record["parameters"].items()
    ]
    counted = record["trials"] - record["not_solved"]
    words = (
        f"{100.0 * record['interval']:.0f} % intervals contained the truth in {100.0 * record['coverage']:.1f} % of "
        f"{counted} campaigns times {len(rows)} parameters; {record['not_solved']} campaigns could not be "
        f"simulated, of {record['mode_not_found']} the mode was not found (counted as missed)."
    )
    headers = ["parameter", "inside\n[%]", "ranks even\n(p value)"]
    return Group(table("Calibration", headers, rows, texts=(0,)), plain(words))


def calibration_figure(study: CalibrationStudy) -> "Figure":
    """Rank histograms of all parameters; the band holds 95 % of the bars of an even one."""
    from savgs_ident.report.theme import BLUE, INK, PALE, new_figure, printable, styled

    ranked, names = [trial for trial in study.trials if trial.found], study.names
    columns = 6
    rows = max(1, -(-len(names) // columns))
    with styled():
        figure = new_figure(11.0, 1.0 + 1.35 * rows)
        figure.suptitle(
            f"Ranks of true values among {RANKED} posterior draws, {len(ranked)} synthetic campaigns",
            fontsize=11,
        )
        axes = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
        low, high = binom.ppf([0.025, 0.975], len(ranked), 1.0 / BINS)
        for place, each in enumerate(axes.ravel()):
            if place >= len(names):
                each.set_visible(False)
                continue
            name = names[place]
            each.axhspan(low, high, color=PALE, linewidth=0.0)
            each.axhline(len(ranked) / BINS, color=INK, linewidth=0.8)
            edges = np.linspace(0, RANKED + 1, BINS + 1)
            each.hist([trial.rank[name] for trial in ranked], bins=edges, color=BLUE, alpha=0.75, rwidth=0.9)
            each.set_title(printable(name), fontsize=8.5)
        figure.supxlabel(f"rank of the true value [0 to {RANKED}]", fontsize=9)
        figure.supylabel("campaigns", fontsize=9)
    return figure


class _CalibrationStudy(AbstractPresenter[CalibrationStudy]):
    stem = "calibration"

    def record(self, result: CalibrationStudy) -> Mapping[str, Any]:
        return calibration_record(result)

    def text(self, result: CalibrationStudy) -> RenderableType:
        return calibration_text(self.record(result))

    def doubts(self, result: CalibrationStudy) -> tuple[str, ...]:
        return () if result.trusted else ("coverage or ranks are not what they should be.",)

    def figures(self, result: CalibrationStudy) -> Figures:
        return {"calibration": lambda: calibration_figure(result)}


CALIBRATION_STUDY = _CalibrationStudy()


def plant_check_record(check: PlantCheck) -> dict[str, Any]:
    """What was found, what the plant declares, and at which frequencies it was looked at [Hz]."""
    plant, free, tolerant, typical, exact = check.model.plant, *_known(check)
    return {
        "schema": 1,
        "plant": check.model.plant_name,
        "no_faults": check.trusted,
        "findings": [
            {"severity": each.severity, "what": each.what, "remedy": each.remedy} for each in check.findings
        ],
        "natural_frequencies_hz": check.natural_frequencies,
        "frequencies_hz": check.frequencies,
        "inputs": [each.name for each in plant.inputs],
        "channels": [each.name for each in plant.channels],
        "ports": [each.name for each in plant.ports],
        "effects": list(check.model.catalogue),
        "identified": free,
        "known_to_tolerance": tolerant,
        "known_to_an_order_of_magnitude": typical,
        "exact": exact,
        "command": check.origin.command_line,
    }


def plant_check_text(check: PlantCheck) -> RenderableType:
    """The same as sentences and a table of findings."""
    plant, free, tolerant, typical, exact = check.model.plant, *_known(check)
    natural = ", ".join(f"{each:.3g}" for each in check.natural_frequencies)
    parts = [
        f"{check.model.plant_name}: coordinates {_names(each.name for each in plant.coordinates)}; inputs "
        f"{_names(each.name for each in plant.inputs)}; channels {_names(each.name for each in plant.channels)}.",
        f"Ports: {_names(each.name for each in plant.ports)}; {len(check.model.catalogue)} effects can be looked "
        "for there.",
        f"A fit identifies {_names(free)}; known to a tolerance: {_names(tolerant)}; to an order of magnitude: "
        f"{_names(typical)}; taken as exact: {_names(exact)}.",
        *([f"Natural frequencies near its rest: {natural} Hz."] if natural else []),
    ]
    found: RenderableType = plain("No faults, and nothing else to say.")
    if check.findings:
        rows = [(each.severity, each.what, each.remedy) for each in check.findings]
        found = table("Findings", ("", "what", "what to do"), rows, texts=(0, 1, 2))
    return Group(*(plain(each) for each in parts), plain(""), found)


def _known(check: PlantCheck) -> tuple[list[str], ...]:
    """Names of parameters that a fit identifies, known to a tolerance, to an order of magnitude, and exact."""
    entries = check.model.table.entries
    open_ones = [
        each.name
        for each in entries
        if each.tolerance == 0.0 and isfinite(each.lower) and isfinite(each.upper)
    ]
    typical = [each.name for each in entries if each.is_typical]
    tolerant = [each.name for each in entries if each.tolerance > 0.0 and not each.is_typical]
    exact = [each.name for each in entries if each.name not in (*open_ones, *tolerant, *typical)]
    return open_ones, tolerant, typical, exact


def _names(names: Iterable[str]) -> str:
    return ", ".join(names) or "none"


class _PlantCheck(AbstractPresenter[PlantCheck]):
    stem = "check-plant"

    def record(self, result: PlantCheck) -> Mapping[str, Any]:
        return plant_check_record(result)

    def text(self, result: PlantCheck) -> RenderableType:
        return plant_check_text(result)

    def doubts(self, result: PlantCheck) -> tuple[str, ...]:
        return tuple(f"{each.what}." for each in result.findings if each.severity == "fault")


PLANT_CHECK = _PlantCheck()


class _CampaignPlan(AbstractPresenter["CampaignPlan"]):
    stem = "plan"

    def record(self, result: "CampaignPlan") -> Mapping[str, Any]:
        from savgs_ident.report.plan import plan_record

        return plan_record(result)

    def text(self, result: "CampaignPlan") -> RenderableType:
        from savgs_ident.report.plan import plan_text

        return plan_text(result)

    def doubts(self, result: "CampaignPlan") -> tuple[str, ...]:
        short = [
            f"{name} to {100.0 * error:.4g} %"
            for name, error in result.errors.items()
            if error > result.target
        ]
        if not short:
            return ()
        return (
            f"the campaign would give {', '.join(short)}, where {100.0 * result.target:.2g} % are asked for: "
            "allow more tests, other frequencies or larger amplitudes.",
        )

    def figures(self, result: "CampaignPlan") -> Figures:
        from savgs_ident.report.plan import plan_figure

        return {"plan": lambda: plan_figure(result)}

    def more(self, result: "CampaignPlan", folder: Path) -> Iterator[Path]:
        from savgs_ident.report.plan import plan_list

        yield write_bytes(folder / "plan.csv", plan_list(result).encode())


CAMPAIGN_PLAN = _CampaignPlan()
