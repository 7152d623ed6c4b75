"""Optimal control on the exported model: how should the link move over a bump?

The functions that `savgs-ident export MODEL --to casadi` wrote are all that is needed; this program knows nothing of
the package. Direct collocation over 1.2 s: the velocity of the link is chosen so that the sprung mass accelerates as
little as it can, within what the drive gives and within the range of the link. The accelerations are unknowns beside
the states and `residual` binds them: the optimiser solves the rig's equations on its way, where `rates` would solve
them anew at every step.

    savgs-ident export out/fit/model.toml --model simqc --to casadi --out out/export
    python examples/optimal_control.py out/export
"""

import json
import sys
from pathlib import Path
from typing import NamedTuple

import casadi as ca
import numpy as np

STEPS, DURATION = 120, 1.2
"""Intervals, and the time that they cover [s]."""

BUMP, LENGTH, SPEED, BEGINS = 0.02, 1.0, 5.0, 0.2
"""Height and length [m] of the bump, speed [m/s], and when the wheel meets it [s]."""

FASTEST = 3000.0 * np.pi / 30.0 / 40.0
"""What the drive gives [rad/s]."""

ANGLES = (np.radians(30.0), np.radians(150.0))
"""Where the link may be [rad]."""


class Answer(NamedTuple):
    """Times [s], link angles [rad], and accelerations [m/s^2] with the link moved and with it held."""

    time: np.ndarray
    link: np.ndarray
    active: np.ndarray
    passive: np.ndarray


def road(time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Height [m] and velocity [m/s] of the bump."""
    rate = 2.0 * np.pi * SPEED / LENGTH
    phase = np.clip((time - BEGINS) * SPEED / LENGTH, 0.0, 1.0) * 2.0 * np.pi
    return 0.5 * BUMP * (1.0 - np.cos(phase)), 0.5 * BUMP * rate * np.sin(phase)


def solve(folder: Path, hold: bool) -> tuple[np.ndarray, np.ndarray]:
    """Link angles at the instants, and accelerations between them; ``hold`` keeps the link where it is."""
    residual, outputs = (ca.Function.load(str(folder / f"{name}.casadi")) for name in ("residual", "outputs"))
    signals = json.loads((folder / "signals.json").read_text())
    rest = [entry["at_rest"] for entry in signals["x"]]
    p = [entry["value"] for entry in signals["p"]]
    start_angle = next(entry["at_rest"] for entry in signals["u"] if entry["name"] == "link_angle")

    problem, step = ca.Opti(), DURATION / STEPS
    x = problem.variable(len(rest), STEPS + 1)
    y = problem.variable(len(rest) - 2, STEPS)
    angle, velocity = problem.variable(1, STEPS + 1), problem.variable(1, STEPS)
    heights, rates = road((np.arange(STEPS) + 0.5) * step)
    middles = 0.5 * (x[:, :-1] + x[:, 1:])
    u = ca.vertcat(heights[None], rates[None], 0.5 * (angle[:-1] + angle[1:]), velocity)

    problem.subject_to(ca.vec(residual.map(STEPS)(middles, y, u, ca.repmat(ca.DM(p), 1, STEPS))) == 0.0)
    problem.subject_to(ca.vec(x[:, 1:] - x[:, :-1] - step * ca.vertcat(middles[2:4, :], y)) == 0.0)
    problem.subject_to(ca.vec(angle[1:] - angle[:-1] - step * velocity) == 0.0)
    problem.subject_to(x[:, 0] == rest)
    problem.subject_to(angle[0] == start_angle)
    problem.subject_to(problem.bounded(-FASTEST, velocity, FASTEST))
    problem.subject_to(problem.bounded(ANGLES[0], angle, ANGLES[1]))
    if hold:
        problem.subject_to(velocity == 0.0)
    problem.minimize(ca.sumsqr(y[0, :]) + 1e-4 * ca.sumsqr(velocity))
    problem.set_initial(x, np.tile(np.array(rest)[:, None], STEPS + 1))
    problem.set_initial(angle, start_angle)
    problem.solver("ipopt", {"print_time": False, "expand": True}, {"print_level": 0, "sb": "yes"})
    found = problem.solve()
    accelerations = outputs.map(STEPS)(found.value(middles), found.value(u), ca.repmat(ca.DM(p), 1, STEPS))
    return np.asarray(found.value(angle)).ravel(), accelerations.full()[0]


def main(folder: Path) -> Answer:
    """Both problems, and what they say."""
    _, passive = solve(folder, hold=True)
    link, active = solve(folder, hold=False)
    rms = [float(np.sqrt(np.mean(each**2))) for each in (passive, active)]
    print(
        f"rms acceleration over the bump: {rms[0]:.3f} m/s^2 with the link held, {rms[1]:.3f} with it moved"
    )
    print(f"link between {np.degrees(link.min()):.0f} and {np.degrees(link.max()):.0f} deg")
    return Answer(np.linspace(0.0, DURATION, STEPS + 1), link, active, passive)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
