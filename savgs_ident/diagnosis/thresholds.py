"""The constants that decide a diagnosis, in one frozen record, each with its origin.

A diagnosis compares hypotheses by log weights: log evidence by Laplace's method plus log prior. The constants below
turn those weights, and the change of the response that a hypothesis makes, into a verdict. They are of four kinds:

- prior probabilities of hypotheses;
- thresholds on log odds, and on the share of the response or of the misfit;
- widths of the priors of an effect's parameters, and of those that a linearised law is compared under;
- limits of the search: how many hypotheses are fitted in full.

The first three kinds can change a verdict about the same fits, or what is said beside it; the last can only miss a
hypothesis. Tolerances of solvers, meshes, numbers of draws and their seeds decide nothing and stay where they are
used.

"Misfit" below is the mean square of the residuals in noise variances, less one: what the noise does not explain.
"Response" is the measured response of a channel, all harmonics and tests together.

Each docstring says where a value comes from, and what halving or doubling it does as far as that can be derived. How
often verdicts of blind trials change stands in ``docs/validation.md``: for constants that judge fits, each by itself
(:mod:`savgs_ident.validation.varied_constants`); for those that steer the search, in groups (``benchmarks/refits.py``
lists those that were never varied, with the reason). Values "by choice" were chosen by the authors and kept because
the labelled recordings and blind trials came out right; blind trials had been looked at when some were chosen, so
that these trials are no evidence for them.
"""

from dataclasses import dataclass

from savgs_ident.inference.background.constants import BackgroundConstants


