"""Answers and diagnoses made by hand."""

from dataclasses import replace
from typing import Any

from savgs_ident.plants.quarter_car.catalogue import CATALOGUE
from savgs_ident.validation.blind_answer import Answer, Drawn

BLANK = Answer(1, "none", (), (), {}, {}, (), {}, {"m_s": 319.0}, ())


def answer(kind: Drawn, *effects: str, number: int = 1, **parameters: float) -> Answer:
    """The truth of a trial with these effects, which change the response by a tenth each."""
    return replace(
        BLANK,
        number=number,
        kind=kind,
        effects=effects,
        ports=tuple(CATALOGUE[name].port.location for name in effects),
        changes=dict.fromkeys(effects, 0.1),
        sigmas=dict.fromkeys(effects, 20.0),
        parameters=parameters,
        without=effects if kind == "unknown" else (),
    )


def diagnosis(kind: str, *effects: str, **more: Any) -> dict[str, Any]:
    """A ``diagnosis.json``, as far as marks depend on it.

    ``ports`` are by default those of the effects; ``like`` are those that look alike, ``beside`` ports that do,
    ``intervals`` low and high by parameter, ``closed`` is the share of the gap.
    """
    ports = more.get("ports", list(dict.fromkeys(CATALOGUE[name].port.location for name in effects)))
    parameters = {
        name: {"value": (low + high) / 2.0, "lo": low, "hi": high, "unit": "1"}
        for name, (low, high) in more.get("intervals", {}).items()
    }
    return {
        "verdict": {
            "kind": kind,
            "effects": list(effects),
            "ports": ports,
            "confusable_with": list(more.get("like", ())),
            "sentence": "",
            "confusable_ports": list(more.get("beside", ())),
        },
        "which": [
            {"effect": "none", "effects": [], "parameters": {}},
            {"effect": " + ".join(effects), "effects": list(effects), "parameters": parameters},
        ],
        "shrink": {"share_closed": more.get("closed", 0.99)},
        "wall_s": 60.0,
    }
