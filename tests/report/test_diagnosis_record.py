"""diagnosis.json is the object of the contract, and holds the numbers of the diagnosis."""

from collections.abc import Mapping
from dataclasses import replace

import pytest

from savgs_ident.diagnosis.result import Diagnosis

from .diagnosis_reading import record_of
from .diagnosis_synthetic import (
    KINDS,
    SHARES,
    SHRINK,
)


def has_form(value: object, form: object) -> bool:
    """Whether a JSON value is of this form: types, lists of one form, and objects with at least these keys."""
    if isinstance(form, Mapping):
        return isinstance(value, dict) and all(
            key in value and has_form(value[key], each) for key, each in form.items()
        )
    if isinstance(form, list):
        return isinstance(value, list) and all(has_form(entry, form[0]) for entry in value)
    if isinstance(value, bool):
        return form is bool
    return isinstance(value, form)  # type: ignore[arg-type]  # A type or several.


NUMBER = (int, float)
MAYBE = (int, float, type(None))
CONTRACT: dict[str, object] = {
    "schema": int,
    "baseline": {"model": str, "parameters": {"mu_r": NUMBER, "c_sd": NUMBER}},
    "verdict": {
        "kind": str,
        "effects": [str],
        "ports": [str],
        "confusable_with": [str],
        "sentence": str,
        "confusable_ports": [str],
        "families": [str],
        "law_known": bool,
        "probability": NUMBER,
        "another_law": bool,
    },
    "where": {
        "ports": [{"port": str, "probability": NUMBER, "share": NUMBER, "reach": NUMBER}],
        "map": [
            {"channel": str, "frequency_hz": NUMBER, "order": int, "gap_percent": NUMBER, "gap_sigma": NUMBER}
        ],
        "regimes": [{"regime": str, "gap_percent": NUMBER, "p_value": NUMBER}],
    },
    "which": [
        {
            "effect": str,
            "port": (str, type(None)),
            "family": (str, type(None)),
            "probability": NUMBER,
            "score_sigma": NUMBER,
            "heldout_gain": NUMBER,
            "gain_beyond": MAYBE,
            "parameters": {},
        }
    ],
    "shrink": {
        "before": NUMBER,
        "recalibrated": NUMBER,
        "after": NUMBER,
        "floor": NUMBER,
        "closed_by_calibration": MAYBE,
        "closed_by_effect": MAYBE,
        "share_closed": MAYBE,
        "interval": [MAYBE],
        "by_channel": {"sprung_accel": {"before": NUMBER}, "susp_deflection": {"before": NUMBER}},
    },
    "next_test": [{"test": str, "separates": [str], "expected_sigma": NUMBER}],
}
"""The object of diagnosis.json."""


def test_the_record_is_the_object_of_the_contract(by_kind: dict[str, Diagnosis]) -> None:
    for kind in KINDS:
        record = record_of(by_kind[kind])
        assert list(record)[: len(CONTRACT)] == list(CONTRACT)
        assert has_form(record, CONTRACT)
        assert record["schema"] == 2
        assert record["verdict"]["kind"] == kind
        assert {"none", "unknown"} <= {entry["effect"] for entry in record["which"]}
        assert sum(entry["probability"] for entry in record["which"]) == pytest.approx(1.0, abs=1e-12)
        for entry in record["which"]:
            for parameter in entry["parameters"].values():
                assert has_form(parameter, {"value": NUMBER, "lo": NUMBER, "hi": NUMBER, "unit": str})


def test_the_form_of_the_contract_refuses_what_is_not_of_it(diagnosis: Diagnosis) -> None:
    record = record_of(diagnosis)
    assert not has_form({**record, "schema": "1"}, CONTRACT)
    assert not has_form({key: value for key, value in record.items() if key != "shrink"}, CONTRACT)
    assert not has_form({**record, "next_test": [{"test": "x"}]}, CONTRACT)


def test_the_record_holds_the_numbers_of_the_diagnosis(diagnosis: Diagnosis) -> None:
    record = record_of(diagnosis)
    assert record["baseline"]["parameters"]["c_sd"] == 5391.2
    assert record["identified"]["c_sd"] == 5386.1
    assert record["intervals"] == {"mu_r": {"value": 0.03, "lo": 0.0297, "hi": 0.0303, "unit": "1"}}
    assert record["verdict"]["effects"] == ["rail_stribeck"]
    assert record["drifts"] == {}
    assert record_of(replace(diagnosis, drifts={"mu_r": -0.2}))["drifts"] == {"mu_r": -0.2}
    assert record["verdict"]["confusable_with"] == ["rail_preload"]
    assert {entry["port"]: (entry["share"], entry["reach"]) for entry in record["where"]["ports"]} == SHARES
    # 28 dwells, two channels, nine orders: none is left out where all were measured.
    assert len(record["where"]["map"]) == len(diagnosis.map) == 504
    assert record["where"]["regimes"][0] == {
        "regime": "low speed or large stroke", "gap_percent": 9.2, "p_value": 0.012
    }  # fmt: skip
    assert len(record["where"]["regimes"]) == len(diagnosis.regimes)
    assert record["which"][0]["parameters"]["stribeck_velocity"] == {
        "value": 0.1012, "lo": 0.0957, "hi": 0.1066, "unit": "m/s"
    }  # fmt: skip
    assert record["shrink"]["share_closed"] == SHRINK.share_closed
    assert record["shrink"]["interval"] == list(SHRINK.interval)
    assert record["shrink"]["by_channel"]["susp_deflection"]["floor"] == 0.0009
    assert record["next_test"][0]["separates"] == ["rail_stribeck", "rail_preload"]
    assert record["not_judgeable"][0] == {
        "effect": "bump_stop", "parameter": "bump_stop_stiffness", "smallest": 3.2e4, "unit": "N/m"
    }  # fmt: skip
    assert record["confusable"][1]["cosine"] == -0.951
    assert record["sweep"]["after"] == 0.0132
    assert record["converged"] is True
    assert record["provenance"]["data_sha256"] == "ab" * 32
    assert record["provenance"]["warnings"][0]["code"] == "odd"


def test_what_was_not_computed_is_null_in_the_record(by_kind: dict[str, Diagnosis]) -> None:
    record = record_of(replace(by_kind["none"], further=None))
    assert record["sweep"] is None
    assert record["shrink"]["share_closed"] is None
    assert record["shrink"]["interval"] == [None, None]
    assert record["which"][-1]["share_closed"] is None
