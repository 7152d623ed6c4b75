"""A posterior whose every number is known: normal draws about a point, and a repetition of a measured campaign.

The draws of the parameters are first-order autoregressive, so that chains wander as real ones do. The posterior
predicts what was measured, moved by noise as the covariance says: the truth is one draw of the same law.
"""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from savgs_ident.inference.result import (
    Convergence,
    HarmonicPosterior,
    Marginal,
    Predictive,
    ProfileLine,
    Role,
)
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.rig import Rig, default_rig_path, read_rig
from savgs_ident.plants.quarter_car.rig_recordings import RIG_LAYOUT, load_campaign
from savgs_ident.responses.dwells import estimate_response
from savgs_ident.responses.harmonic_response import HarmonicResponse

IDENTIFIED = {
    "mu_r": (0.03000, 0.00030, (0.005, 0.195)),
    "mu_t": (0.2512, 0.0014, (0.025, 0.975)),
    "ydot_Hth": (0.05062, 0.00033, (0.0126, 0.488)),
    "c_sd": (5405.9, 25.4, (500.0, 19500.0)),
}
"""Mean, standard deviation and prior 95 % interval of the identified parameters."""

NUISANCE = {"noise_scale": (1.013, 0.012, (0.82, 1.22)), "discrepancy": (0.0007, 0.0002, (0.0, 0.112))}
CORRELATION = np.array(
    [[1.0, 0.0, 0.0, -0.4], [0.0, 1.0, 0.85, 0.0], [0.0, 0.85, 1.0, 0.0], [-0.4, 0.0, 0.0, 1.0]]
)
AUTOCORRELATION = 3.0
SENTENCES = (
    "The data identify mu_r to 1.0 %, mu_t to 0.56 %, ydot_Hth to 0.65 % and c_sd to 0.47 %.",
    "mu_t and ydot_Hth trade off along a line: their ratio is known to 0.3 %.",
    "A dwell above 4.5 Hz separates them best.",
)


@cache
def nominal_response(campaign: Path) -> HarmonicResponse:
    """The harmonics of the shipped campaign, orders 0 to 9."""
    channels = ("road_height", *RIG_LAYOUT.responses)
    return estimate_response(load_campaign(campaign).only(channels), 9)


def synthetic_posterior(
    measured: HarmonicResponse, chains: int = 4, length: int = 1500, seed: int = 20170912
) -> HarmonicPosterior:
    """A converged posterior of the paper's four parameters, two nuisance scales and the rig's tolerances."""
    rng = np.random.default_rng(seed)
    rig = read_rig(default_rig_path())
    draws = _identified_draws(rng, chains, length)
    for name, (mean, sd, _) in NUISANCE.items():
        draws[name] = np.abs(mean + sd * wander(rng, chains, length))
    tolerated = [
        each for each in rig.parameters.entries if each.tolerance > 0.0 and each.name not in IDENTIFIED
    ]
    for each in tolerated:
        shift, shrunk = rng.uniform(-0.9, 0.9), rng.uniform(0.1, 1.0)
        draws[each.name] = each.value + each.tolerance * (shift + shrunk * wander(rng, chains, length))
    marginals = [
        *(_marginal(draws, name, *_metadata(rig, name), "identified", IDENTIFIED[name][2]) for name in IDENTIFIED),
        *(_marginal(draws, name, "1", "", "nuisance", NUISANCE[name][2]) for name in NUISANCE),
        *(
            _marginal(
                draws, each.name, each.unit, each.about, "tolerated",
                (each.value - 1.96 * each.tolerance, each.value + 1.96 * each.tolerance),
            )
            for each in tolerated
        ),
    ]  # fmt: skip
    return HarmonicPosterior(
        model=RigModel(rig, ("rail_coulomb", "tyre_friction")),
        sampler="nuts",
        marginals=tuple(marginals),
        draws=draws,
        statistics={
            "lp": -200.0 + rng.standard_normal((chains, length)),
            "accepted": np.ones((chains, length)),
        },
        convergence=Convergence(
            converged=True,
            reasons=(),
            target_ess=1000.0,
            ess_min=min(m.ess_tail for m in marginals),
            r_hat_max=max(m.r_hat for m in marginals),
            acceptance=0.873,
            divergences=0,
            pareto_k=0.21,
            heaviest_weight=1.6,
            evaluations=8123,
            unsolved=2,
        ),
        predictive=_predictive(rng, measured),
        measured=measured,
        sentences=SENTENCES,
        wall_s=83.4,
    )


