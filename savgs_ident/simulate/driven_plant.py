"""A plant that is held against the force of its drive along a measured motion: which test, and what is typical there.

Under closed loop the position hides what a model lacks (:mod:`savgs_ident.responses.driven_motion`). A plant with one
coordinate whose first input is its drive is taken so wherever its recordings have no harmonic dwell.
"""

from collections.abc import Sequence
from dataclasses import replace

import jax.numpy as jnp
import numpy as np

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.presentation import Origin
from savgs_ident.core.values import as_values
from savgs_ident.effects.base import InputSignal, Port, PortKind
from savgs_ident.effects.laws.input_offset import MOTIONS
from savgs_ident.plants.base import AbstractPlant, Input
from savgs_ident.plants.model import Model, PlantModel
from savgs_ident.recordings.recording import Campaign
from savgs_ident.responses.driven_motion import DrivenMotion, joined
from savgs_ident.responses.even_record import is_decay
from savgs_ident.responses.recorded_motion import recorded_motion, recorded_speed
from savgs_ident.simulate.along_motion import Samples, force_gain
from savgs_ident.simulate.compared_tests import Measurements

FORCE_SHARE = 0.35
"""Share of the drive's force that a law at a port typically has where it matters. Origin: by choice, about that of
the friction of a screw drive."""

DRIVE_SHARE = 0.1
"""Share of its force by which a drive is typically off. Origin: by choice."""


def is_driven(plant: AbstractPlant | type[AbstractPlant]) -> bool:
    """Whether a plant can be held against the force of its drive, its first input, along a measured motion.

    An input that is a motion itself, as a road is, is no drive.
    """
    if len(plant.coordinates) != 1:
        return False
    return plant.inputs[0].unit not in MOTIONS


def _is_held_against_drive(campaign: Campaign, model: Model) -> bool:
    """Whether a model is held against the force of its drive along the motions of a campaign.

    Not where there are dwells, whose response it predicts, or decays, which no drive drives.
    """
    drive = [model.plant.inputs[0].name]
    predicted = campaign.of_kind("dwell") or any(is_decay(each, drive) for each in campaign.recordings)
    return is_driven(model.plant) and not predicted and bool(_reading(model.plant))


def held_against(measured: Measurements | DrivenMotion, model: Model) -> Measurements | DrivenMotion:
    """What a model is held against: the motions of a campaign where it is held against its drive, else all as given.

    Raises :class:`InputError` as :func:`motion_of` does.
    """
    if isinstance(measured, Campaign) and _is_held_against_drive(measured, model):
        return motion_of(measured, model)
    return measured


def motion_of(campaign: Campaign, model: Model) -> DrivenMotion:
    """All tests of a campaign that are not at rest, as motions of a plant with one coordinate and its drive.

    Raises :class:`InputError` for a plant that is not held against its drive, where no channel reads the coordinate
    or its rate, and where no test can be used.
    """
    plant = model.plant
    _refuse_undriven(model, campaign.source)
    (coordinate,), (drive, *others) = plant.coordinates, plant.inputs
    reading = _reading(plant)
    if not reading:
        raise InputError(
            f"no channel of {model.plant_name} reads '{coordinate.name}' in {coordinate.unit}, or its rate",
            source=campaign.source,
            remedy="record harmonic dwells, or declare the channel of the measured motion",
        )
    is_rate = next(each.unit for each in plant.channels if each.name == reading) != coordinate.unit
    recorded = recorded_speed if is_rate else recorded_motion
    moving = [each for each in campaign.recordings if each.kind != "standstill"]
    if not moving:
        raise InputError("nothing moves in it", source=campaign.source, remedy="record a motion")
    found: list[DrivenMotion] = []
    refused: list[InputError] = []
    for test in moving:
        try:
            known = [each.name for each in others if each.required or each.name in test.channels]
            found.append(
                _with_rest(recorded(test, reading, drive.name, campaign.source, known), others, model.table)
            )
        except InputError as error:
            refused.append(error)
    if not found:
        raise refused[0]
    motion = joined(found, campaign.source)
    left_out = tuple(error.as_warning("tests_not_used") for error in refused)
    return replace(motion, warnings=(*campaign.warnings, *motion.warnings, *left_out))


