"""Diagnoses as ``savgs-ident diagnose`` writes them, of few entries."""

from typing import Any

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
