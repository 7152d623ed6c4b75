"""The closed loop: the sweep of 60 s by the package, and a shorter run beside scipy on the same equations.

scipy integrates from one sample of the controller to the next with LSODA; the right side, the instruments and the law
are ours, compiled, so that the two differ in nothing but who steps and how.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from numpy.typing import NDArray
from scipy.integrate import odeint

from benchmarks.outcome import Outcome, Progress
from benchmarks.timing import median_time, timed
from savgs_ident.control.closed_loop.programme import harmonic_test, sweep_test
from savgs_ident.control.closed_loop.run import (
    LoopCase,
    Signals,
    loop_case,
    loop_field,
    loop_rest,
    loop_sample,
    run_loop,
)
from savgs_ident.control.closed_loop.study import loop_around
from savgs_ident.control.design import controller_for
from savgs_ident.control.generalised_plant import DEFAULT_WEIGHTS
from savgs_ident.core.values import as_values
from savgs_ident.plants.quarter_car.catalogue import MODELS, build_model, model_parameters
from savgs_ident.plants.quarter_car.rig import default_rig_path, read_rig
from savgs_ident.simulate.program_cache import use_persistent_cache

SECONDS = 4.0
"""Length of the run that scipy does, too [s]."""

FREQUENCY = 2.0
"""Of the cam in it [Hz]."""

REPEATS = 3
"""Runs of ours, of which the median counts."""

TOLERANCE = 1e-6
"""Tolerance of LSODA, relative and absolute in SI."""


def measure(progress: Progress) -> Outcome:
    """Times, and the difference of the two deflections: rms over rms."""
    # The compiler as the program sets it up, which has to come before anything is computed: run this one by itself.
    use_persistent_cache()
    rig, effects = read_rig(default_rig_path()), MODELS["simtr"]
    model, p = build_model(rig, effects), as_values(model_parameters(rig, effects).as_dict())
    loop = loop_around(p, controller_for(model, p, DEFAULT_WEIGHTS))
    cam = float(p["cam_peak_to_peak"])
    progress("closed loop: sweep of 60 s")
    sweep = sweep_test(cam).road
    run_loop(model, p, sweep, loop, 60.0)
    sweep_s = median_time(lambda: run_loop(model, p, sweep, loop, 60.0), REPEATS)
    progress(f"closed loop: {SECONDS:g} s at {FREQUENCY:g} Hz")
    road = harmonic_test(cam, FREQUENCY).road
    ours = run_loop(model, p, road, loop, SECONDS)
    ours_s = median_time(lambda: run_loop(model, p, road, loop, SECONDS), REPEATS)
    progress("closed loop: the same by scipy")
    samples = _ByScipy(loop_case(model, p, road, loop, SECONDS))
    samples.run(1)
    theirs, scipy_s = timed(lambda: samples.run(round(SECONDS * loop.rate)))
    truth = theirs[:, Signals._fields.index("susp_deflection")]
    difference = np.sqrt(np.mean((np.asarray(ours.signals.susp_deflection) - truth) ** 2)) / np.std(truth)
    return Outcome(
        {
            "closed_loop_sweep_s": sweep_s,
            "speedup_closed_loop_scipy": scipy_s / ours_s,
            "closed_loop_difference_percent": 100.0 * float(difference),
        },
        (
            f"closed loop: scipy's LSODA (odeint) at tolerance {TOLERANCE:g}, started anew at each of the "
            f"{loop.rate:g} samples per second, over {SECONDS:g} s.",
        ),
    )


class _ByScipy:
    """The loop of a case, sample by sample; its functions are compiled once."""

    def __init__(self, case: LoopCase) -> None:
        self.case, self.rest = case, np.asarray(jax.jit(lambda: loop_rest(case))())
        still = jnp.zeros_like(self.rest)
        period = 1.0 / case.loop.rate
        fastest = case.p["motor_speed_limit"] / case.p["motor_gear_ratio"] * period

        def sampled(
            t: Array, x: Array, normal: Array, law: Array, asked: Array
        ) -> tuple[Array, Array, Array]:
            rates = loop_field(case, asked, t, x, still)
            measured, signals = loop_sample(case, t, x, rates, asked)
            readings = case.loop.failure.shown(t, case.loop.instruments.read(measured, normal))
            return jnp.stack(signals), *case.loop.law.command(law, readings, fastest)

        self.sampled = jax.jit(sampled)
        self.field = jax.jit(lambda x, t, asked: loop_field(case, asked, t, x, still))

    def run(self, steps: int) -> NDArray[np.float64]:
        """Signals (steps, s) of the first samples, LSODA in between."""
        period = 1.0 / self.case.loop.rate
        noise = np.asarray(self.case.noise).reshape(-1, self.case.noise.shape[-1])
        x, law, asked, rows = self.rest, self.case.loop.law.start(), jnp.zeros(()), []
        for k in range(steps):
            t = k * period
            row, law, asked_next = self.sampled(t, x, noise[k], law, asked)
            rows.append(np.asarray(row))
            x = odeint(self._rates, x, (t, t + period), args=(asked,), rtol=TOLERANCE, atol=TOLERANCE)[1]
            asked = asked_next
        return np.stack(rows)

    def _rates(self, x: NDArray[np.float64], t: float, asked: Array) -> NDArray[np.float64]:
        return np.asarray(self.field(x, t, asked))
