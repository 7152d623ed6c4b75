"""The check of a plant of one's own: what is right has no fault, and each mistake is said in words of its own."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import savgs_ident as si
from savgs_ident.validation.plant_declaration import check_declaration
from savgs_ident.validation.plant_equations import check_equations

from ..relaxed import as_users_have_it

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@pytest.fixture(scope="module", autouse=True)
def _relaxed() -> object:
    with as_users_have_it():
        yield


class Place(NamedTuple):
    """Where the mass is [m], or a time derivative of it."""

    x: Any


GUIDE = si.Port("guide", si.PortKind.FORCE, "guide", velocity=0.1, force=1.0)
MOUNT = si.Port("mount", si.PortKind.SERIES, "mount", force=10.0)
TABLE = si.Port("table", si.PortKind.INPUT, "table", displacement=1e-3)
SENSOR = si.Port("sensor", si.PortKind.SENSOR, "sensor.place", displacement=1e-4)
M = si.Parameter("m", 2.0, "kg", tolerance=0.02, lower=0.0)
K = si.Parameter("k", 200.0, "N/m", lower=0.0, upper=1e4)
C = si.Parameter("c", 4.0, "N s/m", lower=0.0, upper=1e3)


class Sound(si.AbstractPlant):
    """A mass on a spring and a damper on a shaken table, with nothing wrong."""

    coordinates: ClassVar[Any] = (si.Coordinate("x", "m", "place", 0.01, 0.1, 1.0),)
    coordinate_type: ClassVar[Any] = Place
    inputs: ClassVar[Any] = (si.Input("table_height", "m", "table", moves=(1.0,)),)
    channels: ClassVar[Any] = (si.Channel("place", "m", "place"),)
    ports: ClassVar[Any] = (GUIDE, MOUNT, TABLE, SENSOR)
    parameters: ClassVar[Any] = si.ParameterTable((M, K, C))

    def signals(self, x: Any, v: Any, none: Any) -> Any:
        """What acts along the guide."""
        return si.PortSignals(x, v, none, none)

    def evaluate(self, p: Any, motion: Any, u: Any, acting: Any, prepared: Any = None) -> Any:
        """The force on the mass out of balance."""
        x, v, a = motion.q.x, motion.qd.x, motion.qdd.x
        none = jnp.zeros_like(x)
        table = acting.input(TABLE, u.signals[0], u.fundamental)
        way = acting.deflection(MOUNT)
        push = p["k"] * (table.value - x - way.displacement) + p["c"] * (table.rate - v - way.velocity)
        acting.carry(MOUNT, push, none)
        return jnp.stack([push + acting.force(GUIDE, self.signals(x, v, none)) - p["m"] * a]), push

    def read(self, p: Any, motion: Any, s: Any, sd: Any, u: Any, prepared: Any = None) -> Any:
        """The place."""
        return motion.q


def _faults(plant: Any, severity: str = "fault") -> list[str]:
    model = si.load_plant(plant)
    declared = list(check_declaration(model))
    found = (
        declared
        if any(each.severity == "fault" for each in declared)
        else [*declared, *check_equations(model)]
    )
    assert all(each.remedy for each in found if each.severity != "note")
    return [each.what for each in found if each.severity == severity]


def test_what_is_sound_has_no_fault() -> None:
    assert _faults(Sound) == []
    assert _faults(Sound, "warning") == []


@pytest.mark.parametrize(
    "name",
    [
        str(EXAMPLES / "servo/servo.py"),
        *(
            pytest.param(name, marks=pytest.mark.slow)
            for name in (
                "axis",
                "two_mass",
                str(EXAMPLES / "pendulum.py"),
                str(EXAMPLES / "bench/bench.py"),
                str(EXAMPLES / "damper/damper.py"),
            )
        ),
    ],
)
def test_plants_that_come_with_the_package_have_no_fault(name: str) -> None:
    assert _faults(name) == []


class BackwardForce(Sound):
    """The guide's force has the wrong sign."""

    def evaluate(self, p: Any, motion: Any, u: Any, acting: Any, prepared: Any = None) -> Any:
        """Twice the wrong way is once."""
        balance, push = super().evaluate(p, motion, u, acting)
        return balance - 2.0 * acting.forces["guide"], push


class OtherVelocity(Sound):
    """The guide's velocity is relative, its displacement is not."""

    def signals(self, x: Any, v: Any, none: Any) -> Any:
        """A rate that is not the displacement's."""
        return si.PortSignals(x, 2.0 * v, none, none)


