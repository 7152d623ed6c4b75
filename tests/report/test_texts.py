"""Tables and records say the numbers of the fit, and names in them are never read as markup."""

import io
import json
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from rich.console import Console, RenderableType

from savgs_ident.core.errors import DataWarning
from savgs_ident.core.files import to_json
from savgs_ident.core.presentation import Origin
from savgs_ident.core.status import Status
from savgs_ident.fit.identified import Verdict
from savgs_ident.fit.result import Fit, chi2_by_dwell
from savgs_ident.plants.quarter_car.rig import read_rig, write_rig
from savgs_ident.plants.quarter_car.rig_recordings import RIG_LAYOUT, load_campaign
from savgs_ident.report.campaigns.inspect import campaign_text, summary_record
from savgs_ident.report.fit import fit_record, fit_text, value_with_error
from savgs_ident.report.text import plain
from savgs_ident.responses.summary import inspect

pytestmark = pytest.mark.usefixtures("undrawn")

HOSTILE = "[bold red]run[/bold red][link=http://x]\x1b[2J:smile:"


def rendered(what: RenderableType, width: int = 100) -> str:
    stream = io.StringIO()
    Console(file=stream, width=width, force_terminal=True, color_system="truecolor").print(what)
    return stream.getvalue()


def as_json(record: Mapping[str, object]) -> dict[str, Any]:
    return dict(json.loads(to_json(record)))


def test_a_value_has_the_digits_of_its_error() -> None:
    for value, error, text in (
        (0.030018, 0.00012, "0.03002 ± 0.00012"),
        (5386.23, 9.7, "5386.2 ± 9.7"),
        (264123.0, 1300.0, "264123 ± 1300"),
        (1.5, 0.0, "1.5"),
        (-0.25, 0.031, "-0.250 ± 0.031"),
        (2.0, float("nan"), "2"),
        (0.2512, float("inf"), "0.251, not identified"),
    ):
        assert value_with_error(value, error) == text


@given(st.floats(-1e9, 1e9), st.floats(1e-9, 1e9))
def test_a_printed_value_is_right_to_a_tenth_of_its_error(value: float, error: float) -> None:
    shown = float(value_with_error(value, error).split(" ± ")[0])
    assert abs(shown - value) <= max(0.1 * error, 0.5e-12 + 1e-15 * abs(value), 0.5 if error >= 10.0 else 0.0)


def test_the_text_of_a_fit_says_parameters_quality_and_verdict(fit: Fit) -> None:
    text = rendered(fit_text(fit))
    for part in (
        "mu_r",
        "0.03002 ± 0.00012",
        "5386.0 ± 9.7",
        "N s/m",
        "163.0/158 = 1.032",
        "0.40",
    ):
        assert part in text
    assert "Strongest correlation: mu_r with c_sd, -0.50" in text
    assert "The data identify all free parameters." in text
    assert re.search(r"k_t .*-0\.8", text), "a tolerance parameter stands with its shift"
    assert text.index("mu_r") < text.index("chi2/dof") < text.index("Verdict")


def test_dwells_that_were_not_solved_are_named(fit: Fit) -> None:
    status = (Status.CONVERGED,) * 7 + (Status.STALLED,)
    text = rendered(fit_text(replace(fit, dwell_status=status)))
    assert "dwell_6.00Hz" in text
    assert "stalled" in text
    assert "was not found in: dwell_6.00Hz" in text.replace("\n", " ")


def test_the_text_of_a_fit_shows_the_warnings_about_the_data(fit: Fit) -> None:
    assert "Warnings about the data" not in rendered(replace(fit, origin=Origin()).rendered())
    tests = [
        DataWarning("outlying_samples", "9 of 800 samples", "a.csv", f"dwell_{i}Hz", "accel")
        for i in (1, 2, 3)
    ]
    other = DataWarning("clipped_sensor", "stands at its end", "a.csv", "dwell_2Hz", "road")
    text = " ".join(rendered(replace(fit, origin=Origin(warnings=(*tests, other))).rendered()).split())
    assert text.index("Verdict") < text.index("Warnings about the data")
    assert "[outlying_samples] a.csv, test 'dwell_1Hz', channel 'accel'" in text
    assert "(2 more of this kind in this channel)" in text
    assert "dwell_3Hz" not in text
    assert "[clipped_sensor]" in text


@pytest.mark.parametrize(
    ("factor", "unit", "said"),
    [
        (1.0 / 9.80665, "1", "tolerances off: as if g was taken for m/s^2"),
        (1.0 / 9.80665, "N/m", "tolerances off: look at the units and signs of the channels"),
        (1000.0, "N/m", "as if a unit was taken for another one a thousand times as large"),
        (1.7, "1", "tolerances off: look at the units and signs of the channels"),
    ],
)
def test_a_fit_with_a_number_far_off_its_sheet_is_not_trusted(
    fit: Fit, factor: float, unit: str, said: str
) -> None:
    """The reason leads, also where so far a number explains the data; four tolerances are believed.

    A gain shows the unit of what it multiplies, a stiffness does not.
    """
    (place,) = [k for k, each in enumerate(fit.estimates) if each.name == "k_t"]
    known = replace(fit.estimates[place], unit=unit)

    def with_value(value: float) -> Fit:
        moved = (*fit.estimates[:place], replace(known, value=value), *fit.estimates[place + 1 :])
        return replace(fit, estimates=moved)

    near, far = with_value(known.prior + 4.0 * known.prior_sd), with_value(factor * known.prior)
    assert (near.far_off, near.trusted) == ((), fit.trusted)
    assert [each.name for each in far.far_off] == ["k_t"]
    assert not far.trusted
    assert far.doubts[0].startswith("k_t would have to be ")
    assert said in far.doubts[0]
    assert far.model.provenance["trusted"] is False


