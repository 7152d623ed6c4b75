"""Pictures within pages: drawings that look the same wherever they are opened, and that execute nothing."""

import base64
import re
from dataclasses import replace
from pathlib import Path

from savgs_ident.diagnosis.result import Diagnosis
from savgs_ident.report.diagnosis.page import diagnosis_html
from savgs_ident.report.posterior.page import posterior_html

from .diagnosis_reading import ORIGIN
from .page_reader import Reader
from .posterior_synthetic import nominal_response, synthetic_posterior


def _drawings(page: str) -> list[str]:
    sources = [attributes["src"] or "" for tag, attributes in Reader(page).tags if tag == "img"]
    return [base64.b64decode(each.removeprefix("data:image/svg+xml;base64,")).decode() for each in sources]


def _harmless(drawing: str) -> bool:
    active = re.search(r"<script|\son\w+=|javascript:|<foreignObject", drawing, re.IGNORECASE)
    return "<svg" in drawing and not active and not re.search(r'href="(?!#|data:image/png)', drawing)


def test_those_of_a_diagnosis_are_many_and_the_same_each_time(diagnosis: Diagnosis) -> None:
    shown = replace(diagnosis, loops=diagnosis.loops[:1])
    page = diagnosis_html(shown, ORIGIN)
    drawings = _drawings(page)
    # The rig, two of the response, a loop, the gaps, two maps, the regimes.
    assert len(drawings) == 8
    assert all(map(_harmless, drawings))
    assert page == diagnosis_html(shown, ORIGIN)


def test_those_of_a_posterior(nominal_campaign: Path) -> None:
    posterior = synthetic_posterior(nominal_response(nominal_campaign), length=400)
    drawings = _drawings(posterior_html(posterior, ORIGIN))
    assert len(drawings) == 13
    assert all(map(_harmless, drawings))
