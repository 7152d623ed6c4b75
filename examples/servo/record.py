"""Write ``tests.csv.gz``: ten harmonic tests of a motor that has dry friction in its bearing, by another integrator.

The numbers below are the truth that the recordings hold; the plant in ``servo.py`` knows some of them to a tolerance.
"""

import gzip
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

TRUTH = {
    "J": 0.00213,
    "k": 0.506,
    "d": 0.0023,
    "k_m": 0.0496,
    "R": 1.015,
    "L": 0.0062,
    "friction": 0.012,
    "stuck": 40.0,
}
FREQUENCIES = (0.5, 0.8, 1.2, 1.6, 2.0, 2.3, 2.7, 3.4, 5.0, 8.0)
AMPLITUDE, RATE, SETTLING, PERIODS = 4.0, 100.0, 20, 12
NOISE = {"angle": 2e-3, "current": 2e-2}


def rates(t: float, x: np.ndarray, hertz: float) -> list[float]:
    """Time derivatives of angle, speed, current and friction at time ``t`` [s]."""
    v, p = AMPLITUDE * np.sin(2.0 * np.pi * hertz * t), TRUTH
    torque = p["k_m"] * x[2] - p["k"] * x[0] - p["d"] * x[1] - x[3]
    # Friction as Dahl has it: a spring of stiffness "stuck" that gives way as it is stretched.
    friction = p["stuck"] * (x[1] - np.abs(x[1]) * x[3] / p["friction"])
    return [x[1], torque / p["J"], (v - p["R"] * x[2] - p["k_m"] * x[1]) / p["L"], friction]


def record(hertz: float, random: np.random.Generator) -> list[str]:
    """The lines of one test, after the motion has settled."""
    start = SETTLING / hertz
    time = np.arange(0.0, PERIODS / hertz, 1.0 / RATE)
    end = start + time[-1]
    found = solve_ivp(
        rates,
        (0.0, end),
        np.zeros(4),
        "LSODA",
        start + time,
        args=(hertz,),
        rtol=1e-8,
        atol=1e-9,
        max_step=0.01,
    )
    voltage = AMPLITUDE * np.sin(2.0 * np.pi * hertz * (start + time))
    angle = found.y[0] + NOISE["angle"] * random.standard_normal(time.size)
    current = found.y[2] + NOISE["current"] * random.standard_normal(time.size)
    rows = zip(time, voltage, np.rad2deg(angle), current, strict=True)
    return [f"dwell_{hertz}Hz,{t:.3f},{v:.5f},{a:.4f},{i:.4f}\n" for t, v, a, i in rows]


if __name__ == "__main__":
    random = np.random.default_rng(1)
    lines = ["test,time [s],voltage [V],angle [deg],current [A]\n"]
    lines += [line for hertz in FREQUENCIES for line in record(hertz, random)]
    path = Path(__file__).with_name("tests.csv.gz")
    path.write_bytes(gzip.compress("".join(lines).encode(), mtime=0))
