"""Files of models: rigs, drawn and identified, weights, controllers, draws, exported models, diagnoses."""

import json
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

import control
import h5py
import jax.numpy as jnp
import numpy as np

from fuzz.loader import Original
from savgs_ident.control.design import (
    DigitalController,
    controller_record,
    read_controller,
    rigs_from_covariance,
    rigs_from_posterior,
)
from savgs_ident.control.generalised_plant import DEFAULT_WEIGHTS, read_weights
from savgs_ident.control.linear_equivalent import AlphaMap
from savgs_ident.export.document import json_text
from savgs_ident.export.exported_model import ExportedModel
from savgs_ident.export.json_export import model_record, read_model_json, write_json
from savgs_ident.export.linear_models import EQUATION_8, EXACT
from savgs_ident.export.public import gathered, model_to_export
from savgs_ident.export.python_control_export import KIND, SCHEMA, load_python_control, resting_point
from savgs_ident.plants.from_file import load_plant
from savgs_ident.plants.model_toml import model_text
from savgs_ident.plants.quarter_car.catalogue import MODELS, model_parameters
from savgs_ident.plants.quarter_car.model import RigModel, load_model
from savgs_ident.plants.quarter_car.rig import Rig, default_rig_path, read_rig, rig_text

ESTIMATED = ("mu_r", "mu_t", "ydot_Hth", "c_sd", "k_t")
EFFECTS = MODELS["simtr"]
MOUNT = ("mount_compliance", "mount_damping")
DRAWS = 6


def drawing() -> Original:
    """The shipped rig."""
    return Original((default_rig_path().read_bytes(),))


def identified() -> Original:
    """The rig as an identification leaves it."""
    return Original((rig_text(identified_rig()).encode(),))


def weights() -> Original:
    """All weights of a design."""
    return Original(
        (
            "".join(
                f'{e.name} = {{ value = {e.value}, unit = "{e.unit}" }}\n' for e in DEFAULT_WEIGHTS.entries
            ).encode(),
        )
    )


def controller() -> Original:
    """A controller of two states."""
    space = control.ss([[0.9, 0.1], [0.0, 0.8]], np.ones((2, 3)), [[0.1, -1.0]], [[0.0, 2.0, 1e-3]], 1e-3)
    alpha = AlphaMap(jnp.asarray(np.pi / 2.0), jnp.asarray([-0.017, 0.001, 0.009]))
    return Original((json.dumps(controller_record(DigitalController(space, alpha))).encode(),))


def posterior() -> Original:
    """Draws of two chains."""
    stream = BytesIO()
    random = np.random.default_rng(4)
    with h5py.File(stream, "w") as file:
        for name, value in zip(ESTIMATED, _values(), strict=True):
            file[f"posterior/{name}"] = value * (1.0 + 0.01 * random.standard_normal((2, DRAWS)))
        file["posterior/chain"] = np.arange(2)
        file["sample_stats/lp"] = random.standard_normal((2, DRAWS))
    return Original((stream.getvalue(),))


def exported() -> Original:
    """A model with covariance, draws and a diagnosis."""
    return _written(lambda folder: write_json(_model(), folder))


def python_control() -> Original:
    """The same as state spaces; both are that of equation (8), as the exact one takes long to make."""
    model = model_record(_model())
    space = model["linear_equivalent"]["state_space"]  # type: ignore[index]
    states, inputs = len(_model().equations.states), len(_model().equations.inputs)
    record = {
        "schema": SCHEMA,
        "kind": KIND,
        "model": model,
        "state_spaces": dict.fromkeys((EQUATION_8, EXACT), space),
        "at_rest": {"x": [0.0] * states, "u": [0.0] * inputs},
    }
    return Original((json_text(record).encode(),))


def diagnosis() -> Original:
    """Diagnoses that name an effect, nothing, and something unknown."""
    kinds = {"effect": (["mount_compliance"], ["strut"]), "none": ([], []), "unknown": ([], ["frame"])}
    return Original(tuple(json.dumps(_diagnosis(kind, *named)).encode() for kind, named in kinds.items()))


def plant_model() -> Original:
    """The identified model of another plant than the quarter car."""
    model = (load_plant("two_mass") + "guide_coulomb").with_values({"k": 5.4e4})
    remembered = {"effects": ["guide_coulomb"], "free": ["k", "c"], "before": {"k": 6e4}, "trusted": True}
    return Original((model_text(model.with_provenance(remembered)).encode(),))


def read_plant_model(path: Path) -> object:
    """The model of a file with all that commands take from its provenance."""
    model = load_plant("two_mass", path)
    return model.table, model.effects, model.before.table, model.identified, model.doubts


