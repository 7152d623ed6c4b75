"""The presenters of what one campaign says: summary, fit, comparison, posterior, diagnosis.

What draws is loaded when something is drawn.
"""

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from rich.console import RenderableType

from savgs_ident.core.files import write_bytes, write_json
from savgs_ident.core.presentation import Progress, no_progress
from savgs_ident.report.presenters import AbstractPresenter, Figures, Shown
from savgs_ident.responses.selection import by_kind

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from savgs_ident.diagnosis.result import Diagnosis
    from savgs_ident.fit.along_motion import MotionComparison, MotionFit
    from savgs_ident.fit.identified import Identified
    from savgs_ident.fit.public import Comparison
    from savgs_ident.fit.result import Fit
    from savgs_ident.inference.result import HarmonicPosterior, MotionPosterior, Posterior
    from savgs_ident.responses.summary import CampaignSummary


class _CampaignSummary(AbstractPresenter["CampaignSummary"]):
    stem = "inspect"

    def record(self, result: "CampaignSummary") -> Mapping[str, Any]:
        from savgs_ident.report.campaigns.inspect import summary_record

        return summary_record(result)

    def text(self, result: "CampaignSummary") -> RenderableType:
        from savgs_ident.report.campaigns.inspect import campaign_text

        return campaign_text(dict(self.record(result)), result.campaign.layout)

    def doubts(self, result: "CampaignSummary") -> tuple[str, ...]:
        del result
        return ()

    def figures(self, result: "CampaignSummary") -> Figures:
        from savgs_ident.report.campaigns.inspect import campaign_figure
        from savgs_ident.report.campaigns.motions import motions_figure, moving_tests

        responses: Figures = {"inspect": lambda: campaign_figure(result)}
        motions: Figures = {"motions": lambda: motions_figure(result.campaign)}
        tests = moving_tests(result.campaign)
        if tests and result.response is None and not result.sweeps:
            return motions
        # A sweep is drawn among the responses.
        return {**responses, **motions} if any(each.kind != "sweep" for each in tests) else responses


CAMPAIGN_SUMMARY = _CampaignSummary()


class _Identified(AbstractPresenter[Shown]):
    """A model drawn against a measurement: smooth curves, for which it is solved between the dwells too."""

    @abstractmethod
    def comparison(self, result: Shown) -> "Comparison":
        """The model against the measurement."""

    def figures(self, result: Shown) -> Figures:
        return comparison_figures(self.comparison(result))

    def write(self, result: Shown, folder: Path, progress: Progress) -> Iterator[Path]:
        yield write_json(folder / f"{self.stem}.json", self.record(result))
        yield from self.more(result, folder)
        yield from draw_comparison(self.comparison(result), folder, progress)


def doubts_of(fit: "Identified") -> tuple[str, ...]:
    """Why a fit is not to be trusted, in a sentence that says what to do next; nothing if it is."""
    from savgs_ident.inference.result import UNEXPLAINED

    if not fit.doubt:
        return ()
    remedy = ": look for what is missing with `diagnose`" if fit.doubt == UNEXPLAINED else ""
    return (f"{fit.doubt}{remedy}.",)


class _Fit(_Identified["Fit"]):
    stem = "fit"

    def record(self, result: "Fit") -> Mapping[str, Any]:
        from savgs_ident.report.fit import fit_record

        return fit_record(result)

    def text(self, result: "Fit") -> RenderableType:
        from savgs_ident.report.fit import fit_text

        return fit_text(result)

    def doubts(self, result: "Fit") -> tuple[str, ...]:
        return doubts_of(result)

    def comparison(self, result: "Fit") -> "Comparison":
        from savgs_ident.fit.public import comparison_of

        return comparison_of(result)

    def more(self, result: "Fit", folder: Path) -> Iterator[Path]:
        from savgs_ident.report.by_plant import report_of

        yield from report_of(result.estimated).write_model(result, folder)


