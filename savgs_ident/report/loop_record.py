"""A study of the closed loop as the JSON object of ``closed-loop.json``, and its signals as a table."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from savgs_ident.control.closed_loop.failure import KINDS
from savgs_ident.control.closed_loop.metrics import Gain, Ride
from savgs_ident.control.closed_loop.study import LoopStudy
from savgs_ident.report.model_origin import ModelOrigin

SIGNAL_UNITS = {
    "time": "s",
    "road": "m",
    "sprung_accel": "m/s^2",
    "susp_deflection": "m",
    "tyre_load": "N",
    "wishbone_angle": "rad",
    "link_angle": "rad",
    "link_velocity": "rad/s",
    "asked": "rad/s",
    "motor_torque": "N m",
    "shaft_power": "W",
    "electric_power": "W",
    "doubted": "1",
}
"""Units of the signals of a run."""


def loop_record(study: LoopStudy, origin: ModelOrigin, controller: str) -> dict[str, Any]:
    """What the loop does in a test, with failures, on other rigs, and why; ``controller`` says which one it is."""
    drive = study.drive
    return {
        "schema": 1,
        "rig": origin.rig,
        "effects": list(origin.effects),
        "controller": controller,
        "test": {
            "name": study.test.name.value,
            "title": study.test.title,
            "judged_from_s": study.test.start,
            "judged_to_s": study.test.end,
        },
        "rms_reduction_percent": {
            "sprung_accel": study.gain.sprung_accel,
            "susp_deflection": study.gain.susp_deflection,
        },
        "tyre_load_rms_change_percent": -study.gain.tyre_load,
        "motor_speed_peak_rpm": drive.speed_peak_rpm,
        "saturated_fraction": drive.saturated,
        "saturated_from_s": drive.saturated_from,
        "saturated_from_hz": _reached(study, drive.saturated_from),
        "speed_limit_from_s": drive.limited_from,
        "speed_limit_from_hz": _reached(study, drive.limited_from),
        "link_angle_range_deg": list(drive.angle_deg),
        "peak_power_w": drive.power_peak,
        "energy_j": drive.energy,
        "energy_returned_j": drive.returned,
        "stable": study.stable,
        "angle_doubted_from_s": study.doubted_from,
        "trusted": study.trusted,
        "passive": _ride(study.passive_ride),
        "active": _ride(study.active_ride),
        "failures": {
            failed.kind: {
                "about": KINDS[failed.kind].about,
                "at_s": study.test.fails_at,
                "from_then_on": _ride(failed.ride),
                "passive_then": _ride(study.passive_after),
                "final_link_angle_deg": float(np.degrees(failed.run.signals.link_angle[-1])),
            }
            for failed in study.failures
        },
        "rigs": None
        if study.rigs is None
        else {
            "source": study.rigs.source,
            "count": len(study.on_rigs),
            "stable": sum(each.stable for each in study.on_rigs),
            "rms_reduction_percent": [_gain(each.gain) for each in study.on_rigs],
        },
        "causes": [{"variant": each.variant} | _gain(each.gain) for each in study.causes],
        "model": origin.model,
        "command": origin.command_line,
        "versions": dict(origin.versions),
    }


def _reached(study: LoopStudy, time: float | None) -> float | None:
    """Frequency of a sweep [Hz] at a time [s]; None where there is none."""
    if study.test.sweeps is None or time is None:
        return None
    low, high = study.test.sweeps
    return low + (high - low) * time / study.test.end


def _ride(ride: Ride) -> dict[str, Any]:
    return {
        "sprung_accel_rms_m_per_s2": ride.sprung_accel,
        "susp_deflection_rms_m": ride.susp_deflection,
        "tyre_load_rms_n": ride.tyre_load,
        "no_contact_fraction": ride.lifts,
        "stable": ride.stable,
    }


def _gain(gain: Gain) -> dict[str, float]:
    return {
        "sprung_accel": gain.sprung_accel,
        "susp_deflection": gain.susp_deflection,
        "tyre_load": gain.tyre_load,
    }


def loop_columns(study: LoopStudy) -> dict[str, Sequence[object]]:
    """The signals of the active run and, prefixed ``passive_``, the response of the passive one, with units."""
    active = {name: getattr(study.active.signals, name) for name in SIGNAL_UNITS}
    response = ("sprung_accel", "susp_deflection", "tyre_load")
    passive = {f"passive_{name}": getattr(study.passive.signals, name) for name in response}
    units = SIGNAL_UNITS | {f"passive_{name}": SIGNAL_UNITS[name] for name in response}
    return {
        f"{name} [{units[name]}]": [f"{value:.9g}" for value in np.asarray(values)]
        for name, values in (active | passive).items()
    }
