"""System identification and sim-to-real diagnosis for a quarter-car suspension rig.

    import savgs_ident as si

    campaign = si.load_campaign("campaign.csv.gz")
    model = si.QuarterCar(si.load_rig()) + "rail_coulomb" + "tyre_friction"
    fit = si.fit(model, campaign)
    print(fit["mu_r"].value, fit.trusted)

What is listed here is the public interface, for the rig and for plants of your own (:class:`PlantModel`); every
command of ``savgs-ident`` is one call of it. Results print, show themselves in a notebook, and write JSON, HTML and
all files of the command (:class:`Result`). Names are loaded when they are used first: ``import savgs_ident`` itself
loads nothing.
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

__version__ = "0.1.0"

if TYPE_CHECKING:
    from savgs_ident.campaigns.run import run_campaigns
    from savgs_ident.campaigns.study import CampaignRow, CampaignStudy
    from savgs_ident.campaigns.trends import Trend
    from savgs_ident.control.closed_loop.programme import Ride, RideGain
    from savgs_ident.control.closed_loop.study import LoopStudy
    from savgs_ident.control.design import Design, DigitalController
    from savgs_ident.control.linear_study import LinearStudy
    from savgs_ident.control.public import close_loop, design, linearise
    from savgs_ident.control.synthesis import Margins
    from savgs_ident.core.errors import DataWarning, InputError
    from savgs_ident.core.parameter import Parameter, ParameterTable
    from savgs_ident.core.presentation import Origin, Result
    from savgs_ident.core.status import Status
    from savgs_ident.diagnosis.gap import Shrink
    from savgs_ident.diagnosis.public import diagnose
    from savgs_ident.diagnosis.result import Candidate, Diagnosis, Hypothesis, NextTest, PortShare, Verdict
    from savgs_ident.diagnosis.result import Estimate as ParameterInterval
    from savgs_ident.diagnosis.thresholds import DecisionConstants
    from savgs_ident.effects.base import Number, Port, PortKind, PortSignals
    from savgs_ident.effects.effect import Effect, generic_effects
    from savgs_ident.export.exported_model import ExportedModel
    from savgs_ident.export.json_export import read_model_json
    from savgs_ident.export.public import Exported, export
    from savgs_ident.export.python_control_export import load_python_control, resting_point
    from savgs_ident.fit.along_motion import HeldOutForce, MotionComparison, MotionFit
    from savgs_ident.fit.estimate import Estimate
    from savgs_ident.fit.identified import Verdict as Identifiability
    from savgs_ident.fit.public import Comparison, compare, demo, fit
    from savgs_ident.fit.result import Fit
    from savgs_ident.fit.sampling import sample
    from savgs_ident.inference.result import (
        Convergence,
        HarmonicPosterior,
        Marginal,
        MotionPosterior,
        Posterior,
    )
    from savgs_ident.plants.axis import Axis
    from savgs_ident.plants.base import AbstractPlant, Channel, Coordinate, Input
    from savgs_ident.plants.from_file import load_plant
    from savgs_ident.plants.model import Model, PlantModel
    from savgs_ident.plants.quarter_car.model import RigModel as QuarterCar
    from savgs_ident.plants.quarter_car.model import load_baseline, load_model, load_rig
    from savgs_ident.plants.quarter_car.rig import Rig, default_campaign_path
    from savgs_ident.plants.quarter_car.rig_recordings import load_campaign
    from savgs_ident.plants.state_space import State, StateSpacePlant
    from savgs_ident.plants.two_mass import TwoMass
    from savgs_ident.recordings.channels import ChannelMap
    from savgs_ident.recordings.recording import Campaign, RecordedChannel, Recording, RecordingLayout
    from savgs_ident.report.presenters import plot_bode
    from savgs_ident.responses.driven_motion import DrivenMotion
    from savgs_ident.responses.harmonic_response import HarmonicResponse
    from savgs_ident.responses.recorded_motion import is_motion, load_motion
    from savgs_ident.responses.summary import CampaignSummary, inspect
    from savgs_ident.simulate.public import (
        DWELLS,
        SimulatedResponse,
        SimulatedSweep,
        simulate,
        simulate_dwells,
        simulate_sweep,
    )
    from savgs_ident.validation.blind import BlindStudy, blind
    from savgs_ident.validation.blind_like import blind_like
    from savgs_ident.validation.calibration import CalibrationStudy, calibrate
    from savgs_ident.validation.check_plant import PlantCheck, check_plant
    from savgs_ident.validation.false_alarms import AlarmStudy, false_alarms
    from savgs_ident.validation.plan import CampaignPlan, PlannedTest, plan
    from savgs_ident.validation.planned_dwells import PlannedEffect
    from savgs_ident.validation.plant_declaration import Finding
    from savgs_ident.validation.virtual_campaign import draw_truth, simulate_campaign, write_campaign

_PLACES = {
    # What there is to work on.
    "load_rig": "plants.quarter_car.model",
    "load_model": "plants.quarter_car.model",
    "load_baseline": "plants.quarter_car.model",
    "load_campaign": "plants.quarter_car.rig_recordings",
    "load_motion": "responses.recorded_motion",
    "is_motion": "responses.recorded_motion",
    "ChannelMap": "recordings.channels",
    "RecordingLayout": "recordings.recording",
    "default_campaign_path": "plants.quarter_car.rig",
    "QuarterCar": "plants.quarter_car.model:RigModel",
    # Plants of your own.
    "AbstractPlant": "plants.base",
    "Axis": "plants.axis",
    "Channel": "plants.base",
    "Coordinate": "plants.base",
    "Effect": "effects.effect",
    "Input": "plants.base",
    "Model": "plants.model",
    "Number": "effects.base",
    "Parameter": "core.parameter",
    "ParameterTable": "core.parameter",
    "PlantModel": "plants.model",
    "Port": "effects.base",
    "PortKind": "effects.base",
    "PortSignals": "effects.base",
    "State": "plants.state_space",
    "StateSpacePlant": "plants.state_space",
    "TwoMass": "plants.two_mass",
    "generic_effects": "effects.effect",
    "load_plant": "plants.from_file",
    # What is done with it, a command each.
    "check_plant": "validation.check_plant",
    "plan": "validation.plan",
    "demo": "fit.public",
    "inspect": "responses.summary",
    "fit": "fit.public",
    "compare": "fit.public",
    "simulate": "simulate.public",
    "simulate_sweep": "simulate.public",
    "sample": "fit.sampling",
    "calibrate": "validation.calibration",
    "diagnose": "diagnosis.public",
    "DecisionConstants": "diagnosis.thresholds",
    "false_alarms": "validation.false_alarms",
    "blind": "validation.blind",
    "blind_like": "validation.blind_like",
    "linearise": "control.public",
    "design": "control.public",
    "close_loop": "control.public",
    "export": "export.public",
    "run_campaigns": "campaigns.run",
    "plot_bode": "report.presenters",
    # What was exported, read back.
    "read_model_json": "export.json_export",
    "load_python_control": "export.python_control_export",
    "resting_point": "export.python_control_export",
    # Campaigns of rigs whose truth is known.
    "DWELLS": "simulate.public",
    "draw_truth": "validation.virtual_campaign",
    "simulate_campaign": "validation.virtual_campaign",
    "write_campaign": "validation.virtual_campaign",
    "simulate_dwells": "simulate.public",
    # What comes out.
    "Result": "core.presentation",
    "AlarmStudy": "validation.false_alarms",
    "BlindStudy": "validation.blind",
    "CalibrationStudy": "validation.calibration",
    "CampaignPlan": "validation.plan",
    "CampaignStudy": "campaigns.study",
    "Campaign": "recordings.recording",
    "CampaignSummary": "responses.summary",
    "Comparison": "fit.public",
    "Design": "control.design",
    "Diagnosis": "diagnosis.result",
    "DigitalController": "control.design",
    "DrivenMotion": "responses.driven_motion",
    "Exported": "export.public",
    "ExportedModel": "export.exported_model",
    "Fit": "fit.result",
    "HarmonicResponse": "responses.harmonic_response",
    "InputError": "core.errors",
    "LinearStudy": "control.linear_study",
    "LoopStudy": "control.closed_loop.study",
    "PlantCheck": "validation.check_plant",
    "MotionComparison": "fit.along_motion",
    "MotionFit": "fit.along_motion",
    "MotionPosterior": "inference.result",
    "Posterior": "inference.result",
    "Rig": "plants.quarter_car.rig",
    "SimulatedResponse": "simulate.public",
    "SimulatedSweep": "simulate.public",
    # What results consist of.
    "CampaignRow": "campaigns.study",
    "Candidate": "diagnosis.result",
    "Convergence": "inference.result",
    "DataWarning": "core.errors",
    "Estimate": "fit.estimate",
    "Finding": "validation.plant_declaration",
    "HarmonicPosterior": "inference.result",
    "HeldOutForce": "fit.along_motion",
    "Hypothesis": "diagnosis.result",
    "Identifiability": "fit.identified:Verdict",
    "Marginal": "inference.result",
    "Margins": "control.synthesis",
    "NextTest": "diagnosis.result",
    "Origin": "core.presentation",
    "ParameterInterval": "diagnosis.result:Estimate",
    "PlannedEffect": "validation.planned_dwells",
    "PlannedTest": "validation.plan",
    "PortShare": "diagnosis.result",
    "RecordedChannel": "recordings.recording",
    "Recording": "recordings.recording",
    "Ride": "control.closed_loop.programme",
    "RideGain": "control.closed_loop.programme",
    "Shrink": "diagnosis.gap",
    "Status": "core.status",
    "Trend": "campaigns.trends",
    "Verdict": "diagnosis.result",
}
"""Where each public name is defined, with the name that it has there if that is another one."""

__all__ = [
    "DWELLS",
    "AbstractPlant",
    "AlarmStudy",
    "Axis",
    "BlindStudy",
    "CalibrationStudy",
    "Campaign",
    "CampaignPlan",
    "CampaignRow",
    "CampaignStudy",
    "CampaignSummary",
    "Candidate",
    "Channel",
    "ChannelMap",
    "Comparison",
    "Convergence",
    "Coordinate",
    "DataWarning",
    "DecisionConstants",
    "Design",
    "Diagnosis",
    "DigitalController",
    "DrivenMotion",
    "Effect",
    "Estimate",
    "Exported",
    "ExportedModel",
    "Finding",
    "Fit",
    "HarmonicPosterior",
    "HarmonicResponse",
    "HeldOutForce",
    "Hypothesis",
    "Identifiability",
    "Input",
    "InputError",
    "LinearStudy",
    "LoopStudy",
    "Marginal",
    "Margins",
    "Model",
    "MotionComparison",
    "MotionFit",
    "MotionPosterior",
    "NextTest",
    "Number",
    "Origin",
    "Parameter",
    "ParameterInterval",
    "ParameterTable",
    "PlannedEffect",
    "PlannedTest",
    "PlantCheck",
    "PlantModel",
    "Port",
    "PortKind",
    "PortShare",
    "PortSignals",
    "Posterior",
    "QuarterCar",
    "RecordedChannel",
    "Recording",
    "RecordingLayout",
    "Result",
    "Ride",
    "RideGain",
    "Rig",
    "Shrink",
    "SimulatedResponse",
    "SimulatedSweep",
    "State",
    "StateSpacePlant",
    "Status",
    "Trend",
    "TwoMass",
    "Verdict",
    "blind",
    "blind_like",
    "calibrate",
    "check_plant",
    "close_loop",
    "compare",
    "default_campaign_path",
    "demo",
    "design",
    "diagnose",
    "draw_truth",
    "export",
    "false_alarms",
    "fit",
    "generic_effects",
    "inspect",
    "is_motion",
    "linearise",
    "load_baseline",
    "load_campaign",
    "load_model",
    "load_motion",
    "load_plant",
    "load_python_control",
    "load_rig",
    "plan",
    "plot_bode",
    "read_model_json",
    "resting_point",
    "run_campaigns",
    "sample",
    "simulate",
    "simulate_campaign",
    "simulate_dwells",
    "simulate_sweep",
    "write_campaign",
]


def __getattr__(name: str) -> object:
    """The public ``name``, loaded now and kept (PEP 562)."""
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, _, inner = _PLACES[name].partition(":")
    found = getattr(import_module(f"{__name__}.{module}"), inner or name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return [*__all__, "__version__"]


class _Package(ModuleType):
    """This package, in which ``fit``, ``simulate`` and ``export`` are calls.

    There are rooms of the same name. When one is loaded, the import system puts it in its parent as an attribute,
    which would hide the call; the room itself is found by ``from savgs_ident.fit.result import ...`` as ever.
    """

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in _PLACES and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
