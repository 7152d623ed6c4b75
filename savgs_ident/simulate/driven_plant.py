"""A plant that is held against the force of its drive along a measured motion: which test, and what is typical there.

Under closed loop the position hides what a model lacks (:mod:`savgs_ident.responses.driven_motion`). A plant with one
coordinate and one input is taken so wherever its recordings have no harmonic dwell.
"""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.core.values import as_values
from savgs_ident.effects.base import Port, PortKind
from savgs_ident.plants.base import AbstractPlant
from savgs_ident.plants.model import Model, PlantModel
from savgs_ident.recordings.recording import Campaign
from savgs_ident.responses.driven_motion import DrivenMotion, recorded_motion
from savgs_ident.simulate.along_motion import Samples, force_gain

FORCE_SHARE = 0.35
"""Share of the drive's force that a law at a port typically has where it matters. Origin: by choice, about that of
the friction of a screw drive."""

DRIVE_SHARE = 0.1
"""Share of its force by which a drive is typically off. Origin: by choice."""


def is_driven(plant: AbstractPlant | type[AbstractPlant]) -> bool:
    """Whether a plant can be held against the force of its drive along a measured motion."""
    return len(plant.coordinates) == 1 and len(plant.inputs) == 1


def motion_in(campaign: Campaign, model: Model) -> DrivenMotion | None:
    """The motion along which a model is held against its drive; None where that is not how it is held.

    Raises :class:`InputError` as :func:`longest_motion` does.
    """
    if not is_driven(model.plant) or campaign.of_kind("dwell"):
        return None
    return longest_motion(campaign, model)


def longest_motion(campaign: Campaign, model: Model) -> DrivenMotion:
    """The longest test of a campaign that is not at rest, as a motion of a plant with one coordinate and its drive.

    Raises :class:`InputError` where no channel reads the coordinate, or the test cannot be used.
    """
    plant = model.plant
    (coordinate,), (drive,) = plant.coordinates, plant.inputs
    reading = next((each.name for each in plant.channels if each.unit == coordinate.unit), None)
    if reading is None:
        raise InputError(
            f"no channel of {model.plant_name} reads '{coordinate.name}' in {coordinate.unit}",
            source=campaign.source,
            remedy="record harmonic dwells, or declare the channel of the measured motion",
        )
    moving = [each for each in campaign.recordings if each.kind != "standstill"]
    if not moving:
        raise InputError("nothing moves in it", source=campaign.source, remedy="record a motion")
    test = max(moving, key=lambda each: each.duration_s)
    motion = recorded_motion(test, reading, drive.name, campaign.source)
    if len(moving) == 1:
        return motion
    others = DataWarning(
        "tests_not_used",
        f"of {len(moving)} motions only the longest is compared, '{test.name}'",
        source=campaign.source,
        remedy="give another as a file of its own by --held-out: it is predicted, and compared",
    )
    return replace(motion, warnings=(*motion.warnings, others))


def samples_of(motion: DrivenMotion) -> Samples:
    """A measured motion as the equations take it."""
    speed = 2.0 * np.pi / motion.period
    angle = speed * motion.step * np.arange(motion.position.size)
    signals = (
        motion.position,
        motion.velocity,
        motion.acceleration,
        motion.drive,
        np.gradient(motion.drive, motion.step),
        angle,
        np.full_like(angle, speed),
    )
    return Samples(*(jnp.asarray(each) for each in signals))


def sized_along(model: Model, motion: DrivenMotion) -> Model:
    """The model with effects as large as matters along a motion, whatever unit its force was recorded in.

    Raises :class:`InputError` for a plant that is not held against its drive.
    """
    if not is_driven(model.plant):
        raise InputError(
            f"{model.name} is no plant with one coordinate and one input, its drive",
            source=motion.source,
            remedy="give a recording of dwells, or a plant that is driven along the measured motion",
        )
    if not isinstance(model, PlantModel):
        return model
    force = float(np.sqrt(np.mean(motion.rows(motion.drive) ** 2)))
    bare, p = replace(model.build(), effects=()), as_values(model.table.as_dict())

    def sized(port: Port) -> Port:
        if port.kind is PortKind.INPUT:
            return replace(port, displacement=DRIVE_SHARE * force)
        along = np.asarray(force_gain(bare, p, samples_of(motion), motion.step, port.name))
        gain = float(np.sqrt(np.mean(along**2)))
        return replace(port, force=FORCE_SHARE * force / gain) if gain > 0.0 else port

    kinds = (PortKind.FORCE, PortKind.INPUT)
    return model.sized({port.name: sized(port) for port in bare.ports if port.kind in kinds})
