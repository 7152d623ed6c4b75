"""How each result is shown: its JSON object, its text, its report, its pictures, its files.

A result names its presenter (:mod:`savgs_ident.core.presentation`); the command line and a notebook show it by the
same one. What draws is loaded when something is drawn.
"""

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from rich.console import RenderableType

from savgs_ident.core.files import write_bytes
from savgs_ident.core.output import write_json, write_table
from savgs_ident.core.presentation import Origin, Progress, Result, no_progress

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from savgs_ident.campaigns.study import CampaignStudy
    from savgs_ident.control.closed_loop.study import LoopStudy
    from savgs_ident.control.design import Design
    from savgs_ident.control.linear_study import LinearStudy
    from savgs_ident.core.values import Values
    from savgs_ident.diagnosis.result import Diagnosis
    from savgs_ident.export.public import Exported
    from savgs_ident.fit.comparison import Comparison
    from savgs_ident.fit.result import Fit
    from savgs_ident.inference.result import Posterior
    from savgs_ident.responses.summary import CampaignSummary
    from savgs_ident.simulate.frequency_response import SimulatedResponse, SimulatedSweep
    from savgs_ident.validation.blind import BlindStudy
    from savgs_ident.validation.calibration import CalibrationStudy
    from savgs_ident.validation.false_alarms import AlarmStudy

Shown = TypeVar("Shown", bound=Result)
Figures = Mapping[str, "Callable[[], Figure]"]


class _Presenter(Generic[Shown]):
    """What presenters have in common: the numbers are written first, then tables, pictures and the report."""

    stem: str
    """The name of the files without their endings."""

    def record(self, result: Shown) -> Mapping[str, Any]:
        raise NotImplementedError

    def text(self, result: Shown) -> RenderableType:
        raise NotImplementedError

    def doubts(self, result: Shown) -> tuple[str, ...]:
        raise NotImplementedError

    def page(self, result: Shown) -> str | None:
        del result
        return None

    def figures(self, result: Shown) -> Figures:
        del result
        return {}

    def write(self, result: Shown, folder: Path, progress: Progress) -> Iterator[Path]:
        """The files, each as soon as it is there."""
        yield write_json(folder / f"{self.stem}.json", self.record(result))
        yield from self.more(result, folder)
        progress("drawing")
        yield from self.draw(result, folder)
        page = self.page(result)
        if page is not None:
            progress("writing the report")
            yield write_bytes(folder / f"{self.stem}.html", page.encode())

    def more(self, result: Shown, folder: Path) -> Iterator[Path]:
        """Files besides record, pictures and report."""
        del result, folder
        yield from ()

    def draw(self, result: Shown, folder: Path) -> Iterator[Path]:
        """The pictures, a ``png`` and a ``pdf`` each."""
        from savgs_ident.report.theme import write_figure

        for name, figure in self.figures(result).items():
            yield from write_figure(folder, name, figure())


class _Identified(_Presenter[Shown]):
    """A model drawn against a measurement: smooth curves, for which it is solved between the dwells too."""

    def comparison(self, result: Shown) -> "Comparison":
        raise NotImplementedError

    def figures(self, result: Shown) -> Figures:
        return {"bode": lambda: comparison_figure(self.comparison(result))}

    def write(self, result: Shown, folder: Path, progress: Progress) -> Iterator[Path]:
        yield write_json(folder / f"{self.stem}.json", self.record(result))
        yield from self.more(result, folder)
        yield from draw_comparison(self.comparison(result), folder, progress)


def _is_quarter_car(model: object) -> bool:
    from savgs_ident.plants.quarter_car.model import RigModel

    return isinstance(model, RigModel)