class _MotionFit(AbstractPresenter["MotionFit"]):
    stem = "fit"

    def record(self, result: "MotionFit") -> Mapping[str, Any]:
        from savgs_ident.report.motion_fit import motion_fit_record

        return motion_fit_record(result)

    def text(self, result: "MotionFit") -> RenderableType:
        from savgs_ident.report.motion_fit import motion_fit_text

        return motion_fit_text(result)

    def doubts(self, result: "MotionFit") -> tuple[str, ...]:
        return doubts_of(result)

    def figures(self, result: "MotionFit") -> Figures:
        from savgs_ident.report.motion_fit import force_figure

        return {"drive": lambda: force_figure(result)}

    def more(self, result: "MotionFit", folder: Path) -> Iterator[Path]:
        from savgs_ident.report.by_plant import report_of

        yield from report_of(result.estimated).write_model(result, folder)


class _Comparison(_Identified["Comparison"]):
    stem = "bode"

    def record(self, result: "Comparison") -> Mapping[str, Any]:
        from savgs_ident.report.comparison import bode_record

        return bode_record(result)

    def text(self, result: "Comparison") -> RenderableType:
        from savgs_ident.report.comparison import bode_text

        return bode_text(result)

    def doubts(self, result: "Comparison") -> tuple[str, ...]:
        return () if result.trusted else ("the model's periodic motion was not found in every dwell.",)

    def comparison(self, result: "Comparison") -> "Comparison":
        return result


def draw_comparison(comparison: "Comparison", folder: Path, progress: Progress) -> tuple[Path, ...]:
    """Write the figures of a model against a measurement as PNG and PDF, and return their paths."""
    drawn = {name: draw() for name, draw in comparison_figures(comparison, progress).items()}
    from savgs_ident.report.theme import write_figure

    return tuple(path for name, figure in drawn.items() for path in write_figure(folder, name, figure))


def comparison_figures(comparison: "Comparison", progress: Progress = no_progress) -> Figures:
    """The figures of a model against a measurement: ``bode`` of the dwells, ``spectra`` of the windows."""
    title = f"Model and measurement: {Path(comparison.origin.data).name or comparison.given.plant_name}"
    dwells, windows = by_kind(comparison)
    of_dwells: Figures = {} if dwells is None else {"bode": partial(_bode_figure, title, dwells, progress)}
    if windows is None:
        return of_dwells
    return {**of_dwells, "spectra": partial(_spectra_figure, title, windows, progress)}


def _spectra_figure(title: str, comparison: "Comparison", progress: Progress) -> "Figure":
    progress("drawing")
    from savgs_ident.report.spectra import spectra_figure

    return spectra_figure(title, comparison)


def _bode_figure(title: str, comparison: "Comparison", progress: Progress) -> "Figure":
    """The Bode figure of dwells, with the model solved between them."""
    progress("solving the model between the dwells")
    # Loading what draws takes as long as solving, which leaves Python free.
    with ThreadPoolExecutor(1) as pool:
        solving = pool.submit(comparison.between)
        from savgs_ident.fit.result import measured_points, whitened
        from savgs_ident.report.bode import bode_figure
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
    return bode_figure(title, points, curves, residuals, tuple(labels.values()))


class _MotionComparison(AbstractPresenter["MotionComparison"]):
    stem = "bode"

    def record(self, result: "MotionComparison") -> Mapping[str, Any]:
        from savgs_ident.report.motion_fit import motion_comparison_record

        return motion_comparison_record(result)

    def text(self, result: "MotionComparison") -> RenderableType:
        from savgs_ident.report.motion_fit import motion_comparison_text

        return motion_comparison_text(result)

    def doubts(self, result: "MotionComparison") -> tuple[str, ...]:
        return () if result.trusted else (f"{result.status.advice}.",)

    def figures(self, result: "MotionComparison") -> Figures:
        from savgs_ident.report.motion_fit import compared_force_figure

        return {"drive": lambda: compared_force_figure(result)}


FIT = _Fit()
MOTION_FIT = _MotionFit()
COMPARISON = _Comparison()
MOTION_COMPARISON = _MotionComparison()


AnyPosterior = TypeVar("AnyPosterior", bound="Posterior")


