"""Write ``stroke.csv.gz`` and ``stroke_again.csv.gz``: two runs of a damper without its fluid's magnetic field.

They stand in for published recordings of such a damper, see ``docs/hardware.md``. The force is an offset of the load
cell, a viscous force, and a friction as Dahl has it: a spring that gives way as it is stretched. Both have noise.
"""

import gzip
from pathlib import Path

import numpy as np

TRUTH = {"offset": -130.0, "viscous": 600.0, "friction": 50.0, "stuck": 80e3, "mass": 0.45}
RATE, SECONDS, HERTZ, FINE = 100.0, 20.0, 1.5, 100
NOISE = {"force": 1.0, "stroke": 2e-6}
RUNS = {"stroke": 10e-3, "stroke_again": 7e-3}


def record(amplitude: float, random: np.random.Generator) -> list[str]:
    """The lines of one run: time, force on the rod, stroke."""
    time = np.arange(0.0, SECONDS, 1.0 / (FINE * RATE))
    turned = 2.0 * np.pi * HERTZ
    x = amplitude * np.sin(turned * time)
    v = amplitude * turned * np.cos(turned * time)
    friction, held = np.zeros(time.size), 0.0
    for place, speed in enumerate(v[:-1]):
        rate = TRUTH["stuck"] * (speed - abs(speed) * held / TRUTH["friction"])
        held += rate / (FINE * RATE)
        friction[place + 1] = held
    inertia = -TRUTH["mass"] * turned**2 * x
    # What the cell reads beside what is exerted: the offset is the cell's.
    force = (inertia + TRUTH["viscous"] * v + friction - TRUTH["offset"])[::FINE]
    force = force + NOISE["force"] * random.standard_normal(force.size)
    stroke = x[::FINE] + NOISE["stroke"] * random.standard_normal(force.size)
    rows = zip(time[::FINE], force, 1e3 * stroke, strict=True)
    return [f"{t:.3f},{f:.4f},{s:.5f}\n" for t, f, s in rows]


if __name__ == "__main__":
    random = np.random.default_rng(1)
    for name, amplitude in RUNS.items():
        lines = ["time [s],force [N],stroke [mm]\n", *record(amplitude, random)]
        path = Path(__file__).with_name(f"{name}.csv.gz")
        path.write_bytes(gzip.compress("".join(lines).encode(), mtime=0))