class _Fit(_Identified["Fit"]):
    stem = "fit"

    def record(self, result: "Fit") -> Mapping[str, Any]:
        from savgs_ident.report.fit.record import fit_record

        return fit_record(result)

    def text(self, result: "Fit") -> RenderableType:
        from savgs_ident.report.fit.text import fit_text

        return fit_text(result)

    def doubts(self, result: "Fit") -> tuple[str, ...]:
        if result.trusted:
            return ()
        if not result.status.ok:
            return (f"{result.status.advice}.",)
        if not all(status.ok for status in result.dwell_status):
            return ("the model's periodic motion was not found in every dwell.",)
        return ("the data do not identify every free parameter.",)

    def comparison(self, result: "Fit") -> "Comparison":
        from savgs_ident.fit.comparison import comparison_of

        return comparison_of(result)

    def more(self, result: "Fit", folder: Path) -> Iterator[Path]:
        if not _is_quarter_car(result.estimated):
            return
        from savgs_ident.plants.quarter_car.rig import write_rig

        write_rig(result.model.rig, folder / "model.toml")
        yield folder / "model.toml"


class _Comparison(_Identified["Comparison"]):
    stem = "bode"

    def record(self, result: "Comparison") -> Mapping[str, Any]:
        from savgs_ident.report.fit.record import bode_record

        return bode_record(result)

    def text(self, result: "Comparison") -> RenderableType:
        from savgs_ident.report.fit.text import bode_text

        return bode_text(dict(self.record(result)))

    def doubts(self, result: "Comparison") -> tuple[str, ...]:
        return () if result.trusted else ("the model's periodic motion was not found in every dwell.",)

    def comparison(self, result: "Comparison") -> "Comparison":
        return result


def draw_comparison(comparison: "Comparison", folder: Path, progress: Progress) -> tuple[Path, ...]:
    """Write bode.png and bode.pdf of a model against a measurement."""
    figure = comparison_figure(comparison, progress)
    from savgs_ident.report.theme import write_figure

    return write_figure(folder, "bode", figure)


def comparison_figure(comparison: "Comparison", progress: Progress = no_progress) -> "Figure":
    """The Bode figure of a model against a measurement, with the model solved between the dwells."""
    progress("solving the model between the dwells")
    # Loading what draws takes as long as solving, which leaves Python free.
    with ThreadPoolExecutor(1) as pool:
        solving = pool.submit(comparison.between)
        from savgs_ident.fit.residuals import measured_points, whitened
        from savgs_ident.report.fit.bode import bode_figure
        from savgs_ident.report.text import channel_labels
    model, frictionless = solving.result()
    given, measured = comparison.given, comparison.measured
    curves = [model.curve("model as drawn" if given.is_drawing else "identified model")]
    if comparison.effects:
        curves.append(frictionless.curve("the same without effects"))
    progress("drawing")
    labels, driven = channel_labels(given), given.plant.inputs[0].name
    points = measured_points(measured, tuple(labels), driven)
    residuals = whitened(measured, tuple(labels), comparison.model.harmonics, comparison.used)
    title = f"Model and measurement: {Path(comparison.origin.data).name or given.plant_name}"
    return bode_figure(title, points, curves, residuals, tuple(labels.values()))


class _CampaignSummary(_Presenter["CampaignSummary"]):
    stem = "inspect"

    def record(self, result: "CampaignSummary") -> Mapping[str, Any]:
        from savgs_ident.report.campaigns.inspect import summary_record

        return summary_record(result)

    def text(self, result: "CampaignSummary") -> RenderableType:
        from savgs_ident.report.campaigns.inspect import campaign_text

        return campaign_text(dict(self.record(result)))

    def doubts(self, result: "CampaignSummary") -> tuple[str, ...]:
        del result
        return ()

    def figures(self, result: "CampaignSummary") -> Figures:
        from savgs_ident.report.campaigns.inspect import campaign_figure

        return {"inspect": lambda: campaign_figure(result)}


_UNSOLVED = "the simulation did not converge everywhere; see the status in the table."