class SelfLoading(Sound):
    """What gives way in the mount adds to its load."""

    def evaluate(self, p: Any, motion: Any, u: Any, acting: Any, prepared: Any = None) -> Any:
        """The deflection with the wrong sign."""
        way = acting.deflection(MOUNT)
        balance, push = super().evaluate(p, motion, u, acting)
        push = push + 2.0 * p["k"] * way.displacement + 2.0 * p["c"] * way.velocity
        acting.carry(MOUNT, push, jnp.zeros_like(push))
        return balance, push


class Rounded(Sound):
    """A slope is hidden from differentiation."""

    def read(self, p: Any, motion: Any, s: Any, sd: Any, u: Any, prepared: Any = None) -> Any:
        """The place, by way of something constant."""
        return Place(jax.lax.stop_gradient(motion.q.x))


class WithNumpy(Sound):
    """A function of numpy is called with what is traced."""

    def read(self, p: Any, motion: Any, s: Any, sd: Any, u: Any, prepared: Any = None) -> Any:
        """A place that numpy cannot compute."""
        return Place(np.sin(np.asarray(motion.q.x)))


class Massless(Sound):
    """No acceleration is in the equation."""

    def evaluate(self, p: Any, motion: Any, u: Any, acting: Any, prepared: Any = None) -> Any:
        """The balance without inertia."""
        balance, push = super().evaluate(p, motion, u, acting)
        return balance + p["m"] * motion.qdd.x, push


class Deaf(Sound):
    """A port is declared, and nothing acts there."""

    ports: ClassVar[Any] = (*Sound.ports, replace(GUIDE, name="rail"))


class Root(Sound):
    """A root of what may be negative."""

    def read(self, p: Any, motion: Any, s: Any, sd: Any, u: Any, prepared: Any = None) -> Any:
        """No number for most places."""
        return Place(jnp.sqrt(-jnp.abs(motion.q.x)))


class TwoRows(Sound):
    """More equations than coordinates."""

    def evaluate(self, p: Any, motion: Any, u: Any, acting: Any, prepared: Any = None) -> Any:
        """The balance twice."""
        balance, push = super().evaluate(p, motion, u, acting)
        return jnp.concatenate([balance, balance]), push


@pytest.mark.parametrize(
    ("plant", "said"),
    [
        (BackwardForce, "port 'guide': a force there pulls against its own displacement"),
        (OtherVelocity, "port 'guide': its velocity is"),
        (SelfLoading, "port 'mount': what gives way there adds to its own load"),
        (Rounded, "slopes are not those of differences in: x"),
        (WithNumpy, "read cannot be evaluated: line"),
        (Massless, "the mass matrix is singular"),
        (Deaf, "nothing acts at port 'rail'"),
        (Root, "read gives what is no finite number"),
        (TwoRows, r"evaluate gives an array of shape (2,), not (1,)"),
    ],
)
def test_a_mistake_in_the_equations_is_said(plant: Any, said: str) -> None:
    found = _faults(plant)
    assert any(said in each for each in found), found


def _changed(**declared: Any) -> Any:
    return type("Changed", (Sound,), declared)


@pytest.mark.parametrize(
    ("declared", "said"),
    [
        (
            {"inputs": (si.Input("table_height", "m", "table", moves=(1.0, 1.0)),)},
            "moves has 2 numbers for 1 coord",
        ),
        (
            {"inputs": (si.Input("table_height", "m", "table", moves=(0.0,)),)},
            "input 'table_height' moves nothing",
        ),
        (
            {"inputs": (si.Input("place", "m", "table", moves=(1.0,)),)},
            "two recorded channels are called 'place'",
        ),
        (
            {"inputs": (si.Input("table_height", "m", "t", moves=(1.0,), rest="z0"),)},
            "rest is 'z0', which is no par",
        ),
        (
            {"inputs": (si.Input("table_height", "m", "t", moves=(1.0,), stroke="m"),)},
            "'m' in 'kg', not in 'm'",
        ),
        ({"channels": (si.Channel("place", "mm", "place"),)}, "declared in 'mm', which is not SI"),
        (
            {"channels": (si.Channel("position", "m", "place"),)},
            "at 'sensor.place', which is no channel's sensor",
        ),
        ({"ports": (*Sound.ports, GUIDE)}, "two ports are called 'guide'"),
        (
            {"ports": (replace(GUIDE, contact=("k_pre", "c_pre")), *Sound.ports[1:])},
            "contact is 'k_pre', which",
        ),
        (
            {"ports": (replace(GUIDE, contact=("c", "c")), *Sound.ports[1:])},
            "contact is 'c' in 'N s/m', not",
        ),
        ({"ports": (replace(GUIDE, force=0.0), *Sound.ports[1:])}, "port 'guide': force is 0.0"),
        (
            {"ports": (*Sound.ports[:3], replace(SENSOR, displacement_unit="rad"))},
            "is in 'rad', its channel in 'm'",
        ),
        (
            {
                "ports": (
                    *Sound.ports,
                    si.Port("m", si.PortKind.NUMBER, "m", numbers=(si.Number("m", "g", 0.1),)),
                )
            },
            "number is 'm' in 'kg', not in 'g'",
        ),
        ({"coordinates": (si.Coordinate("x", "m", "place", 0.0, 0.1, 1.0),)}, "coordinate 'x': size is 0.0"),
    ],
)
def test_what_does_not_go_together_is_said(declared: dict[str, Any], said: str) -> None:
    found = _faults(_changed(**declared))
    assert any(said in each for each in found), found


