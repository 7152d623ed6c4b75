"""Diagnoses as ``savgs-ident diagnose`` writes them, of few entries."""

from typing import Any

from savgs_ident.effects.learned_functions import coefficients_at
from savgs_ident.plants.quarter_car.ports import STRUT

MOUNT_FITTED = {
    "mount_compliance": {"value": 1.65e-06, "lo": 1.63e-06, "hi": 1.67e-06, "unit": "m/N"},
    "mount_damping": {"value": 357.0, "lo": 292.0, "hi": 434.0, "unit": "N s/m"},
}


def diagnosis(kind: str, effects: list[str], ports: list[str], **more: Any) -> dict[str, Any]:
    """A diagnosis of SimTR with a verdict, and ``more`` entries."""
    return {
        "schema": 1,
        "baseline": {
            "model": "simtr",
            "parameters": {"mu_r": 0.0309, "k_t": 215315.7},
            "effects": ["rail_coulomb", "tyre_friction"],
        },
        "verdict": {
            "kind": kind,
            "effects": effects,
            "ports": ports,
            "confusable_with": [],
            "sentence": "What is missing, “in words”.",
        },
        "where": {"ports": [{"port": "strut", "share": 0.97}], "map": []},
        "which": [
            {"effect": "none", "probability": 0.0, "parameters": {}, "effects": [], "share_closed": None},
            {
                "effect": "mount_compliance",
                "probability": 0.996,
                "parameters": MOUNT_FITTED,
                "effects": ["mount_compliance"],
            },
        ],
        "shrink": {"before": 0.33, "recalibrated": 0.039, "after": 0.0019, "floor": 0.0017},
        "next_test": [],
        "converged": True,
        "provenance": {"data": "campaign.csv.gz", "data_sha256": "ab12", "model": "gt_rear.toml"},
    } | more


IDENTIFIED = {"mu_r": 0.0301, "k_t": 264423.0, "mount_compliance": 1.65e-06, "mount_damping": 357.0}
MOUNT = diagnosis("effect", ["mount_compliance"], ["strut"], identified=IDENTIFIED)
NOTHING = diagnosis("none", [], [], identified={"mu_r": 0.0301})
UNKNOWN = diagnosis("unknown", [], ["frame"], identified={"mu_r": 0.0309})
SPANS = {
    "learned_strut_middle": 0.44,
    "learned_strut_stroke": 0.02,
    "learned_strut_speed": 0.3,
    "learned_strut_carried": 4e3,
    "learned_strut_turn": 0.03,
    "learned_strut_give": 1.2,
    "learned_strut_gap": 0.2,
    "learned_strut_fall": 0.1,
    "learned_strut_lag": 5e-4,
}
COEFFICIENTS = {name: 3.0 * number for number, name in enumerate(coefficients_at(STRUT), 1)}
LEARNED = diagnosis(
    "unknown", [], ["strut"],
    learned={
        "effect": "learned_strut",
        "port": "strut",
        "parameters": {
            name: {"value": value, "lo": 0.0, "hi": 2.0 * value, "unit": "N"} for name, value in COEFFICIENTS.items()
        },
        "identified": {"mu_r": 0.0301} | SPANS | COEFFICIENTS,
    },
)  # fmt: skip
"""Something unknown with the force that was learned for it."""