class _SimulatedResponse(_Presenter["SimulatedResponse"]):
    stem = "simulate"

    def record(self, result: "SimulatedResponse") -> Mapping[str, Any]:
        from savgs_ident.report.model import response_record

        return response_record(result)

    def text(self, result: "SimulatedResponse") -> RenderableType:
        from savgs_ident.report.model import response_text

        return response_text(result)

    def doubts(self, result: "SimulatedResponse") -> tuple[str, ...]:
        return () if result.trusted else (_UNSOLVED,)

    def figures(self, result: "SimulatedResponse") -> Figures:
        from savgs_ident.report.fit.bode import response_figure
        from savgs_ident.report.text import channel_labels

        effects, labels = result.origin.effects, tuple(channel_labels(result.model).values())
        curve = result.curve("with " + ", ".join(effects) if effects else "without effects")
        return {"simulate": lambda: response_figure("Simulated response", [curve], labels)}

    def more(self, result: "SimulatedResponse", folder: Path) -> Iterator[Path]:
        from savgs_ident.report.model import response_columns

        yield write_table(folder / "simulate.csv", response_columns(result))


class _SimulatedSweep(_Presenter["SimulatedSweep"]):
    stem = "simulate"

    def record(self, result: "SimulatedSweep") -> Mapping[str, Any]:
        from savgs_ident.report.model import sweep_record

        return sweep_record(result)

    def text(self, result: "SimulatedSweep") -> RenderableType:
        from savgs_ident.report.model import sweep_text

        return sweep_text(result)

    def doubts(self, result: "SimulatedSweep") -> tuple[str, ...]:
        return () if result.trusted else (_UNSOLVED,)

    def figures(self, result: "SimulatedSweep") -> Figures:
        from savgs_ident.report.model import sweep_figure

        return {"simulate": lambda: sweep_figure(result)}

    def more(self, result: "SimulatedSweep", folder: Path) -> Iterator[Path]:
        from savgs_ident.report.model import sweep_columns

        yield write_table(folder / "simulate.csv", sweep_columns(result))


class _Posterior(_Presenter["Posterior"]):
    stem = "posterior"
    packages = ("jax", "emcee", "blackjax", "arviz-stats", "numpy", "scipy")
    """Whose version matters to a chain."""

    def record(self, result: "Posterior") -> Mapping[str, Any]:
        from savgs_ident.report.posterior.page import posterior_record

        return posterior_record(result, result.origin.with_versions(self.packages))

    def text(self, result: "Posterior") -> RenderableType:
        from savgs_ident.report.posterior.text import posterior_text

        return posterior_text(result)

    def doubts(self, result: "Posterior") -> tuple[str, ...]:
        return () if result.trusted else (f"{'; '.join(result.convergence.reasons)}.",)

    def page(self, result: "Posterior") -> str | None:
        from savgs_ident.report.posterior.page import posterior_html

        return posterior_html(result, result.origin.with_versions(self.packages))

    def figures(self, result: "Posterior") -> Figures:
        from savgs_ident.report.posterior.bode import predictive_figure
        from savgs_ident.report.posterior.figures import corner_figure, profile_figure, trace_figure

        identified = result.of_role("identified")
        return {
            "corner": lambda: corner_figure(result),
            **{f"trace {each.name}": partial(trace_figure, result, each) for each in identified},
            **{
                f"profile {each.name}": partial(profile_figure, result, each, each.profile)
                for each in identified
                if each.profile is not None
            },
            **{
                f"predicted {each.name}": partial(predictive_figure, result, c)
                for c, each in enumerate(result.model.channels)
            },
        }

    def write(self, result: "Posterior", folder: Path, progress: Progress) -> Iterator[Path]:
        from savgs_ident.inference.draws import write_inference_data

        progress("writing")
        yield write_inference_data(result, folder / "posterior.nc")
        yield write_json(folder / "posterior.json", self.record(result))
        page = self.page(result)
        if page is not None:
            yield write_bytes(folder / "posterior.html", page.encode())