def test_a_contact_that_nobody_measured_is_to_be_marked_so() -> None:
    def said(**known: Any) -> list[str]:
        contact = si.Parameter("k_pre", 1e5, "N/m", **known), si.Parameter("c_pre", 1e3, "N s/m", **known)
        sticking = _changed(
            ports=(replace(GUIDE, contact=("k_pre", "c_pre")), *Sound.ports[1:]),
            parameters=si.ParameterTable((M, K, C, *contact)),
        )
        declared = check_declaration(si.load_plant(sticking))
        return [each.what for each in declared if "taken as exact" in each.what]

    (one,) = said()
    assert "'k_pre' and 'c_pre' of its contact are taken as exact" in one
    assert not said(source="typical")
    assert not said(tolerance=50.0)


@pytest.mark.parametrize(
    ("stiffness", "damping", "acts"), [(1e5, 1e3, ()), (1e5, 2.0, ("damper",)), (1e-3, 1e3, ("spring",))]
)
def test_a_contact_that_holds_a_friction_late_is_said_to_act_like_what_it_is(
    stiffness: float, damping: float, acts: tuple[str, ...]
) -> None:
    contact = si.Parameter("k_pre", stiffness, "N/m"), si.Parameter("c_pre", damping, "N s/m")
    sticking = _changed(
        ports=(replace(GUIDE, contact=("k_pre", "c_pre")), *Sound.ports[1:]),
        parameters=si.ParameterTable((M, K, C, *contact)),
    )
    declared = check_declaration(si.load_plant(sticking))
    notes = [each.what for each in declared if "its contact holds" in each.what]
    assert len(notes) == len(acts)
    assert all(f"acts like a {each} before" in note for each, note in zip(acts, notes, strict=True))
    assert all("from 0.5 m/s on, 500% of the typical motion" in each for each in notes if damping == 2.0)


@pytest.mark.slow
def test_parameters_that_nothing_shows_and_that_nothing_tells_apart(tmp_path: Path) -> None:
    """Mass, spring and damper scale together where no force is measured; what is used nowhere moves nothing."""
    idle = si.Parameter("idle", 1.0, "N", lower=0.0, upper=2.0)
    exact_mass = replace(M, tolerance=0.0, upper=10.0)
    known = si.check_plant(si.load_plant(_changed(parameters=si.ParameterTable((M, K, C, idle)))))
    assert known.trusted
    said = {each.what: each.severity for each in known.findings}
    assert said["parameter 'idle' moves nothing that a channel shows"] == "warning"
    assert [each for each in said if "'m' and 'k' and 'c' apart" in each and said[each] == "note"]
    assert known.natural_frequencies == pytest.approx([np.sqrt(200.0 / 2.0) / (2.0 * np.pi)], rel=1e-9)
    open_mass = si.check_plant(si.load_plant(_changed(parameters=si.ParameterTable((exact_mass, K, C)))))
    (found,) = [each for each in open_mass.findings if "apart" in each.what]
    assert (found.severity, found.what) == ("warning", "no harmonic test can tell 'm' and 'k' and 'c' apart")
    known.save(tmp_path)
    assert json.loads((tmp_path / "check-plant.json").read_text())["identified"] == ["k", "c", "idle"]
    assert "known to a tolerance: m" in str(known)


@pytest.mark.slow
def test_a_plant_that_leaves_its_rest_is_no_fault_but_said() -> None:
    table = si.ParameterTable((M, replace(K, lower=-1e4, value=-50.0), C))
    found = si.check_plant(si.load_plant(_changed(parameters=table, ports=(GUIDE, TABLE, SENSOR))))
    assert found.trusted
    assert any("unstable about its rest" in each.what for each in found.findings)
