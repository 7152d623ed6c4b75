"""Along a measured motion, further inputs than the drive: the current of a damper's coil, by the damper's formula."""

from dataclasses import replace

import numpy as np
import pytest

import savgs_ident as si
from savgs_ident.core.errors import InputError
from savgs_ident.recordings.recording import Campaign, RecordedChannel, Recording
from savgs_ident.simulate.driven_plant import is_driven, motion_of, samples_of

RATE = 400.0
TRUTH = {"m": 0.8, "c_0": 450.0, "c_1": 350.0}


class Damper(si.StateSpacePlant):
    """A rod whose damping grows with the current."""

    states_declared = (
        si.State("x", "m", 0.01, "stroke"),
        si.State("v", "m/s", 0.1, "speed", rate_of="x"),
    )
    inputs = (
        si.Input("force", "N", "force", moves=(1e-4,)),
        si.Input("current", "A", "current", moves=(1e-2,)),
    )
    channels = (si.Channel("stroke", "m", "stroke"),)
    ports = (
        si.Port("seals", si.PortKind.FORCE, "damper", "stroke", displacement=0.01, velocity=0.1),
        si.Port("coil", si.PortKind.INPUT, "current", displacement_unit="A", displacement=0.05),
    )
    parameters = si.ParameterTable(
        (
            si.Parameter("m", 0.7, "kg", tolerance=0.2, lower=0.0, about="mass"),
            si.Parameter("c_0", 500.0, "N s/m", lower=0.0, upper=1e5, about="damping"),
            si.Parameter("c_1", 200.0, "N s/(m A)", lower=0.0, upper=1e5, about="damping by the current"),
        )
    )

    def rhs(self, x, u, p, f):  # type: ignore[no-untyped-def]
        """Acceleration."""
        damping = (p["c_0"] + p["c_1"] * u.current) * x.v
        return {"v": (u.force - damping + f.force(self.ports[0], x.x, x.v)) / p["m"]}

    def output(self, x, dx, u, p):  # type: ignore[no-untyped-def]
        """The stroke."""
        return (x.x,)


def run(name: str, hertz: float, current: float, later: float, rate: float = RATE) -> Recording:
    """A stroke of 10 mm, whose current changes half-way; the logger of the current has a clock of its own."""
    time, random = np.arange(round(12.0 * rate)) / rate, np.random.default_rng(round(10.0 * hertz))
    turned = 2.0 * np.pi * hertz
    x, v, a = 0.01 * np.sin(turned * time), 0.01 * turned * np.cos(turned * time), 0.0 * time
    a = -(turned**2) * x
    amps = np.where(time < 6.0, current, later)
    force = (
        TRUTH["m"] * a + (TRUTH["c_0"] + TRUTH["c_1"] * amps) * v + 0.3 * random.standard_normal(time.size)
    )
    clock = time[::2] + 1e-4
    channels = {
        "force": RecordedChannel("force", "N", time, force),
        "stroke": RecordedChannel("stroke", "m", time, x),
        "current": RecordedChannel("current", "A", clock, amps[::2]),
    }
    return Recording(name, "other", None, channels)


@pytest.fixture
def campaign() -> Campaign:
    tests = run("run_1", 1.3, 0.0, 0.0), run("run_2", 1.9, 0.3, 0.9), run("run_3", 2.3, 1.0, 0.2, 250.0)
    return Campaign("made", tests, (), "")


def test_it_is_brought_along_in_the_order_of_the_inputs(campaign: Campaign) -> None:
    model = si.PlantModel(Damper(), Damper.parameters)
    assert is_driven(Damper())
    motion = motion_of(campaign, model)
    (current,) = samples_of(motion, Damper()).beside
    assert list(motion.beside) == ["current"]
    assert current.value.shape == motion.position.shape
    begun = np.asarray(motion.starts)
    np.testing.assert_allclose(np.asarray(current.value)[begun + 10], [0.0, 0.3, 1.0], atol=1e-9)
    without = {name: each for name, each in campaign.recordings[0].channels.items() if name != "current"}
    with pytest.raises(InputError, match="was not recorded"):
        motion_of(Campaign("made", (Recording("run", "other", None, without),), (), ""), model)


def test_one_that_need_not_be_recorded_rests_and_one_that_is_lacking_is_named(campaign: Campaign) -> None:
    class Optional(Damper):
        inputs = (Damper.inputs[0], replace(Damper.inputs[1], required=False))

    tests = list(campaign.recordings)
    known = {name: each for name, each in tests[1].channels.items() if name != "current"}
    tests[1] = replace(tests[1], channels=known)
    motion = motion_of(
        replace(campaign, recordings=tuple(tests)), si.PlantModel(Optional(), Damper.parameters)
    )
    begun = np.asarray(motion.starts)
    assert begun.size == 3
    assert not motion.beside["current"][begun[1] : begun[2]].any()
    assert motion.beside["current"][begun[2]] == pytest.approx(1.0)
    with pytest.raises(InputError, match="lacks the input 'current'"):
        samples_of(replace(motion, beside={}), Damper())


def test_a_fit_finds_what_it_does(campaign: Campaign) -> None:
    fit = si.fit(si.PlantModel(Damper(), Damper.parameters), campaign)
    assert fit.trusted
    for name, true in TRUTH.items():
        assert abs(fit[name].value - true) < 4.0 * fit[name].stderr, name
    assert fit["c_1"].stderr < 0.02 * TRUTH["c_1"]