@dataclass(frozen=True)
class DecisionConstants(BackgroundConstants):
    """Constants that decide; probabilities, shares and cosines are relative [1], log odds in nat.

    With those of the background of small errors, which every likelihood carries.
    """

    # Priors

    prior_none: float = 0.4
    """Prior probability that nothing is missing.

    Origin: by choice, as probable as one effect. Halved or doubled: log odds of all else move by 0.7 nat.
    """

    prior_single: float = 0.4
    """Prior probability that one effect is missing, shared equally by all effects of the catalogue.

    Origin: by choice. Halved or doubled: log odds of every single effect move by 0.7 nat.
    """

    prior_pair: float = 0.1
    """Prior probability that two effects are missing, shared equally by all pairs.

    Origin: by choice, a quarter of one effect's. Halved or doubled: log odds of every pair move by 0.7 nat.
    """

    prior_unknown: float = 0.1
    """Prior probability that something is missing which the catalogue does not have.

    Origin: by choice, the rest to one. Halved or doubled: log odds of *unknown* move by 0.7 nat.
    """

    prior_broken_tolerance: float = 0.01
    """Prior probability that, beside what a hypothesis says, one tolerance of the sheet does not hold.

    It is that of a baseline that drifts by more than is tolerated, too.

    Origin: by choice; before, it had the prior of something unknown, ten times as much. It bounds the probability
    of *unknown* from below where nothing is missing. Halved or doubled: log odds of a broken tolerance move by 0.7
    nat.
    """

    # Priors of what an effect brings

    amplitude_width: float = 2.0
    """Width of the prior of an effect's amplitude, in its typical sizes.

    Origin: by choice: an effect of twice its typical size is one standard deviation away. Halved or doubled:
    Occam's factor moves by 0.7 nat for every amplitude; with ``shape_width``, none of 20 verdicts changes.
    """

    shape_width: float = 0.7
    """Width of the prior of the logarithm of what shapes an effect [1].

    Origin: by choice, a factor of two to either side (log 2 = 0.69). Halved or doubled: Occam's factor moves by up
    to 0.7 nat for every shape that the campaign identifies; with ``amplitude_width``, none of 20 verdicts changes.
    """

    coefficient_uncertainty: float = 2.0
    """Standard deviation [nat] of a learned law's log evidence for every coefficient that the data identify.

    How wide a coefficient's prior should be is known to a factor of two at best, and how many functions a law takes
    depends on which there are: one at a port, two at another where the law itself would do the same. Origin: the next
    one's. It changes no verdict, but the probabilities that are stated and which ports are said to be
    indistinguishable. Halved or doubled: probabilities of ports that do nearly the same move towards those of the
    weights alone, or towards one half.
    """

    rest_uncertainty: float = 0.1
    """Standard deviation of a learned law's log evidence, as a share of the log density that it leaves to be gained.

    Learned laws are sums of given functions, and what they lack of the law that is there differs from port to port.
    Origin: four foreign trials in which a force in the strut and one in the joints were learned and the drawn law
    itself was fitted at both, too. Log odds of the ports were off by 0.8 to 12 nat; with this and the last one by
    1.1 standard deviations rms. A fifth is left out: its drawn law is so large that the prior of its amplitude
    decides. Halved or doubled: as there.
    """

    family_widths: tuple[float, ...] = (0.1, 1.0, 10.0, 100.0)
    """Widths tried for the prior of one family's functions, over that of all functions of a learned law.

    Origin: by choice, a factor of ten apart; the greatest for one that calibration nearly takes up. Halved or
    doubled: Occam's factor moves by up to 0.7 nat a coefficient.
    """

    # Thresholds on log odds

    alarm_log_odds: float = 4.0
    """Log odds against *none* from which on something is reported missing.

    Origin: Markov's inequality. Where nothing is missing, and priors and noise are as assumed, the odds reach
    exp(4) in at most exp(-4) = 1.8 % of all campaigns, or 2.7 % where "something" is given the prior odds of 1.5
    that it has here. Halved: at most 13.5 % (20 %). Doubled: at most 0.03 % (0.05 %).
    """

    indistinguishable_log_odds: float = 5.0
    """Log odds within which two hypotheses, or two ports, are reported as not distinguishable by the campaign.

    Origin: by choice; exp(5) is about 150 to 1.
    """

    alike_share: float = 0.5
    """Share of the gap that a law at a port explains to first order, from which on its likeness to others is known.

    Origin: by choice, most of it.
    """

    # Thresholds on the change of the response

    material_share: float = 0.003
    """Change of the response by an effect, as a share of it, from which on the effect matters.

    A gap in held-out tests that exceeds the noise by as much is no small one: then the verdict is not *none*.

    Origin: by choice, for campaigns whose noise is 0.14 % of the response.
    """

    material_share_of_test: float = 0.02
    """The same within the one test where the effect changes most.

    Origin: by choice; a friction that shows in the slow tests alone reaches it.
    """

    sure_of_gap: float = 3.0
    """Standard deviations, by chance, of the noise's mean square by which a gap must exceed what matters.

    Below, a gap is no sign that something is missing. Origin: by choice, the convention of three sigma; with few
    tests and much noise the square of a gap of the noise alone scatters by more than ``material_share``.
    """

    # Drifts

    significant_drift: float = 3.0
    """Standard deviations from zero from which on a parameter of a drifting baseline is reported as drifting.

    Origin: by choice, the convention of three sigma. It changes no verdict.
    """

    least_drift: float = 1.0
    """Drift of a parameter to first order, in its tolerance, from which on a drifting baseline is fitted.

    Origin: by definition, as a smaller drift is tolerated.
    """

    drift_rounds: int = 6
    """Most estimates of the drifts. Origin: computing time; drifts that take more count as no explanation."""

    drift_convergence: float = 0.02
    """Change of the drifts from one estimate to the next, in their tolerances, from which on they are known.

    Origin: by choice, small against one tolerance.
    """

    least_parameter_share: float = 0.1
    """Share of its value to which a drifting parameter may fall. Origin: by choice, as none is negative."""

    # Thresholds on the misfit

    negligible_misfit: float = 0.3
    """Misfit that counts as none [1].

    Origin: by choice, for noise known from few periods and the plant's own discretisation.
    """

    explained_share: float = 0.01
    """Share of the baseline's misfit that a hypothesis may leave and still count as explaining all.

    It decides whether further effects and pairs are fitted, and whether a law is looked for beside one effect.
    Origin: by choice.
    """

    negligible_gain: float = 0.03
    """Log density per datum that a hypothesis may leave to be gained and still count as explaining all [nat].

    It decides the same. Errors of a quarter of the noise leave as much. Origin: right formulas left at most 0.02 in
    recordings of another simulator, others that explained all but a thousandth of the misfit, a mount in place of a
    gear or of what gives way in a damper, 0.04 to 0.13 in blind trials.
    """

    reported_share: float = 0.005
    """Share of the baseline's misfit left by named effects from which on a warning says so.

    Origin: by choice. It changes no verdict.
    """

    unexplained_share: float = 0.05
    """Share of the baseline's misfit left by the best effects beyond which the verdict is *unknown*.

    Origin: by choice.
    """

    unexplained_share_flexible: float = 0.1
    """The same for a learned law at a port.

    Origin: by choice: what closes nine tenths of the gap's square is offered as a correction.
    """

    explained_share_flexible: float = 0.02
    """Share of the baseline's misfit that a learned law may leave and still count as explaining all.

    Then only those pairs of effects are fitted whose scores promise to be more probable. Origin: by choice.
    """

    # Localisation

    location_folds: int = 4
    """Parts into which tests are split where a law learned at a port predicts tests left out. Origin: by choice."""

    law_widths: tuple[float, ...] = (0.3, 3.0, 30.0)
    """Prior widths of a law's coefficients, in rms of the residuals in their sd, over which evidence is averaged.

    Origin: by choice, a factor of ten apart.
    """

    free_input_width: float = 100.0
    """The same of an input that is free in every dwell: wide, so that the share that it explains is an upper bound.

    Origin: by choice. It changes no verdict.
    """

    free_orders_along_motion: int = 5
    """The same in a block of time of a measured motion. Origin: by choice. It changes no verdict."""

    least_function_share: float = 1e-3
    """A function of a learned law that changes the rows by less than this share of the strongest one is left out.

    Origin: by choice: data that hardly see a function, as a constant force, allow its coefficient any size.
    """

    motion_margin: float = 1.5
    """Range of a learned law over that of the baseline's motion; beyond its range its functions stay constant.

    Origin: by choice, as the motion of the plant with the law is another.
    """

    unlisted_family_prior: float = 0.1
    """Prior probability of a learned law of a family that no effect of the catalogue has at its location.

    Relative to that of a family which the catalogue has there. Origin: by choice: engineers know what can be
    missing where. Stops are in struts, what hardens is rubber in joints, and the data hardly distinguish a force in
    a strut from one beside it in the joints. Halved or doubled: log odds between such locations move by 0.7 nat.
    """

    # Scores

    visible_sigma: float = 5.0
    """Standard deviations by which an effect must change the response to be visible.

    Origin: by choice, the convention of five sigma. It changes no verdict: it says what cannot be assessed.
    """

    assessable_sizes: float = 10.0
    """An effect that is visible only beyond so many typical sizes cannot be assessed in this campaign.

    Origin: by choice. It changes no verdict.
    """

    broken_tolerance_width: float = 10.0
    """Width of the prior of a parameter whose tolerance does not hold, in tolerances; of a drift, in its own.

    Origin: by choice. Halved or doubled: Occam's factor moves by 0.7 nat; the fit of a parameter that is several
    widths off its sheet moves the other way.
    """

    lookalike_cosine: float = 0.9
    """Cosine between what two effects do to the campaign from which on they look alike.

    Where one explains all, its lookalikes are fitted too. Origin: by choice.
    """

    cosine_resolution: float = 1e-3
    """Effects whose cosine is nearer to one count as one where several are significant together.

    Origin: by choice, above the rounding of the sensitivities. It changes no verdict.
    """

    # What is said beside the verdict: none of these changes it

    reversal_speed: float = 0.3
    """Share of the largest velocity below which the plant turns round. Origin: by choice."""

    mid_stroke_speed: float = 0.8
    """Share of the largest velocity above which the plant is in mid-stroke. Origin: by choice."""

    same_regime_share: float = 0.9
    """Share of their union from which on two regimes are one, and correlation from which on time and frequency are.

    Origin: by choice.
    """

    fewest_held_out_tests: int = 4
    """Tests below which a warning says that figures of tests that were left out are rough.

    Origin: by choice; each of three parts that are left out is then predicted from two tests at the least. It changes
    no verdict.
    """

    fewest_trend_tests: int = 4
    """Fewest tests with a trend over time. Origin: fewer have no scatter to compare it with."""

    sweep_dwells: int = 6
    """Dwells that must lie in a sweep's range for it to be predicted. Origin: motions between them are found then."""

    proposed_tests: int = 2
    """Tests that are proposed to distinguish two hypotheses. Origin: by choice."""

    proposed_dwells: int = 4
    """Dwells of a proposed test. Origin: by choice."""

    # Limits of the search

    first_fits: int = 2
    """Single effects that are fitted in full at first, besides lookalikes of the best. Origin: computing time."""

    further_fits: int = 4
    """Further ones, if the first leave something. Origin: computing time."""

    promising_log_evidence: float = 2.0
    """Rise of the log evidence, by the score, from which on an effect is fitted in full.

    The same rise by a broken tolerance makes the search look for pairs. Origin: by choice, well below the threshold
    of an alarm.
    """

    pair_log_evidence: float = 10.0
    """Rise of the log evidence by the best single effect from which on pairs are looked for. Origin: by choice."""

    pairs_per_parent: int = 3
    """Pairs fitted with an effect that leaves something. Origin: computing time."""

    resonance_steps: int = 4
    """Steps after which the fits of what swings from all natural frequencies are compared, the best gone on with.

    Origin: computing time. By then a sharp resonance of the frame, 9 % off the frequency that is tried, is far ahead.
    """

    resonance_peaks: int = 3
    """Frequencies from which what swings is fitted to the end, at most. Origin: computing time.

    In one blind trial the right one of two peaks scored 0.7 nat less than the wrong one and fitted 249 nat better.
    """

    first_order_pairs: int = 12
    """Pairs whose evidence to first order about the baseline is evaluated. Origin: computing time."""

    parents: int = 2
    """Best single effects, or best pairs, of whose members pairs are made. Origin: computing time."""

    refined_fits: int = 3
    """Best hypotheses that are fitted again on a mesh adapted to their own motion. Origin: computing time."""

    refined_log_evidence: float = 300.0
    """Log evidence below the best from which on a hypothesis is not refined.

    Origin: by choice, more than an unadapted mesh costs.
    """

    nearest_ports: int = 2
    """Ports at which a law explains most of what a hypothesis leaves, whose effects are tried beside its members.

    Origin: a stand-in of the hypothesis may act at the first.
    """

    learned_fits: int = 3
    """Ports whose learned laws are fitted on the nonlinear plant where no effect explains all.

    Origin: computing time. The location of all 97 learned laws that blind trials had named was among the two that
    explain most to first order. Fewer may miss the port of something strong, which explains little so.
    """

    learned_places: tuple[float, ...] = (0.05, 0.1, 0.2, 0.4)
    """Gaps of contacts and velocities over which a friction falls, over the range, before a law is searched for [1].

    Origin: by choice, a factor of two apart. It decides where a search begins, and nothing else.
    """

    learned_steps: int = 20
    """Most steps of the fit of a learned law. Origin: computing time."""

    first_learned_steps: int = 4
    """Steps after which the fits of learned laws are compared, and the most probable is gone on with first.

    Origin: computing time. By then a play with a film is ahead of laws that imitate it.
    """

    function_prior: float = 0.2
    """Prior probability that a learned law of a family needs one of its functions, each independent of the others.

    Origin: by choice: laws are simple.
    """

    interaction_prior: float = 0.04
    """The same of a product of displacement and velocity.

    Origin: by choice, the square of ``function_prior``: effects of one signal are more probable than interactions
    of two (Chipman 1996, Bayesian variable selection with related predictors). No law of the catalogue is such a
    product, but a force beside another one acts through a lever that changes over the stroke, and looks like one.
    Halved or doubled: log odds between ports that do nearly the same move by up to 0.7 nat.
    """

    lag_of_play: float = 0.05
    """Time constant [s] from which that of a play between films of oil is looked for.

    Origin: by choice: a film that gives way within a period of the dwells. What halving or doubling it does is not
    measured.
    """

    blocking_of_play: float = 5.0
    """Typical displacement of a port over that at which a play is blocked, from which that is looked for [1].

    Origin: by choice: a play is smaller than what gives way elsewhere.
    """

    likely_families: int = 2
    """Families of a learned law that are fitted by themselves on the nonlinear plant. Origin: computing time."""

    # Held-out tests

    held_out_folds: int = 3
    """Parts into which the tests are split: each is left out once. Origin: computing time."""

    held_out_steps: int = 3
    """Most steps of a fit without a part, from the fit to all tests. Origin: computing time."""

    held_out_fits: int = 2
    """Best hypotheses that predict tests left out, besides the baseline. Origin: computing time."""

    @property
    def typical_coordinate(self) -> float:
        """The typical size of an effect in widths of its amplitude's prior [1].

        Effects that are missing together are started there, and what an effect with states does is found there.
        """
        return 1.0 / self.amplitude_width


DEFAULTS = DecisionConstants()
"""The constants of every diagnosis that is not given others."""