class _Diagnosis(_Presenter["Diagnosis"]):
    stem = "diagnosis"
    packages = ("jax", "numpy", "scipy")
    """Whose version matters to a diagnosis."""

    def record(self, result: "Diagnosis") -> Mapping[str, Any]:
        from savgs_ident.report.diagnosis.record import diagnosis_record

        return diagnosis_record(result, result.origin.with_versions(self.packages))

    def text(self, result: "Diagnosis") -> RenderableType:
        from savgs_ident.report.diagnosis.text import diagnosis_text

        return diagnosis_text(result)

    def doubts(self, result: "Diagnosis") -> tuple[str, ...]:
        return () if result.trusted else result.warnings

    def page(self, result: "Diagnosis") -> str | None:
        from savgs_ident.report.diagnosis.page import diagnosis_html

        return diagnosis_html(result, result.origin.with_versions(self.packages))

    def figures(self, result: "Diagnosis") -> Figures:
        from savgs_ident.report.diagnosis.bode import diagnosis_bode_figure
        from savgs_ident.report.diagnosis.drawing import rig_figure
        from savgs_ident.report.diagnosis.drive import drive_figure
        from savgs_ident.report.diagnosis.figures import force_figure, gap_map_figure, shrink_figure

        shrink: Figures = {"shrink": lambda: shrink_figure(result)}
        loops: Figures = {
            f"force {number}": partial(force_figure, result, loop) for number, loop in enumerate(result.loops)
        }
        if result.measured is None:
            return {"drive": lambda: drive_figure(result), **shrink, **loops}
        names = [each.name for each in result.given.channels]
        drawing: Figures = {"ports": lambda: rig_figure(result)} if _is_quarter_car(result.given) else {}
        return {
            **{f"gap {name}": partial(gap_map_figure, result, name) for name in names},
            **drawing,
            **shrink,
            **{f"bode {name}": partial(diagnosis_bode_figure, result, c) for c, name in enumerate(names)},
            **loops,
        }

    def write(self, result: "Diagnosis", folder: Path, progress: Progress) -> Iterator[Path]:
        progress("writing")
        page = self.page(result)
        yield write_json(folder / "diagnosis.json", self.record(result))
        if page is not None:
            yield write_bytes(folder / "diagnosis.html", page.encode())


_CONTROL_PACKAGES = ("jax", "numpy", "scipy", "control", "slycot")
"""Whose version matters to linear models and controllers."""


def _control_origin(result: Result) -> Origin:
    return result.origin.with_versions(_CONTROL_PACKAGES)


class _LinearStudy(_Presenter["LinearStudy"]):
    stem = "linearise"

    def record(self, result: "LinearStudy") -> Mapping[str, Any]:
        from savgs_ident.report.control.linear_text import linear_record

        return linear_record(result, _control_origin(result))

    def text(self, result: "LinearStudy") -> RenderableType:
        from savgs_ident.report.control.linear_text import linear_text

        return linear_text(self.record(result))

    def doubts(self, result: "LinearStudy") -> tuple[str, ...]:
        from savgs_ident.report.control.linear_text import alarm

        return () if result.trusted else (alarm(result),)

    def page(self, result: "LinearStudy") -> str:
        from savgs_ident.report.control.linear_page import linear_html

        return linear_html(result, _control_origin(result))

    def figures(self, result: "LinearStudy") -> Figures:
        from savgs_ident.report.control.linear_figures import alpha_figure, described_figure, responses_figure

        figures: dict[str, Callable[[], Figure]] = {
            "alpha": lambda: alpha_figure(result.equivalents),
            "responses": lambda: responses_figure(result.small),
        }
        test = result.at_test
        return figures if test is None else figures | {"described": lambda: described_figure(test)}