def read_drawing(path: Path) -> object:
    """The rig of a file."""
    return read_rig(path)


def read_identified(path: Path) -> object:
    """The rig with all that commands take from its provenance: effects, parameters, priors, rigs to try."""
    model = load_model(path)
    rig, before, (free, values) = model.rig, model.before.rig, model.identified
    rigs = rigs_from_covariance(model.table, rig.provenance, DRAWS, path)
    # The provenance itself travels along as it is.
    return replace(rig, provenance={}), replace(before, provenance={}), model.effects, free, values, rigs


def read_weights_file(path: Path) -> object:
    """The weights of a file."""
    return read_weights(path)


def read_controller_file(path: Path) -> object:
    """The controller of a file, and its rate."""
    found = read_controller(path)
    return found, found.rate


def read_posterior(path: Path) -> object:
    """Rigs of a file of draws."""
    return rigs_from_posterior(model_parameters(_shipped(), EFFECTS), path, DRAWS)


def read_exported(path: Path) -> object:
    """The model of a document, and how it would be exported again."""
    found = read_model_json(path)
    return found.samples, found.table, found.effects


def read_python_control(path: Path) -> object:
    """The systems of a file, and where they rest."""
    systems = load_python_control(path)
    return {name: each for name, each in systems.items() if name != "nonlinear"}, resting_point(path)


def read_diagnosis_file(path: Path) -> object:
    """The diagnosis, and the model with what it names, as an export has it."""
    found = gathered(model_to_export(default_rig_path(), None, path), None, DRAWS, path)
    return found.model.table, found.model.effects, found.said, found.doubts


def identified_rig() -> Rig:
    """The shipped rig, as if it had been identified."""
    rig, size = _shipped(), np.array(_values())
    root = np.random.default_rng(5).standard_normal((size.size, size.size)) * 0.01 * size[:, None]
    provenance = {
        "effects": list(EFFECTS),
        "free": ["mu_r", "c_sd"],
        "trusted": True,
        "status": "converged",
        "data": "campaign.csv.gz",
        "before": dict(zip(ESTIMATED, size.tolist(), strict=True)),
        "covariance": {"names": list(ESTIMATED), "matrix": (root @ root.T).tolist()},
    }
    changed = dict(zip(ESTIMATED, (1.01 * size).tolist(), strict=True))
    return replace(rig, parameters=rig.parameters.with_values(changed), provenance=provenance)


@lru_cache(maxsize=1)
def _shipped() -> Rig:
    return read_rig(default_rig_path())


def _values() -> tuple[float, ...]:
    return model_parameters(_shipped(), EFFECTS).values_of(ESTIMATED)


@lru_cache(maxsize=1)
def _model() -> ExportedModel:
    random = np.random.default_rng(6)
    samples = {
        name: value * (1.0 + 0.01 * random.standard_normal(DRAWS))
        for name, value in zip(ESTIMATED, _values(), strict=True)
    }
    effects = (*EFFECTS, "mount_compliance")
    model = RigModel(identified_rig(), effects)
    return ExportedModel(model, samples, _diagnosis("effect", ["mount_compliance"], ["strut"]))


def _written(write: Callable[[Path], tuple[Path, ...]]) -> Original:
    with TemporaryDirectory() as folder:
        (path,) = write(Path(folder))
        return Original((path.read_bytes(),))


def _diagnosis(kind: str, effects: list[str], ports: list[str]) -> dict[str, object]:
    fitted = {
        name: {"value": value, "lo": 0.99 * value, "hi": 1.01 * value, "unit": unit}
        for name, value, unit in zip(MOUNT, (1.65e-6, 357.0), ("m/N", "N s/m"), strict=True)
    }
    return {
        "schema": 1,
        "baseline": {"model": "simtr", "parameters": {"mu_r": 0.03}, "effects": list(EFFECTS)},
        "verdict": {
            "kind": kind,
            "effects": effects,
            "ports": ports,
            "confusable_with": [],
            "sentence": "In words.",
        },
        "where": {"ports": [{"port": "strut", "share": 0.97}], "map": []},
        "which": [
            {"effect": "none", "probability": 0.0, "parameters": {}, "effects": [], "share_closed": None},
            {"effect": MOUNT[0], "probability": 0.996, "parameters": fitted, "effects": [MOUNT[0]]},
        ],
        "shrink": {"before": 0.33, "after": 0.0019},
        "next_test": [],
        "identified": {"mu_r": 0.0301, "k_t": 264423.0}
        | ({MOUNT[0]: 1.65e-6, MOUNT[1]: 357.0} if effects else {}),
        "converged": True,
        "provenance": {"data": "campaign.csv.gz", "data_sha256": "ab12", "model": "gt_rear.toml"},
    }
