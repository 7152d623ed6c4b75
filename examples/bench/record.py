"""Write ``roads.csv.gz``: two rough roads under a quarter car whose guide rubs, by another integrator.

The numbers below are the truth that the recordings hold; the plant in ``bench.py`` knows some of them to a tolerance.
"""

import gzip
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

TRUTH = {
    "m_s": 2.463,
    "m_u": 1.004,
    "k": 940.0,
    "c": 8.3,
    "k_t": 2440.0,
    "c_t": 5.6,
    "friction": 0.6,
    "stuck": 6e3,
}
LENGTH, RATE = 20.0, 200.0
NOISE = {"body": 5e-5, "wheel": 5e-5, "body_accel": 0.05}


def road(random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and heights [m] of a plate that follows a rough road up to 12 Hz, 5 mm rms."""
    time = np.arange(0.0, LENGTH, 1.0 / RATE)
    hertz = np.fft.rfftfreq(time.size, 1.0 / RATE)
    size = np.where((hertz > 0.3) & (hertz < 12.0), 1.0 / np.maximum(hertz, 0.3), 0.0)
    height = np.fft.irfft(size * np.exp(2j * np.pi * random.random(hertz.size)))
    return time, 5e-3 * height / np.std(height) * np.minimum(1.0, time)


def rates(t: float, x: np.ndarray, plate: CubicSpline) -> list[float]:
    """Time derivatives of heights, speeds and friction at time ``t`` [s]."""
    p = TRUTH
    strut = p["k"] * (x[0] - x[2]) + p["c"] * (x[1] - x[3])
    tyre = p["k_t"] * (x[2] - plate(t)) + p["c_t"] * (x[3] - plate(t, 1))
    # Friction as Dahl has it: a spring of stiffness "stuck" that gives way as it is stretched.
    friction = p["stuck"] * (x[1] - np.abs(x[1]) * x[4] / p["friction"])
    return [x[1], (-strut - x[4]) / p["m_s"], x[3], (strut - tyre) / p["m_u"], friction]


def record(name: str, random: np.random.Generator) -> list[str]:
    """The lines of one road, from rest."""
    time, height = road(random)
    plate = CubicSpline(time, height)
    found = solve_ivp(
        rates, (0.0, time[-1]), np.zeros(5), "LSODA", time, args=(plate,), rtol=1e-8, atol=1e-10
    )
    accel = [rates(t, x, plate)[1] for t, x in zip(time, found.y.T, strict=True)]
    exact = {"body": found.y[0], "wheel": found.y[2], "body_accel": np.asarray(accel)}
    noisy = [value + NOISE[channel] * random.standard_normal(time.size) for channel, value in exact.items()]
    rows = zip(time, 1e3 * height, 1e3 * noisy[0], 1e3 * noisy[1], noisy[2], strict=True)
    return [f"{name},{t:.3f},{r:.4f},{s:.4f},{u:.4f},{a:.4f}\n" for t, r, s, u, a in rows]


if __name__ == "__main__":
    random = np.random.default_rng(1)
    lines = ["test,time [s],plate [mm],body [mm],wheel [mm],body_accel [m/s^2]\n"]
    lines += [line for name in ("road_1", "road_2") for line in record(name, random)]
    path = Path(__file__).with_name("roads.csv.gz")
    path.write_bytes(gzip.compress("".join(lines).encode(), mtime=0))