def unconverged(posterior: HarmonicPosterior, *reasons: str) -> HarmonicPosterior:
    """The same, not converged for these reasons, with one chain that stayed away from the others."""
    draws = {name: values.copy() for name, values in posterior.draws.items()}
    first = posterior.marginals[0]
    draws[first.name][0] += 6.0 * first.sd
    marginals = (replace(first, r_hat=1.74, ess_bulk=6.0, ess_tail=11.0), *posterior.marginals[1:])
    convergence = replace(
        posterior.convergence, converged=False, reasons=reasons, r_hat_max=1.74, ess_min=6.0
    )
    return replace(posterior, draws=draws, marginals=marginals, convergence=convergence)


def renamed(posterior: HarmonicPosterior, name: str, about: str, unit: str) -> HarmonicPosterior:
    """The same, with its first parameter called otherwise."""
    first, *others = posterior.marginals
    draws = {name if key == first.name else key: values for key, values in posterior.draws.items()}
    return replace(
        posterior, marginals=(replace(first, name=name, about=about, unit=unit), *others), draws=draws
    )


def _metadata(rig: Rig, name: str) -> tuple[str, str]:
    return rig.parameters[name].unit, rig.parameters[name].about


def wander(rng: np.random.Generator, chains: int, length: int) -> NDArray[np.float64]:
    """Unit normal draws (chains, length) whose integrated autocorrelation time is AUTOCORRELATION."""
    keep = (AUTOCORRELATION - 1.0) / (AUTOCORRELATION + 1.0)
    shocks = rng.standard_normal((chains, length))
    out = shocks.copy()
    for step in range(1, length):
        out[:, step] = keep * out[:, step - 1] + np.sqrt(1.0 - keep**2) * shocks[:, step]
    return out


def _identified_draws(rng: np.random.Generator, chains: int, length: int) -> dict[str, NDArray[np.float64]]:
    standard = np.stack([wander(rng, chains, length) for _ in IDENTIFIED])
    mixed = np.einsum("ij,jcd->icd", np.linalg.cholesky(CORRELATION), standard)
    return {
        name: mean + sd * values
        for (name, (mean, sd, _)), values in zip(IDENTIFIED.items(), mixed, strict=True)
    }


def _marginal(
    draws: dict[str, NDArray[np.float64]],
    name: str,
    unit: str,
    about: str,
    role: Role,
    prior: tuple[float, float],
) -> Marginal:
    values = draws[name]
    low, median, high = (float(q) for q in np.quantile(values, (0.025, 0.5, 0.975)))
    mean, sd = float(values.mean()), float(values.std())
    worth = values.size / AUTOCORRELATION
    profile = None
    if role == "identified":
        at = mean + sd * np.linspace(-3.0, 3.0, 13)
        profile = ProfileLine(at, ((at - mean) / sd) ** 2)
    return Marginal(
        name=name,
        unit=unit,
        about=about,
        role=role,
        median=median,
        sd=sd,
        q025=low,
        q975=high,
        prior=prior,
        contraction=1.0 - (high - low) / (prior[1] - prior[0]),
        laplace_value=mean,
        laplace_sd=0.97 * sd,
        ess_bulk=worth,
        ess_tail=0.8 * worth,
        r_hat=1.002,
        autocorrelation=AUTOCORRELATION,
        profile=profile,
    )


def _predictive(rng: np.random.Generator, measured: HarmonicResponse, samples: int = 200) -> Predictive:
    rows = [measured.channel(name) for name in RIG_LAYOUT.responses]
    seen, covariance = measured.harmonics[:, rows], measured.covariance[:, rows]
    used = measured.valid[:, rows].copy()
    used[..., 0] = False
    factor = np.zeros_like(covariance)
    factor[used] = np.linalg.cholesky(covariance[used])

    def moved(count: int) -> NDArray[np.complex128]:
        parts = np.einsum("dckij,sdckj->sdcki", factor, rng.standard_normal((count, *seen.shape, 2)))
        return np.asarray(parts[..., 0] + 1j * parts[..., 1])

    centre = seen + moved(1)[0]
    model = centre + 0.15 * moved(samples)
    replicated = model + moved(samples)
    return Predictive(model, replicated, used, _inside(seen, replicated) & used)


def _inside(seen: NDArray[np.complex128], replicated: NDArray[np.complex128]) -> NDArray[np.bool_]:
    """Whether measured phasors are no further from the mean than 95 % of the repeated ones."""
    centre = replicated.mean(axis=0)
    off = np.stack([(replicated - centre).real, (replicated - centre).imag], axis=-1)
    spread = np.einsum("s...i,s...j->...ij", off, off) / len(off) + 1e-30 * np.eye(2)
    inverse = np.linalg.inv(spread)
    radius = np.einsum("s...i,...ij,s...j->s...", off, inverse, off)
    miss = np.stack([(seen - centre).real, (seen - centre).imag], axis=-1)
    reached = np.einsum("...i,...ij,...j->...", miss, inverse, miss)
    return np.asarray(reached <= np.quantile(radius, 0.95, axis=0))