class _AnyPosterior(AbstractPresenter[AnyPosterior]):
    """A posterior, whatever the model was held against."""

    stem = "posterior"
    packages = ("jax", "emcee", "blackjax", "arviz-stats", "numpy", "scipy")
    """Whose version matters to a chain."""

    @abstractmethod
    def predictions(self, result: AnyPosterior) -> Figures:
        """What it predicts."""

    def record(self, result: AnyPosterior) -> Mapping[str, Any]:
        from savgs_ident.report.posterior.record import posterior_record

        return posterior_record(result, result.origin.with_versions(self.packages))

    def text(self, result: AnyPosterior) -> RenderableType:
        from savgs_ident.report.posterior.text import posterior_text

        return posterior_text(result)

    def doubts(self, result: AnyPosterior) -> tuple[str, ...]:
        return () if result.trusted else (f"{'; '.join(result.reasons)}.",)

    def page(self, result: AnyPosterior) -> str | None:
        from savgs_ident.report.posterior.page import posterior_html

        return posterior_html(result, result.origin.with_versions(self.packages))

    def figures(self, result: AnyPosterior) -> Figures:
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
            **self.predictions(result),
        }

    def write(self, result: AnyPosterior, folder: Path, progress: Progress) -> Iterator[Path]:
        from savgs_ident.inference.inference_data import write_inference_data

        progress("writing")
        yield write_inference_data(result, folder / "posterior.nc")
        yield write_json(folder / "posterior.json", self.record(result))
        page = self.page(result)
        if page is not None:
            yield write_bytes(folder / "posterior.html", page.encode())


class _Posterior(_AnyPosterior["HarmonicPosterior"]):
    def predictions(self, result: "HarmonicPosterior") -> Figures:
        from savgs_ident.report.bode import predictive_figure
        from savgs_ident.report.spectra import predicted_spectrum_figure

        dwells, windows = by_kind(result)
        channels = [each.name for each in result.model.channels]
        return {
            **{
                f"predicted {name}": partial(predictive_figure, dwells, c)
                for c, name in enumerate(channels)
                if dwells is not None
            },
            **{
                f"predicted spectrum {name}": partial(predicted_spectrum_figure, windows, c)
                for c, name in enumerate(channels)
                if windows is not None and windows.predictive.used[:, c].any()
            },
        }


class _MotionPosterior(_AnyPosterior["MotionPosterior"]):
    def predictions(self, result: "MotionPosterior") -> Figures:
        from savgs_ident.report.posterior.predicted import predicted_force_figure

        return {"predicted force": lambda: predicted_force_figure(result)}


POSTERIOR = _Posterior()
MOTION_POSTERIOR = _MotionPosterior()


class _Diagnosis(AbstractPresenter["Diagnosis"]):
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
        from savgs_ident.report.by_plant import report_of
        from savgs_ident.report.diagnosis.compared import diagnosis_bode_figure, drive_figure_of
        from savgs_ident.report.diagnosis.figures import (
            gap_map_figure,
            regime_figure,
            shrink_figure,
        )
        from savgs_ident.report.diagnosis.loop_figures import force_figure

        shrink: Figures = {"shrink": lambda: shrink_figure(result)}
        if result.regimes:
            shrink = {**shrink, "regimes": lambda: regime_figure(result)}
        loops: Figures = {
            f"force {number}": partial(force_figure, result, loop) for number, loop in enumerate(result.loops)
        }
        if result.measured is None:
            return {"drive": lambda: drive_figure_of(result), **shrink, **loops}
        dwells, windows = by_kind(result)
        names = [each.name for each in result.given.channels]
        if windows is not None:
            from savgs_ident.report.diagnosis.gap_spectra import channels_in_windows, gap_spectrum_figure

            spectra = {
                f"gap spectrum {names[c]}": partial(gap_spectrum_figure, windows, c)
                for c in channels_in_windows(windows)
            }
            shrink = {**spectra, **shrink}
        if dwells is None:
            return {**shrink, **loops}
        return {
            **{f"gap {name}": partial(gap_map_figure, result, name) for name in names},
            "ports": partial(report_of(result.given).ports_figure, result),
            **shrink,
            **{f"bode {name}": partial(diagnosis_bode_figure, dwells, c) for c, name in enumerate(names)},
            **loops,
        }

    def write(self, result: "Diagnosis", folder: Path, progress: Progress) -> Iterator[Path]:
        progress("writing")
        page = self.page(result)
        yield write_json(folder / "diagnosis.json", self.record(result))
        if page is not None:
            yield write_bytes(folder / "diagnosis.html", page.encode())


DIAGNOSIS = _Diagnosis()