def _with_rest(motion: DrivenMotion, inputs: Sequence[Input], table: ParameterTable) -> DrivenMotion:
    """The motion with further inputs in their order, at rest where they were not recorded and need not be."""
    rest = {each.name: table[each.rest].value if each.rest else 0.0 for each in inputs}
    still = {name: np.full(motion.position.size, value) for name, value in rest.items()}
    return replace(motion, beside=still | dict(motion.beside))


def _refuse_undriven(model: Model, source: str) -> None:
    if not is_driven(model.plant):
        raise InputError(
            f"{model.name} is no plant with one coordinate whose first input is its drive",
            source=source,
            remedy="give a recording of dwells, or a plant that is driven along the measured motion",
        )


def _reading(plant: AbstractPlant | type[AbstractPlant]) -> str:
    """Name of the channel that reads the coordinate of a plant, or else its rate; empty where none does."""
    (coordinate,) = plant.coordinates
    read = {each.unit: each.name for each in reversed(plant.channels)}
    return read.get(coordinate.unit) or read.get(f"{coordinate.unit}/s", "")


def samples_of(motion: DrivenMotion, plant: AbstractPlant | type[AbstractPlant]) -> Samples:
    """A measured motion as the equations of a plant take it.

    Raises :class:`InputError` where it lacks one of the plant's further inputs.
    """
    others = [each.name for each in plant.inputs[1:]]
    lacking = [name for name in others if name not in motion.beside]
    if lacking:
        raise InputError(
            f"the motion lacks the input '{lacking[0]}'",
            source=motion.source,
            channel=lacking[0],
            remedy="give the recordings as a campaign, in which each input is a channel",
        )
    speed = 2.0 * np.pi / motion.period
    angle = speed * motion.step * np.arange(motion.position.size)
    return Samples(
        q=jnp.asarray(motion.position),
        qd=jnp.asarray(motion.velocity),
        qdd=jnp.asarray(motion.acceleration),
        drive=jnp.asarray(motion.drive),
        drive_rate=jnp.asarray(motion.rate(motion.drive)),
        angle=jnp.asarray(angle),
        speed=jnp.full(angle.size, speed),
        begins=jnp.asarray(motion.begins),
        beside=tuple(
            InputSignal(jnp.asarray(each), jnp.asarray(motion.rate(each)))
            for each in (motion.beside[name] for name in others)
        ),
    )


def origin_along(model: Model, motion: DrivenMotion, command: Sequence[str] = ()) -> Origin:
    """Where results on a model along a measured motion come from."""
    return replace(model.origin(warnings=motion.warnings), data=motion.source, command=tuple(command))


def sized_along(model: Model, motion: DrivenMotion) -> Model:
    """The model with effects as large, and as fast, as matters along a motion, whatever unit its force is in.

    Raises :class:`InputError` for a plant that is not held against its drive.
    """
    _refuse_undriven(model, motion.source)
    if not isinstance(model, PlantModel):
        return model
    force = float(np.sqrt(np.mean(motion.rows(motion.drive) ** 2)))
    model = replace(model, plant=replace(model.plant, time_scale=motion.time_scale))
    bare, p = replace(model.build(), effects=()), as_values(model.table.as_dict())

    def sized(port: Port) -> Port:
        if port.kind is PortKind.INPUT and port.location == bare.inputs[0].name:
            return replace(port, displacement=DRIVE_SHARE * force)
        if port.kind is not PortKind.FORCE:
            return port
        along = np.asarray(force_gain(bare, p, samples_of(motion, bare), motion.step, port.name))
        gain = float(np.sqrt(np.mean(along**2)))
        return replace(port, force=FORCE_SHARE * force / gain) if gain > 0.0 else port

    return model.sized({port.name: sized(port) for port in bare.scaled_ports})
