"""The presenter of a posterior; what draws is loaded when something is drawn."""

from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import RenderableType

from savgs_ident.core.files import write_bytes
from savgs_ident.core.output import write_json
from savgs_ident.core.presentation import Progress
from savgs_ident.report.presenters import AbstractPresenter, Figures

if TYPE_CHECKING:
    from savgs_ident.inference.result import Posterior


class _Posterior(AbstractPresenter["Posterior"]):
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


POSTERIOR = _Posterior()