class _Design(_Presenter["Design"]):
    stem = "design"

    def record(self, result: "Design") -> Mapping[str, Any]:
        from savgs_ident.report.control.design_text import design_record

        return design_record(result, _control_origin(result))

    def text(self, result: "Design") -> RenderableType:
        from savgs_ident.report.control.design_text import design_text

        return design_text(self.record(result))

    def doubts(self, result: "Design") -> tuple[str, ...]:
        from savgs_ident.report.control.design_text import alarm

        return () if result.trusted else (alarm(result),)

    def page(self, result: "Design") -> str:
        from savgs_ident.report.control.design_page import design_html

        return design_html(result, _control_origin(result))

    def figures(self, result: "Design") -> Figures:
        from savgs_ident.report.control import design_figures

        return {
            "gamma": lambda: design_figures.gamma_figure(result),
            "loop": lambda: design_figures.sensitivity_figure(result),
            "ride": lambda: design_figures.ride_figure(result),
            "robustness": lambda: design_figures.robustness_figure(result),
            "regularisation": lambda: design_figures.regularisation_figure(result),
        }

    def write(self, result: "Design", folder: Path, progress: Progress) -> Iterator[Path]:
        from savgs_ident.control.design import controller_record

        yield write_json(folder / "controller.json", controller_record(result.digital))
        yield from super().write(result, folder, progress)


class _LoopStudy(_Presenter["LoopStudy"]):
    stem = "closed-loop"

    def record(self, result: "LoopStudy") -> Mapping[str, Any]:
        from savgs_ident.report.control.loop_text import loop_record

        return loop_record(result, _control_origin(result), result.controller)

    def text(self, result: "LoopStudy") -> RenderableType:
        from savgs_ident.report.control.loop_text import loop_text

        return loop_text(result)

    def doubts(self, result: "LoopStudy") -> tuple[str, ...]:
        from savgs_ident.report.control.loop_text import alarm

        return () if result.trusted else (alarm(result),)

    def page(self, result: "LoopStudy") -> str:
        from savgs_ident.report.control.loop_page import loop_html

        return loop_html(result, _values(result), _control_origin(result), result.controller)

    def figures(self, result: "LoopStudy") -> Figures:
        from savgs_ident.report.control import loop_figures

        figures: dict[str, Callable[[], Figure]] = {
            "closed-loop": lambda: loop_figures.loop_signals_figure(result, _values(result)),
            "failures": lambda: loop_figures.failures_figure(result),
        }
        if result.on_rigs:
            figures["rigs"] = lambda: loop_figures.rigs_figure(result)
        if result.causes:
            figures["causes"] = lambda: loop_figures.causes_figure(result)
        return figures

    def more(self, result: "LoopStudy", folder: Path) -> Iterator[Path]:
        from savgs_ident.report.control.loop_text import loop_columns

        yield write_table(folder / "closed-loop.csv", loop_columns(result))


def _values(study: "LoopStudy") -> "Values":
    """The parameters of the model that was run."""
    from savgs_ident.core.values import as_values

    return as_values(study.model.table.as_dict() if study.model else {})


class _Exported(_Presenter["Exported"]):
    stem = "export"

    def record(self, result: "Exported") -> Mapping[str, Any]:
        from savgs_ident.report.model import export_record

        return export_record(result.gathered, result.written, _control_origin(result))

    def text(self, result: "Exported") -> RenderableType:
        from savgs_ident.report.model import export_text

        return export_text(self.record(result))

    def doubts(self, result: "Exported") -> tuple[str, ...]:
        doubts: tuple[str, ...] = result.gathered.doubts
        return doubts

    def write(self, result: "Exported", folder: Path, progress: Progress) -> Iterator[Path]:
        del progress
        yield write_json(folder / "export.json", self.record(result))


class _CampaignStudy(_Presenter["CampaignStudy"]):
    stem = "campaign"

    def record(self, result: "CampaignStudy") -> Mapping[str, Any]:
        from savgs_ident.report.campaigns.record import campaigns_record

        return campaigns_record(result, result.settings, result.origin.command)

    def text(self, result: "CampaignStudy") -> RenderableType:
        from savgs_ident.report.campaigns.record import campaigns_text

        return campaigns_text(result)

    def doubts(self, result: "CampaignStudy") -> tuple[str, ...]:
        from savgs_ident.report.campaigns.record import alarm

        found = alarm(result)
        return (found,) if found else ()

    def page(self, result: "CampaignStudy") -> str:
        from savgs_ident.report.campaigns.page import campaigns_html

        return campaigns_html(result, result.settings, result.origin.command)

    def figures(self, result: "CampaignStudy") -> Figures:
        from savgs_ident.report.campaigns.figures import campaigns_figure

        return {"campaign": lambda: campaigns_figure(result)} if result.units else {}

    def more(self, result: "CampaignStudy", folder: Path) -> Iterator[Path]:
        from savgs_ident.report.campaigns.page import write_campaigns
        from savgs_ident.report.campaigns.record import campaigns_columns

        yield from write_campaigns(folder, campaigns_columns(result))


