"""Every way in which the package reads a file of data, a line or two each."""

from collections.abc import Mapping
from types import MappingProxyType

from fuzz import kept, models, recordings
from fuzz.loader import Form, Loader

_CSV = (
    "recordings.csv.read_csv", "recordings.csv_table.CsvTable._parse", "recordings.csv_head._cells",
)  # fmt: skip
_JSON_MCAP = (
    "recordings.mcap_json.JsonDecoder._parse", "recordings.mcap_json._schema_units",
    "recordings.mcap_timing._from_json", "recordings.mcap_records.McapRecords._decompress",
)  # fmt: skip
_CDR_MCAP = (
    "recordings.mcap_timing._cdr_string", "recordings.cdr._LayoutReader._length",
    "recordings.mcap_records.McapRecords._unpack_chunk",
)  # fmt: skip
_MATLAB = tuple(
    f"recordings.axis_recording.{name}" for name in ("_unpacked", "_arrays", "_element", "_header")
)
_RESULT = ("campaigns.store.load_result", "campaigns.store.StoredResult.record")
_TRIALS = ("validation.trials.marks_in", "validation.trials.known_trials")
_BLIND = ("validation.blind_trial._read",)
_EXPORT = ("export.document.read_document",)

_LOADERS = (
    Loader("csv", "campaign as a table", "campaign.csv", Form.table, recordings.table, recordings.read_table, _CSV),
    Loader("csv-gz", "campaign as a table, gzipped", "campaign.csv.gz", Form.packed_table, recordings.packed_table,
           recordings.read_table, ("recordings.csv_table.TextBlocks._inflated",)),
    Loader("mcap-json", "campaign in MCAP, JSON", "campaign.mcap", Form.mcap, recordings.json_mcap,
           recordings.read_table, _JSON_MCAP),
    Loader("mcap-cdr", "campaign in MCAP, ROS 2 CDR", "campaign.mcap", Form.mcap, recordings.cdr_mcap,
           recordings.read_table, _CDR_MCAP),
    Loader("channels", "channels.toml, and the campaign that it maps", "channels.toml", Form.toml,
           recordings.channel_map, recordings.read_map, ("recordings.channels.read_channel_map",)),
    Loader("road", "road as a table", "road.csv", Form.table, recordings.road, recordings.read_road_file,
           ("plants.quarter_car.inputs.read_road",)),
    Loader("axis", "recording of a servo axis", "run.mat", Form.matlab, recordings.axis,
           recordings.read_axis_file, _MATLAB),
    Loader("parquet", "campaign in Parquet", "campaign.parquet", Form.parquet, recordings.parquet,
           recordings.read_table, ("recordings.parquet.read_parquet",)),
    Loader("rosbag2", "campaign in a bag of ROS 2, SQLite", "bag_0.db3", Form.sqlite, recordings.rosbag,
           recordings.read_table, ("recordings.rosbag.read_rosbag",)),
    Loader("matlab-7.3", "campaign of MATLAB 7.3, which is HDF5", "dwell_2.00Hz.mat", Form.hdf5,
           recordings.matlab_7_3, recordings.read_table, ("recordings.mat._of_hdf5",)),
    Loader("plant-model", "model.toml of another plant", "model.toml", Form.toml, models.plant_model,
           models.read_plant_model, ("plants.parameter_toml.parse_document", "plants.model_toml.parse_model")),
    Loader("rig", "drawing of a rig", "rig.toml", Form.toml, models.drawing, models.read_drawing,
           ("plants.parameter_toml.parse_document",)),
    Loader("model", "identified model.toml, with its provenance", "model.toml", Form.toml, models.identified,
           models.read_identified, ("plants.parameter_toml.parse_document",)),
    Loader("weights", "weights.toml of a design", "weights.toml", Form.toml, models.weights,
           models.read_weights_file, ("control.generalised_plant.read_weights",)),
    Loader("controller", "controller.json", "controller.json", Form.json, models.controller,
           models.read_controller_file, ("control.design.read_controller",)),
    Loader("posterior", "draws in posterior.nc", "posterior.nc", Form.hdf5, models.posterior,
           models.read_posterior, ("inference.draws.read_draws",)),
    Loader("model-json", "exported model.json", "model.json", Form.json, models.exported, models.read_exported,
           _EXPORT),
    Loader("python-control", "exported model-control.json", "model-control.json", Form.json,
           models.python_control, models.read_python_control, _EXPORT),
    Loader("diagnosis", "diagnosis.json, and the model with it", "diagnosis.json", Form.json, models.diagnosis,
           models.read_diagnosis_file, _EXPORT),
    Loader("kept-seal", "done.json of a campaign's result", "nominal/done.json", Form.json, kept.kept_seal,
           kept.read_result, _RESULT),
    Loader("kept-fit", "fit.json of a campaign's result", "nominal/fit.json", Form.json, kept.kept_fit,
           kept.read_result, _RESULT),
    Loader("kept-blind", "marks of blind trials", "trials.jsonl", Form.lines, kept.kept_blind, kept.read_blind,
           _TRIALS),
    Loader("kept-draws", "draws of `false-alarms`", "draws.jsonl", Form.lines, kept.kept_draws, kept.read_draws,
           _TRIALS),
    Loader("kept-trials", "trials of `calibrate`", "trials.jsonl", Form.lines, kept.kept_trials,
           kept.read_trials, _TRIALS),
    Loader("blind-seal", "seal.json of a blind trial", "trial_0001/campaign/seal.json", Form.json,
           kept.blind_seal, kept.read_blind_seal, _BLIND),
    Loader("blind-answer", "answer.json of a blind trial", "trial_0001/answer.json", Form.json,
           kept.blind_answer, kept.read_blind_answer, _BLIND),
    Loader("chain-nuts", "kept chain of NUTS", "chain.h5", Form.hdf5, kept.nuts_chain, kept.read_nuts_chain,
           ("inference.samplers.chains.open_checkpoint", "inference.samplers.nuts.load_state")),
    Loader("chain-emcee", "kept chain of emcee", "chain.h5", Form.hdf5, kept.emcee_chain, kept.read_emcee_chain,
           ("inference.samplers.chains.open_checkpoint",)),
)  # fmt: skip

LOADERS: Mapping[str, Loader] = MappingProxyType({each.name: each for each in _LOADERS})
"""All loaders by name."""
