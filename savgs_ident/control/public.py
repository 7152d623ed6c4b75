"""What ``import savgs_ident`` offers of control: linear models, a controller, the loop on the nonlinear rig."""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from savgs_ident.control.closed_loop.programme import (
    DEFAULT_SPEED,
    LoopKind,
    LoopTest,
    bump_test,
    harmonic_test,
    iso_test,
    sweep_test,
)
from savgs_ident.control.closed_loop.study import LoopStudy, study_loop
from savgs_ident.control.design import (
    Design,
    DigitalController,
    Rigs,
    controller_for,
    design_controller,
    read_controller,
    rigs_from_covariance,
    rigs_from_posterior,
)
from savgs_ident.control.generalised_plant import DEFAULT_WEIGHTS, read_weights
from savgs_ident.control.linear_study import LinearStudy, study_linear
from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.presentation import Progress, no_progress
from savgs_ident.core.values import as_values
from savgs_ident.inference.result import Posterior
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.simulate.program_cache import use_persistent_cache

FREQUENT = (20.0, 1e6)
"""Rates of a computer that a controller is sampled for [Hz]."""


def linearise(
    model: RigModel, progress: Progress = no_progress, *, command: Sequence[str] = ()
) -> LinearStudy:
    """Linearise a model: stiffness, damping and link at the wheel, and how far linear models are from the rig.

    The linear equivalent over the link angle with the constants and parabolas that stand for it; equation (8) of the
    paper and the exact linearisation against the nonlinear model at small motions; friction and damper as describing
    functions at the size of the test. ``progress`` is called with a sentence on what is being done; ``command`` is
    the command line that the result says it was made by.

    Raises :class:`InputError` where the rig finds no rest or no periodic motion.
    """
    use_persistent_cache()
    return study_linear(model, model.origin().with_command(command), progress)


def design(
    model: RigModel | LinearStudy,
    *,
    weights: ParameterTable | str | Path | None = None,
    posterior: Posterior | str | Path | None = None,
    rigs: int = 50,
    order: int | None = None,
    rate: float = 1000.0,
    command: Sequence[str] = (),
    progress: Progress = no_progress,
) -> Design:
    """Design an H-infinity controller for a model: gamma with its check, margins, and how it does on other rigs.

    Args:
        model: the model, or what its linearisation gave.
        weights: the weights, or a TOML file of those that differ from the usual ones; the usual ones if left out.
        posterior: what the other rigs are drawn from: a posterior or a ``posterior.nc``. Without it, the covariance
            that an identified rig carries, or else, for a drawing, its tolerances.
        rigs: on how many rigs the controller is tried.
        order: states of the controller; as many as it gets if left out.
        rate: of the computer that runs it [Hz], from 20 to 1e6.
        command: the command line that the result says it was made by.
        progress: called with a sentence on what is being done.

    Look at ``trusted`` of the result. Raises :class:`InputError` where the weights admit no controller, the order or
    the rate is not possible, or a file cannot be used.
    """
    slowest, fastest = FREQUENT
    if not slowest <= rate <= fastest:
        raise InputError(
            f"a controller cannot be sampled at {rate:g} Hz",
            source="--rate",
            remedy=f"give a rate from {slowest:g} to {fastest:g} Hz",
        )
    rig = model if isinstance(model, RigModel) else model.model
    if weights is None:
        chosen = DEFAULT_WEIGHTS
    else:
        chosen = weights if isinstance(weights, ParameterTable) else read_weights(weights)
    others = _rigs(rig, posterior, rigs)
    use_persistent_cache()
    return design_controller(rig, others, chosen, rig.origin().with_command(command), progress, order, rate)


def close_loop(
    model: RigModel,
    controller: Design | DigitalController | str | Path | None = None,
    test: Literal["harmonic", "sweep", "iso", "bump"] = "harmonic",
    *,
    frequency: float = 2.0,
    road: Literal["A", "B", "C", "D"] = "C",
    speed: float | None = None,
    posterior: Posterior | str | Path | None = None,
    rigs: int = 20,
    causes: bool = False,
    command: Sequence[str] = (),
    progress: Progress = no_progress,
) -> LoopStudy:
    """Run a controller on the nonlinear rig with its drive and instruments: passive, active, and with failures.

    Args:
        model: the rig with its effects.
        controller: a design, a controller or a ``controller.json``; designed anew with the usual weights if left out.
        test: harmonic: the cam at one frequency; sweep: 0 to 3 Hz in 60 s; iso: a random road; bump: a speed bump.
        frequency: of the harmonic test [Hz].
        road: class of the random road after ISO 8608.
        speed: of driving [m/s]; 20 on the random road, 20/3.6 over the bump if left out.
        posterior: what other rigs are drawn from, as in :func:`design`.
        rigs: on how many other rigs the loop is run.
        causes: run it also without friction, limits and noise, one at a time: why it is so.
        command: the command line that the result says it was made by.
        progress: called with a sentence on what is being done.

    Look at ``trusted`` of the result. Raises :class:`InputError` for a file that cannot be used and a controller that
    was designed for another link angle.
    """
    use_persistent_cache()
    plant, p = model.build(), as_values(model.table.as_dict())
    others = None if rigs == 0 else _rigs(model, posterior, rigs)
    if controller is None:
        progress("H-infinity synthesis with the default weights")
        digital = controller_for(plant, p, DEFAULT_WEIGHTS)
        called = "designed for this rig with the default weights"
    elif isinstance(controller, Design):
        digital, called = controller.digital, "as designed"
    elif isinstance(controller, DigitalController):
        digital, called = controller, "as given"
    else:
        digital, called = read_controller(Path(controller)), str(controller)
    asked = _test(LoopKind(test), float(p["cam_peak_to_peak"]), frequency, road, speed)
    origin = model.origin().with_command(command)
    return study_loop(model, digital, called, asked, origin, progress, others, causes)


def _rigs(model: RigModel, posterior: Posterior | str | Path | None, count: int) -> Rigs:
    """What a controller is tried on."""
    if posterior is None:
        return rigs_from_covariance(model.table, model.rig.provenance, count, model.rig.source)
    source = posterior if isinstance(posterior, Posterior) else Path(posterior)
    return rigs_from_posterior(model.table, source, count)


def _test(kind: LoopKind, cam: float, frequency: float, road: str, speed: float | None) -> LoopTest:
    if kind is LoopKind.harmonic:
        return harmonic_test(cam, frequency)
    if kind is LoopKind.sweep:
        return sweep_test(cam)
    driven = DEFAULT_SPEED[kind] if speed is None else speed
    return iso_test(road, driven) if kind is LoopKind.iso else bump_test(driven)