class _BlindStudy(_Presenter["BlindStudy"]):
    stem = "blind"

    def record(self, result: "BlindStudy") -> Mapping[str, Any]:
        from savgs_ident.report.validation.blind import blind_record

        return blind_record(result.scores, result.settings, result.origin.command)

    def text(self, result: "BlindStudy") -> RenderableType:
        from savgs_ident.report.validation.blind import blind_text

        return blind_text(result.scores)

    def doubts(self, result: "BlindStudy") -> tuple[str, ...]:
        return () if result.trusted else ("the diagnosis is not right as often as it should be.",)

    def page(self, result: "BlindStudy") -> str:
        from savgs_ident.report.validation.blind import blind_html

        return blind_html(result.scores, result.settings, result.origin.command)

    def figures(self, result: "BlindStudy") -> Figures:
        from savgs_ident.report.validation.blind import confusion_figure

        return {"confusion": lambda: confusion_figure(result.scores)}


class _AlarmStudy(_Presenter["AlarmStudy"]):
    stem = "false_alarms"

    def record(self, result: "AlarmStudy") -> Mapping[str, Any]:
        from savgs_ident.report.validation.calibration import alarms_record

        return alarms_record(result.draws, result.odds, result.origin.command)

    def text(self, result: "AlarmStudy") -> RenderableType:
        from savgs_ident.report.text import plain
        from savgs_ident.report.validation.calibration import alarms_text

        return plain(alarms_text(self.record(result)))

    def doubts(self, result: "AlarmStudy") -> tuple[str, ...]:
        if self.record(result)["few_enough"]:
            return ()
        return ("there are more false alarms than there may be.",)

    def figures(self, result: "AlarmStudy") -> Figures:
        from savgs_ident.report.validation.calibration import alarms_figure

        return {"false_alarms": lambda: alarms_figure(result.draws, result.odds)}


class _CalibrationStudy(_Presenter["CalibrationStudy"]):
    stem = "calibration"

    def record(self, result: "CalibrationStudy") -> Mapping[str, Any]:
        from savgs_ident.report.validation.calibration import calibration_record

        return calibration_record(result.trials, result.names, result.origin.command)

    def text(self, result: "CalibrationStudy") -> RenderableType:
        from savgs_ident.report.validation.calibration import calibration_text

        return calibration_text(self.record(result))

    def doubts(self, result: "CalibrationStudy") -> tuple[str, ...]:
        if self.record(result)["calibrated"]:
            return ()
        return ("coverage or ranks are not what they should be.",)

    def figures(self, result: "CalibrationStudy") -> Figures:
        from savgs_ident.report.validation.calibration import calibration_figure

        return {"calibration": lambda: calibration_figure(result.trials, result.names)}


CAMPAIGN_SUMMARY = _CampaignSummary()
CAMPAIGN_STUDY = _CampaignStudy()
BLIND_STUDY = _BlindStudy()
ALARM_STUDY = _AlarmStudy()
CALIBRATION_STUDY = _CalibrationStudy()
FIT = _Fit()
COMPARISON = _Comparison()
SIMULATED_RESPONSE = _SimulatedResponse()
SIMULATED_SWEEP = _SimulatedSweep()
POSTERIOR = _Posterior()
DIAGNOSIS = _Diagnosis()
LINEAR_STUDY = _LinearStudy()
DESIGN = _Design()
LOOP_STUDY = _LoopStudy()
EXPORTED = _Exported()