def test_the_record_of_a_fit_has_the_keys_of_the_contract(fit: Fit) -> None:
    record = as_json(fit_record(fit))
    assert {"parameters", "correlation", "chi2", "dof", "converged", "gap", "dwells"} <= set(record)
    assert record["parameters"]["c_sd"]["value"] == 5386.0
    assert record["parameters"]["c_sd"]["unit"] == "N s/m"
    assert record["parameters"]["k_t"]["free"] is False
    assert record["correlation"]["mu_r"]["c_sd"] == pytest.approx(-0.5)
    assert record["converged"] is True
    assert [dwell["test"] for dwell in record["dwells"]] == list(fit.measured.tests)
    assert_allclose([dwell["chi2"] for dwell in record["dwells"]], chi2_by_dwell(fit))
    assert record["gap"]["together"]["before"] > record["gap"]["together"]["after"]


def test_residuals_in_the_record_sum_to_chi2(fit: Fit) -> None:
    for dwell in as_json(fit_record(fit))["dwells"]:
        parts = [channel["residual_sigma"] for channel in dwell["channels"].values()]
        total = sum(np.sum(np.square(part["re"])) + np.sum(np.square(part["im"])) for part in parts)
        assert total == pytest.approx(dwell["chi2"])


def test_a_dwell_that_was_not_solved_is_not_converged(fit: Fit) -> None:
    status = (Status.MAX_ITERATIONS,) + (Status.CONVERGED,) * 7
    record = fit_record(replace(fit, dwell_status=status))
    assert record["converged"] is False
    assert record["trusted"] is False


def test_data_that_identify_too_little_are_converged_but_not_trusted(fit: Fit) -> None:
    blind = Verdict(False, ("mu_t and ydot_Hth cannot be distinguished.",), (("mu_t", "ydot_Hth"),))
    origin = Origin(warnings=(DataWarning("odd", "something is odd"),))
    record = as_json(fit_record(replace(fit, verdict=blind, origin=origin)))
    assert record["converged"] is True
    assert record["trusted"] is False
    assert record["verdict"]["confounded"] == [["mu_t", "ydot_Hth"]]
    assert record["warnings"][0]["code"] == "odd"


def test_an_identified_rig_is_read_back_with_where_it_comes_from(fit: Fit, tmp_path: Path) -> None:
    origin = Origin(("savgs-ident", "fit", "runs/a [b].csv"), "runs/a [b].csv", "0" * 64)
    write_rig(replace(fit, origin=origin).model.rig, tmp_path / "model.toml")
    back = read_rig(tmp_path / "model.toml")
    assert back.parameters["c_sd"].value == 5386.0
    assert back.provenance["data_sha256"] == "0" * 64
    assert back.provenance["free"] == ["mu_r", "c_sd"]
    covariance = back.provenance["covariance"]
    assert isinstance(covariance, dict)
    assert covariance["names"] == ["mu_r", "c_sd", "k_t"]
    assert_allclose(covariance["matrix"], fit.covariance, rtol=0.0)


@given(st.text())
def test_no_text_carries_control_characters(text: str) -> None:
    assert all(char.isprintable() or char == "\n" for char in str(plain(text)))
    assert str(plain(HOSTILE)) == HOSTILE.replace("\x1b", "\\x1b")


def test_hostile_test_names_in_a_campaign_are_shown_as_they_are(tmp_path: Path) -> None:
    name = "dwell_2Hz_[bold]x[/]"
    time = np.arange(2000) / 500.0
    rows = [
        f"{t:.4f},{0.01 * np.sin(4 * np.pi * t):.8f},{np.sin(4 * np.pi * t + 1.0):.8f},{name}" for t in time
    ]
    head = "time [s],road_height [m],sprung_accel [m/s^2],test"
    (tmp_path / "run.csv").write_text("\n".join([head, *rows]) + "\n")
    record = as_json(summary_record(inspect(load_campaign(tmp_path / "run.csv"))))
    assert name in rendered(campaign_text(record, RIG_LAYOUT), width=160)


def test_the_record_of_the_shipped_campaign_is_what_was_recorded(nominal_campaign: Path) -> None:
    campaign = load_campaign(nominal_campaign)
    record = as_json(summary_record(inspect(campaign)))
    assert record["tests"] == 30
    assert len(record["dwells"]) == 28
    assert all(dwell["usable"] for dwell in record["dwells"])
    assert_allclose(
        [dwell["frequency_hz"] for dwell in record["dwells"]],
        [dwell["asked_hz"] for dwell in record["dwells"]],
        rtol=1e-4,
    )
    for dwell in record["dwells"]:
        assert dwell["channels"]["road_height"]["peak_to_peak"] == pytest.approx(0.0275, rel=1e-3)
        assert dwell["channels"]["sprung_accel"]["noise_sd"] == pytest.approx(0.05, rel=0.1)
    channels = {channel["name"]: channel for channel in record["channels"]}
    assert channels["sprung_accel"]["standstill_noise"] == pytest.approx(0.05, rel=0.05)
    assert channels["susp_deflection"]["standstill_noise"] == pytest.approx(1e-4, rel=0.05)
    assert channels["sprung_accel"]["rate_hz"] == pytest.approx(500.0, rel=1e-3)
    assert record["missing_channels"] == []
    assert record["sha256"] == campaign.sha256


def test_tables_of_a_campaign_fit_a_terminal_of_80_columns(nominal_campaign: Path) -> None:
    record = as_json(summary_record(inspect(load_campaign(nominal_campaign))))
    text = rendered(campaign_text(record, RIG_LAYOUT), width=80)
    rows = [line for line in text.splitlines() if line.startswith("dwell_")]
    assert len(rows) == 28
