"""The effects of the quarter-car rig by name, and the models that are made of them.

A name is a law (:mod:`savgs_ident.effects.laws`) at a port (:mod:`savgs_ident.plants.quarter_car.ports`), with a
parameter for every number that the law takes: one of its own, one of the rig's sheet by name, or a number that stays
as it is. To add a name, add an entry to ``CATALOGUE``.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from types import MappingProxyType

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import Parameter, ParameterTable, merge_parameters
from savgs_ident.effects.effect import Effect, effect_at
from savgs_ident.effects.laws.asymmetry import Asymmetry
from savgs_ident.effects.laws.attached_oscillator import AttachedOscillator
from savgs_ident.effects.laws.backlash import Backlash
from savgs_ident.effects.laws.compliance import Compliance
from savgs_ident.effects.laws.coulomb import Coulomb
from savgs_ident.effects.laws.delay import Delay
from savgs_ident.effects.laws.gain import Gain
from savgs_ident.effects.laws.input_harmonics import InputHarmonics
from savgs_ident.effects.laws.input_scale import InputScale
from savgs_ident.effects.laws.lag import Lag
from savgs_ident.effects.laws.linear_stiffness import LinearStiffness
from savgs_ident.effects.laws.massive_compliance import MassiveCompliance
from savgs_ident.effects.laws.offset import Offset
from savgs_ident.effects.laws.one_sided_damping import OneSidedDamping
from savgs_ident.effects.laws.preload import Preload
from savgs_ident.effects.laws.presliding_friction import PreslidingFriction
from savgs_ident.effects.laws.progressive_stiffness import ProgressiveStiffness
from savgs_ident.effects.laws.resonance import Resonance
from savgs_ident.effects.laws.saturating_friction import SaturatingFriction
from savgs_ident.effects.laws.scale import Scale
from savgs_ident.effects.laws.stop import LowerStop
from savgs_ident.effects.laws.stribeck import Stribeck
from savgs_ident.effects.laws.tilt import Tilt
from savgs_ident.effects.laws.viscous import Viscous
from savgs_ident.effects.learned import learned_effect
from savgs_ident.effects.learned_functions import functions_at
from savgs_ident.plants.quarter_car.forces import damper_curve
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.ports import (
    ACCEL,
    CARCASS,
    DAMPER,
    DEFLECTION,
    FRAME,
    INERTIA,
    LINK,
    LINK_NUMBERS,
    MOUNT,
    PLATE,
    PORTS,
    RAIL,
    ROAD,
    STRUT,
    STRUT_NUMBERS,
    SUSPENSION,
    TYRE_LATERAL,
    TYRE_NUMBERS,
    TYRE_RADIAL,
)
from savgs_ident.plants.quarter_car.rig import Rig


def _by_name(*effects: Effect) -> Mapping[str, Effect]:
    return MappingProxyType({effect.name: effect for effect in effects})


def _own(name: str, value: float, unit: str, lower: float, upper: float, about: str) -> Parameter:
    """A parameter of which nothing is known beforehand but its bounds [``unit``]."""
    return Parameter(name, value, unit, lower=lower, upper=upper, about=about)


# fmt: off
CATALOGUE: Mapping[str, Effect] = _by_name(
    # Friction of the railway carriages, eqs. (1)-(2) of the paper; how they stick is the sheet's.
    effect_at("rail_coulomb", RAIL, Coulomb(),
        {"coefficient": _own("mu_r", 0.03, "1", 0.0, 0.5, "rail friction coefficient")},
        brings=(
            Parameter("k_pre", 1e7, "N/m", tolerance=1e6, lower=1e5, about="presliding stiffness of the rail"),
            Parameter("c_pre", 3e4, "N s/m", tolerance=3000.0, lower=0.0, about="presliding damping of the rail"),
        ),
        symptom="the sprung mass sticks at each reversal and odd orders of its acceleration grow",
        reference="Yu et al. 2017, eqs. (1)-(2)",
    ),
    effect_at("rail_preload", RAIL, Preload(),
        {"force": _own("rail_preload_force", 30.0, "N", 0.0, 3000.0, "friction of the rail without load")},
        symptom="the sprung mass sticks at each reversal, however little the rail carries",
        reference="Altintas et al. 2011, Machine tool feed drives, CIRP Annals 60(2), on preloaded guideways",
    ),
    effect_at("rail_stribeck", RAIL, Stribeck(),
        {
            "coefficient": "mu_r",
            "rise": _own("stribeck_rise", 0.1, "1", 0.0, 5.0, "rise of rail friction at rest"),
            "velocity": _own("stribeck_velocity", 0.08, "m/s", 2e-3, 1.0, "Stribeck velocity of the rail"),
        },
        symptom="friction is highest where the body turns round: slow tests stick more than fast ones",
        reference="Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30(7)",
    ),
    effect_at("rail_viscous", RAIL, Viscous(),
        {"damping": _own("rail_viscous_damping", 60.0, "N s/m", 0.0, 5000.0, "viscous damping of the rail")},
        symptom="the resonance is lower and nothing sticks: the waveform stays a sine",
        reference="Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30(7)",
    ),
    effect_at("rail_asymmetry", RAIL, Asymmetry(),
        {
            "coefficient": "mu_r",
            "asymmetry": _own(
                "rail_asymmetry", 0.2, "1", -0.95, 0.95, "rail friction up over the mean of up and down, less one"),
        },
        symptom="the acceleration steps more at one reversal than at the other: even orders appear",
        reference="Armstrong-Helouvry 1991, Control of Machines with Friction",
    ),
    # Slides after 0.1 mm; damping over stiffness of what sticks as in the sheet's rail.
    effect_at("joint_friction", SUSPENSION, PreslidingFriction(),
        {
            "force": _own("joint_friction_force", 20.0, "N", 0.0, 3000.0, "friction of the joints, at the wheel"),
            "stretch": 1e-4,
            "lag": 3e-3,
        },
        states=("joint_anchor",),
        symptom="the suspension sticks where its deflection turns round: it moves too little at small roads",
        reference="Dupont, Hayward, Armstrong, Altpeter 2002, IEEE Transactions on Automatic Control 47(5)",
    ),
    effect_at("bushing_stiffness", SUSPENSION, LinearStiffness(),
        {"stiffness": _own(
            "bushing_stiffness", 1500.0, "N/m", -2e4, 6e4, "stiffness of the bushings, at the wheel")},
        symptom="the resonance moves up as with a stiffer spring, but not with the link's angle",
        reference="Blundell and Harty 2004, The Multibody Systems Approach to Vehicle Dynamics, on bushes",
    ),
    # Little damping of what sticks, for the damper is beside it.
    effect_at("strut_friction", STRUT, PreslidingFriction(),
        {
            "force": _own("strut_friction_force", 30.0, "N", 0.0, 3000.0, "friction of the strut's seals"),
            "stretch": 1e-4,
            "lag": 3e-4,
        },
        states=("strut_anchor",),
        symptom="the strut sticks where it turns round: slow tests are stiffer than fast ones",
        reference="Dixon 2007, The Shock Absorber Handbook, on seal friction",
    ),
    # The strut's length was measured with the rig standing on it.
    effect_at("mount_compliance", MOUNT, Compliance(),
        {
            "compliance": _own("mount_compliance", 5e-7, "m/N", 0.0, 2e-5, "compliance of the top mount"),
            "damping": _own("mount_damping", 500.0, "N s/m", 0.0, 5e4, "damping of the top mount"),
        },
        states=("mount_deflection",),
        symptom="the suspension is softer and the damper acts less, the more so the faster it moves",
        reference="Dixon 2007, The Shock Absorber Handbook, on mount bushes in series",
    ),
    effect_at("spring_rate", STRUT_NUMBERS, Scale(),
        {
            "number": "k_sd",
            "change": _own("spring_rate_change", 0.05, "1", -0.6, 1.5, "relative change of the spring rate"),
        },
        symptom="the resonance moves, its damping hardly changes",
        reference="Gillespie 1992, Fundamentals of Vehicle Dynamics, ch. 5",
    ),
    effect_at("damper_scale", STRUT_NUMBERS, Scale(),
        {
            "number": "c_sd",
            "change": _own("damper_scale_change", 0.1, "1", -0.95, 3.0, "relative change of the damping"),
        },
        symptom="the resonance is sharper or blunter at the same frequency",
        reference="Dixon 2007, The Shock Absorber Handbook, on tolerances and temperature",
    ),
    effect_at("damper_rebound_fade", STRUT, OneSidedDamping(),
        {"lost": _own("damper_rebound_fade", 0.15, "1", -1.0, 0.95, "share of the rebound force that is lost")},
        symptom="less damping in rebound than in bump: the body rides higher and even orders change",
        reference="Dixon 2007, The Shock Absorber Handbook, on cavitation and leakage",
    ),
    # Oil, gas and rubber bushes: the damper's force lags behind the velocity, a loop over it.
    effect_at("damper_hysteresis", DAMPER, Compliance(),
        {
            "compliance": _own("damper_compliance", 5e-7, "m/N", 0.0, 1e-4, "compliance in series with the damper"),
            "damping": 0.0,
        },
        states=("damper_deflection",),
        symptom="the damper acts less and stiffens the suspension, the more so the faster it moves",
        reference="Duym 2000, Vehicle System Dynamics 33(4), on shock absorber models",
    ),
    effect_at("bump_stop", STRUT, LowerStop(),
        {
            "stiffness": _own("bump_stop_stiffness", 2e5, "N/m", 0.0, 1e7, "stiffness of the bump stop"),
            "gap": _own(
                "bump_stop_gap", 5e-3, "m", 0.0, 0.05, "strut travel from the nominal state to the bump stop"),
        },
        symptom="near the resonance the deflection is cut off in bump; small motions fit",
        reference="Milliken and Milliken 1995, Race Car Vehicle Dynamics, on bump stops",
    ),
    effect_at("tyre_friction", TYRE_LATERAL, SaturatingFriction(),
        {
            "coefficient": _own("mu_t", 0.25, "1", 0.0, 2.0, "tyre friction coefficient"),
            "velocity": _own("ydot_Hth", 0.05, "m/s", 1e-3, 1.0, "shaping velocity of tyre friction"),
        },
        symptom="the resonance is damped more at high scrub velocity; the rail load changes with it",
        reference="Yu et al. 2017, eq. (3)",
    ),
    effect_at("tyre_stiffness", TYRE_NUMBERS, Scale(),
        {
            "number": "k_t",
            "change": _own("tyre_stiffness_change", 0.1, "1", -0.6, 1.5, "relative change of the tyre's stiffness"),
        },
        symptom="the body moves more or less above the resonance; below it hardly anything changes",
        reference="Wong 2008, Theory of Ground Vehicles, ch. 1, ride properties of tyres",
    ),
    effect_at("tyre_stiffening", TYRE_RADIAL, ProgressiveStiffness(from_rest=False),
        {
            "stiffness": "k_t",
            "rise": _own(
                "tyre_stiffening", 5.0, "1/m", -15.0, 100.0, "rise of the tyre's secant stiffness per compression"),
        },
        symptom="the tyre is stiffer in the valleys of the motion than on its crests: even orders of the"
        " acceleration",
        reference="Pacejka 2012, Tire and Vehicle Dynamics, ch. 4, vertical load against deflection",
    ),
    # A sheet knows little about it: the change may be large.
    effect_at("tyre_damping", TYRE_NUMBERS, Scale(),
        {
            "number": "c_t",
            "change": _own("tyre_damping_change", 5.0, "1", -0.95, 20.0, "relative change of the tyre's damping"),
        },
        symptom="the phase of both channels lags or leads in the fast tests, the amplitude fits",
        reference="Wong 2008, Theory of Ground Vehicles, ch. 1, ride properties of tyres",
    ),
    # The tread stays behind when the wheel scrubs; the friction acts on a belt of 5 kg, damped by 1000 N s/m. The
    # compliance is that of a relaxation length of 0.5 m at a cornering stiffness of 70 kN/rad.
    effect_at("tyre_lateral_compliance", CARCASS, MassiveCompliance(),
        {
            "compliance": _own(
                "tyre_lateral_compliance", 7e-6, "m/N", 0.0, 1e-3, "lateral compliance of the carcass"),
            "damping": 1000.0,
            "mass": 5.0,
        },
        states=("carcass_deflection", "carcass_velocity"),
        symptom="tyre friction sets in late after each reversal and acts like a spring at small motions",
        reference="Pacejka 2012, Tire and Vehicle Dynamics, on relaxation length",
    ),
    # It changes flanks within 1 N m. The strut's load keeps the gear against one flank, and where it lets go, with
    # the link near 0 or 180 deg, it has no lever: passive tests show nothing of it. It shows where a strut that is
    # pulled turns the torque round, and where a drive takes the link through 0 or 180 deg.
    effect_at("gear_backlash", LINK, Backlash(),
        {
            "backlash": _own("gear_backlash", 0.01, "rad", 0.0, 0.2, "backlash of the gear, at the link"),
            "change_over": 1.0,
        },
        states=("gear_play",),
        symptom="the link knocks where its torque changes sign; where it does not, its angle is off by a constant",
        reference="Nordin and Gutman 2002, Automatica 38(10), survey of backlash",
    ),
    effect_at("gear_compliance", LINK, Compliance(),
        {
            "compliance": _own(
                "gear_compliance", 1e-3, "rad/(N m)", 0.0, 0.01, "torsional compliance of gear and link"),
            "damping": 0.0,
        },
        states=("gear_windup",),
        symptom="the suspension is softer where the link stands across the strut, and not where it is in line",
        reference="Spong 1987, Journal of Dynamic Systems, Measurement, and Control 109(4), on elastic joints",
    ),
    # The encoder counts from where it takes link and strut to be in line; the crank is further on than it reads.
    effect_at("link_offset", LINK_NUMBERS, Offset(),
        {
            "number": "theta_0",
            "change": _own(
                "link_offset", 0.2, "rad", -0.5, 0.5, "true angle of the link less the one of its encoder"),
        },
        symptom="passive tests at 90 deg hardly change; away from it the leverage of the link is off",
        reference="Mooring, Roth, Driels 1991, Fundamentals of Manipulator Calibration, on joint offsets",
    ),
    effect_at("cam_harmonic", ROAD, InputHarmonics(),
        {
            "cos_2": _own("cam_cos_2", 2e-4, "m", -0.01, 0.01, "second order of the cam, cosine"),
            "sin_2": _own("cam_sin_2", 2e-4, "m", -0.01, 0.01, "second order of the cam, sine"),
            "cos_3": _own("cam_cos_3", 2e-4, "m", -0.01, 0.01, "third order of the cam, cosine"),
            "sin_3": _own("cam_sin_3", 2e-4, "m", -0.01, 0.01, "third order of the cam, sine"),
        },
        symptom="the second or third order of both channels is off in every test, in step with the cam",
        reference="Norton 2009, Cam Design and Manufacturing Handbook, on profile errors",
    ),
    effect_at("cam_scale", ROAD, InputScale(),
        {"error": _own("cam_scale_change", 0.03, "1", -0.5, 0.5, "relative error of the cam's lift")},
        symptom="both channels are too large or too small at every frequency, friction aside",
        reference="a gain error of the cam encoder, or an exchanged cam",
    ),
    effect_at("plate_compliance", PLATE, Compliance(),
        {
            "compliance": _own("plate_compliance", 5e-7, "m/N", 0.0, 1e-5, "compliance of plate and follower"),
            "damping": 0.0,
        },
        states=("plate_deflection",),
        symptom="like a softer tyre without its damping; the body moves less than the plate says",
        reference="Koster 1974, Vibrations of Cam Mechanisms, on follower compliance",
    ),
    effect_at("frame_mode", FRAME, Resonance(),
        {
            "mobility": _own("frame_mobility", 2e-3, "1/kg", 0.0, 1.0, "one over the moving mass of the frame"),
            "frequency": _own("frame_frequency", 12.0, "Hz", 2.0, 80.0, "natural frequency of the frame"),
            "damping_ratio": _own("frame_damping_ratio", 0.05, "1", 5e-3, 1.0, "damping ratio of the frame"),
        },
        states=("frame_height", "frame_velocity"),
        symptom="orders near one frequency are too large whichever dwell they belong to",
        reference="Ewins 2000, Modal Testing, ch. 2, single degree of freedom",
    ),
    effect_at("sprung_mass", INERTIA, Offset(),
        {
            "number": "m_s",
            "change": _own("sprung_mass_change", 15.0, "kg", -100.0, 200.0, "sprung mass beyond the sheet's"),
        },
        symptom="the resonance moves and the rig stands lower or higher; wheel hop does not change",
        reference="Gillespie 1992, Fundamentals of Vehicle Dynamics, ch. 5",
    ),
    # The upright with its wheel takes the change; wishbones and all moments of inertia stay what they are.
    effect_at("unsprung_mass", INERTIA, Offset(),
        {
            "number": "m_u",
            "change": _own(
                "unsprung_mass_change", 8.0, "kg", -20.0, 40.0, "unsprung mass beyond the sheet's, at the upright"),
        },
        symptom="the fast tests change, the slow ones do not: wheel hop moves",
        reference="Gillespie 1992, Fundamentals of Vehicle Dynamics, ch. 5",
    ),
    # It hangs on the sprung mass: the force acts where that of the rail does.
    effect_at("body_oscillator", replace(RAIL, location="inertia"), AttachedOscillator(),
        {
            "mass": _own("body_oscillator_mass", 5.0, "kg", 0.0, 200.0, "mass that swings on the sprung mass"),
            "frequency": _own("body_oscillator_frequency", 5.0, "Hz", 0.5, 80.0, "its natural frequency"),
            "damping_ratio": _own("body_oscillator_damping_ratio", 0.05, "1", 5e-3, 1.0, "its damping ratio"),
        },
        states=("body_oscillator_height", "body_oscillator_velocity"),
        symptom="near one frequency the body moves too much just below and too little just above it",
        reference="Den Hartog 1956, Mechanical Vibrations, ch. 3, the dynamic vibration absorber",
    ),
    effect_at("accel_gain", ACCEL, Gain(),
        {"error": _own("accel_gain_error", 0.05, "1", -0.9, 2.0, "relative gain error of the accelerometer")},
        symptom="the acceleration alone is too large or too small by the same share in every test and order",
        reference="ISO 16063-21, calibration of vibration transducers by comparison",
    ),
    effect_at("accel_lag", ACCEL, Lag(),
        {"time": _own("accel_lag_time", 2e-3, "s", 0.0, 0.2, "time constant of the accelerometer")},
        symptom="the acceleration alone lags and shrinks with frequency; the deflection fits",
        reference="Doebelin 2004, Measurement Systems, ch. 3, first-order instruments",
    ),
    effect_at("accel_tilt", ACCEL, Tilt(),
        {"versine": _own(
            "accel_tilt_versine", 0.0075, "1", 0.0, 0.5, "one less the cosine of the accelerometer's tilt")},
        symptom="the acceleration alone is too small by the same share in every test and order",
        reference="Titterton and Weston 2004, Strapdown Inertial Navigation Technology, on misalignment",
    ),
    effect_at("deflection_gain", DEFLECTION, Gain(),
        {"error": _own("deflection_gain_error", 0.05, "1", -0.9, 2.0, "relative gain error of the potentiometer")},
        symptom="the deflection alone is too large or too small by the same share in every test and order",
        reference="Doebelin 2004, Measurement Systems, ch. 3, static calibration",
    ),
    effect_at("deflection_delay", DEFLECTION, Delay(),
        {"time": _own("deflection_delay_time", 2e-3, "s", 0.0, 0.2, "delay of the potentiometer's channel")},
        symptom="the deflection alone lags, in proportion to the frequency, and keeps its size",
        reference="Oppenheim and Willsky 1997, Signals and Systems, ch. 4, time shifting",
    ),
)
# fmt: on
"""All effects by name that a diagnosis looks for."""

LEARNED: Mapping[str, Effect] = _by_name(*(learned_effect(port) for port in PORTS if functions_at(port)))
"""Corrections by name that a diagnosis learns where it finds none of them."""

EFFECTS: Mapping[str, Effect] = MappingProxyType({**CATALOGUE, **LEARNED})
"""All that a model may have."""

MODELS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {"simqc": (), "simtr": ("rail_coulomb", "tyre_friction")}
)
"""The paper's models by the effects they add to the frictionless rig."""


def build_model(rig: Rig, effects: Iterable[str]) -> QuarterCar:
    """The rig with the named effects added, in that order.

    Raises :class:`InputError` for a name that is neither in the catalogue nor a learned correction.
    """
    model = QuarterCar(damper_curve(rig))
    for name in effects:
        if name not in EFFECTS:
            raise InputError(
                f"there is no effect '{name}'", remedy="choose among: " + ", ".join(sorted(EFFECTS))
            )
        model = model + EFFECTS[name]
    return model


def model_parameters(rig: Rig, effects: Iterable[str]) -> ParameterTable:
    """The rig's parameters and those that the named effects bring along."""
    return merge_parameters(rig.parameters, *(ParameterTable(EFFECTS[name].parameters) for name in effects))
