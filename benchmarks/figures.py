"""The figures by key: unit, digits shown, and one sentence on what each means."""

from typing import NamedTuple


class Figure(NamedTuple):
    """Unit ("" for a ratio), format, meaning."""

    unit: str
    shown: str
    meaning: str


_FORMATS = {
    "csv": "CSV",
    "csv_gz": "compressed CSV",
    "parquet": "Parquet",
    "mdf4": "MDF 4",
    "tdms": "TDMS",
    "mat5": "MATLAB 5",
    "mat73": "MATLAB 7.3",
    "rosbag": "a bag of ROS 2 in SQLite, a topic for each channel",
}
"""Formats of recordings, in words."""

FIGURES: dict[str, Figure] = {
    "response_ms_per_frequency": Figure(
        "ms",
        ".1f",
        "Response of one dwell (harmonics 0-9, both channels) from a cold start, programs compiled.",
    ),
    "response_warm_ms_per_frequency": Figure(
        "ms", ".1f", "The same, started from the response before all four parameters changed by 1 %."
    ),
    "gradient_over_value": Figure(
        "", ".2f", "Warm response with its derivatives in four parameters, over the warm response alone."
    ),
    "gradient_over_value_cold": Figure("", ".2f", "The same ratio for a cold start."),
    "response_compile_s": Figure(
        "s", ".1f", "Compiling the response, once per machine (it is kept on disk)."
    ),
    "gradient_compile_s": Figure(
        "s", ".1f", "Compiling the warm start and the derivatives, once per machine."
    ),
    "error_percent_ours": Figure(
        "%", ".3f", "Our largest error of an order 1-9, of the first harmonic, against a tight integration."
    ),
    "speedup_harmonicbalance": Figure(
        "x", ".1f", "How many times longer `harmonicbalance` takes for a dwell."
    ),
    "speedup_scipy": Figure("x", ".1f", "How many times longer scipy's LSODA takes to the steady state."),
    "speedup_diffrax": Figure("x", ".1f", "How many times longer diffrax takes to the steady state."),
    "speedup_gradient_harmonicbalance": Figure(
        "x", ".1f", "The same for value and gradient, with 1 + 4 runs for finite differences (computed)."
    ),
    "speedup_gradient_scipy": Figure("x", ".1f", "The same for scipy (computed: 1 + 4 runs)."),
    "speedup_gradient_diffrax": Figure("x", ".1f", "The same for diffrax (computed: 1 + 4 runs)."),
    "speedup_shooting": Figure(
        "x", ".0f", "How many times longer shooting with finite differences takes for a dwell."
    ),
    "speedup_gradient_shooting": Figure(
        "x", ".0f", "The same for value and gradient (computed: 1 + 4 runs)."
    ),
    "shooting_ms_per_frequency": Figure("ms", ".0f", "A dwell by shooting, mean of those solved."),
    "shooting_dwells_solved": Figure("", ".0f", "Dwells that it solves within 0.1 %."),
    "error_percent_shooting": Figure("%", ".3f", "Its largest error in these dwells."),
    "harmonicbalance_ms_per_frequency": Figure(
        "ms", ".0f", "A dwell by `harmonicbalance`, mean of those solved."
    ),
    "harmonicbalance_dwells_solved": Figure("", ".0f", "Dwells that it solves within 0.1 %."),
    "harmonicbalance_orders": Figure("", ".0f", "Orders that it needs for that, mean."),
    "error_percent_harmonicbalance": Figure("%", ".3f", "Its largest error in these dwells."),
    "scipy_ms_per_frequency": Figure("ms", ".0f", "A dwell by scipy, mean."),
    "scipy_calls_per_frequency": Figure("", ".0f", "Right-hand sides that LSODA asks for in a dwell, mean."),
    "scipy_call_us": Figure("us", ".0f", "Time of scipy per right-hand side, all included."),
    "scipy_bound_ms_per_frequency": Figure(
        "ms", ".0f", "What scipy would take if calling the right-hand side and LSODA itself cost nothing."
    ),
    "error_percent_scipy": Figure("%", ".3f", "Its largest error."),
    "diffrax_ms_per_frequency": Figure("ms", ".0f", "A dwell by diffrax, mean; all dwells vectorised."),
    "error_percent_diffrax": Figure("%", ".3f", "Its largest error."),
    "fit_cold_s": Figure("s", ".1f", "`savgs-ident fit` on the shipped campaign, whole process, first time."),
    "fit_cached_s": Figure("s", ".1f", "The same again, with the compiled programs on disk."),
    "fit_peak_mb": Figure("MB", ".0f", "Most memory that either took."),
    "posterior_ess_per_s_emcee": Figure(
        "1/s",
        ".2f",
        "Effective draws per second of `savgs-ident posterior` by emcee, whole process, programs on disk.",
    ),
    "posterior_ess_per_s_nuts": Figure("1/s", ".2f", "The same by NUTS."),
    "posterior_wall_s": Figure("s", ".1f", "The slower of these two processes."),
    "posterior_ess_per_s_scipy": Figure(
        "1/s", ".2g", "The same by emcee's own move and a likelihood that integrates by scipy, extrapolated."
    ),
    "speedup_posterior_scipy": Figure(
        "x", ",.0f", "How many times longer that takes for an effective draw than our emcee (extrapolated)."
    ),
    "scipy_likelihood_s": Figure(
        "s", ".1f", "An evaluation of that likelihood, all dwells, from single dwells at posterior draws."
    ),
    "stretch_autocorrelation": Figure(
        "", ".0f", "Evaluations that emcee's own move needs for an effective draw, on the surrogate."
    ),
    "collocation_s": Figure(
        "s", ".1f", "The fit's cross-check: the same parameters from the samples, by CasADi and IPOPT."
    ),
    "collocation_worst_sd": Figure(
        "", ".2f", "Furthest that one of the four parameters is from the fit, in standard errors of the fit."
    ),
    "diagnose_cold_s": Figure(
        "s", ".1f", "`savgs-ident diagnose` on the shipped campaign, no friction in the baseline, first time."
    ),
    "diagnose_cached_s": Figure("s", ".1f", "The same again, with the compiled programs on disk."),
    "diagnose_peak_mb": Figure("MB", ".0f", "Most memory that either took."),
    "diagnose_other_cold_s": Figure(
        "s", ".1f", "The same without friction of the rail, which the catalogue is not told of, first time."
    ),
    "diagnose_other_cached_s": Figure("s", ".1f", "The same again, with the compiled programs on disk."),
    "diagnose_other_peak_mb": Figure("MB", ".0f", "Most memory that either took."),
    "trials_effects": Figure("", ".0f", "Blind trials with one effect of the catalogue."),
    "trials_nothing": Figure("", ".0f", "Blind trials with nothing missing."),
    "top1_percent_ours": Figure("%", ".0f", "Effects that the diagnosis names first and by their own name."),
    "top1_percent_stlsq": Figure("%", ".0f", "The same by pySINDy's STLSQ on our residuals and library."),
    "top1_percent_frols": Figure("%", ".0f", "The same by pySINDy's FROLS."),
    "top1_percent_lasso": Figure("%", ".0f", "The same by L1 selection (scikit-learn's LASSO path and BIC)."),
    "false_alarms_percent_ours": Figure("%", ".0f", "Where nothing is missing: something said to be."),
    "false_alarms_percent_stlsq": Figure("%", ".0f", "The same by STLSQ."),
    "false_alarms_percent_frols": Figure("%", ".0f", "The same by FROLS."),
    "false_alarms_percent_lasso": Figure("%", ".0f", "The same by L1 selection."),
    "foreign_trials_effects": Figure(
        "", ".0f", "Blind trials with one effect by a law that no catalogue has."
    ),
    "foreign_trials_nothing": Figure("", ".0f", "Blind trials with the same small errors and nothing else."),
    "foreign_port_percent_ours": Figure(
        "%", ".0f", "Foreign effects that the diagnosis puts where they are."
    ),
    "foreign_port_percent_stlsq": Figure(
        "%", ".0f", "The same by STLSQ: the port of the effect that it names."
    ),
    "foreign_port_percent_frols": Figure("%", ".0f", "The same by FROLS."),
    "foreign_port_percent_lasso": Figure("%", ".0f", "The same by L1 selection."),
    "foreign_family_percent_ours": Figure(
        "%", ".0f", "Those of which it names the family at that port, too."
    ),
    "foreign_family_percent_stlsq": Figure(
        "%", ".0f", "The same by STLSQ: the family of the effect that it names."
    ),
    "foreign_family_percent_frols": Figure("%", ".0f", "The same by FROLS."),
    "foreign_family_percent_lasso": Figure("%", ".0f", "The same by L1 selection."),
    "foreign_false_alarms_percent_ours": Figure(
        "%", ".0f", "Where there are only small errors: something named."
    ),
    "foreign_false_alarms_percent_stlsq": Figure("%", ".0f", "The same by STLSQ."),
    "foreign_false_alarms_percent_frols": Figure("%", ".0f", "The same by FROLS."),
    "foreign_false_alarms_percent_lasso": Figure("%", ".0f", "The same by L1 selection."),
    "closed_loop_sweep_s": Figure(
        "s", ".2f", "60 s of closed loop (sweep, 1000 samples per second of the law), program compiled."
    ),
    "speedup_closed_loop_scipy": Figure(
        "x", ".0f", "How many times longer scipy's LSODA takes for 4 s of closed loop, on the same equations."
    ),
    "closed_loop_difference_percent": Figure(
        "%", ".3f", "By how much the deflections of the two differ, rms over rms."
    ),
    "campaigns_one_worker_s": Figure(
        "s", ".0f", "`savgs-ident campaign` on many campaigns, one at a time, programs compiled."
    ),
    "campaigns_two_workers_s": Figure("s", ".0f", "The same, two at a time."),
    "campaigns_speedup_two_workers": Figure("x", ".2f", "How many times longer one at a time takes."),
    "mcap_samples_per_s": Figure(
        "1/s", ",.0f", "Samples (of six channels) read per second from a long MCAP file."
    ),
    "mcap_peak_mb": Figure("MB", ".0f", "Most memory of that process, the samples read included."),
    **{
        key: figure
        for name, words in _FORMATS.items()
        for key, figure in (
            (
                f"read_{name}_x",
                Figure(
                    "x", ",.0f", f"How many seconds of {words}, eight channels at 1 kHz, are read in one."
                ),
            ),
            (f"read_{name}_mb", Figure("MB", ".0f", "Most memory of that process, the samples included.")),
        )
    },
}
