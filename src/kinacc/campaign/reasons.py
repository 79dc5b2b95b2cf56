"""Texts of the codes of assessors, and what to do where readings contradict an assumption."""

from __future__ import annotations

from kinacc.assess.statement import Reason

REASONS = {
    # assumptions
    "drawn_at_random": "points drawn at random from the region",
    # no bound
    "nothing_measured": "no reading yet",
    "first_visit": "{left} more points of the first visit are needed",
    "first_visit_by_travel": "{left} points of the first visit, made in order of travel, are open",
    "predicted": "all {read} readings equal the predicted positions to the last digit: were "
    "predictions recorded?",
    "unmeasured": "{left} of {points} candidates are not measured",
    "few_points": "{read} points read; {share:.0%} of the region needs {needed}",
    "few_sizes": "{read} points read; a distribution needs at least {needed} of different size",
    "much_noise": "noise makes up {part:.0%} of the mean square of the readings",
    "not_gamma": "the largest reading does not fit a gamma distribution",
    "drift": "the reference poses show a drift of {size:.3f} mm over the campaign "
    "({x:+.3f}, {y:+.3f}, {z:+.3f}; standard deviation {deviation:.3f} mm)",
    "step": "the reference poses show a step of {size:.3f} mm between readings {after} and "
    "{before} ({x:+.3f}, {y:+.3f}, {z:+.3f}; standard deviation {deviation:.3f} mm)",
    "scatter": "readings of one pose in a row scatter {ratio:.2f} times the stated noise "
    "({freedom:.0f} degrees of freedom): noise understated, or something moves",
    "tails": "readings of one pose lie {farthest:.1f} standard deviations apart: some are wrong, "
    "or the noise is not normal",
    "wrong_readings": "{readings:.0f} readings do not fit the others of their pose",
    "noise_unknown": "the noise is not estimated yet: {freedom:.0f} of {needed:.0f} degrees of "
    "freedom",
    # noise of the bounds
    "noise_margin": "too few repeated readings to check the stated noise: bounds use {margin:g} "
    "times the stated value (--set noise_margin=1 takes it as stated)",
    "noise_shown": "bounds use {factor:.2f} times the stated noise, as repeated readings show "
    "({freedom:.0f} degrees of freedom)",
    "noise_estimated": "noise estimated in this campaign: {factor:.2f} times the planned value "
    "({freedom:.0f} degrees of freedom)",
    "noise_tested": "noise of a repeatability test ({freedom:.0f} degrees of freedom)",
    "noise_limited": "bounds use {factor:.2f} times the noise of the repeatability test, its upper "
    "limit ({freedom:.0f} degrees of freedom), as readings may be wrong",
    "noise_bounded": "no repeated readings: noise at most {factor:.2f} times the planned value, by "
    "the size of all readings",
    # small budgets
    "excepted_ahead": "the bound will leave {excepted:.0f} candidates out; {enough:.0f} readings "
    "bound all of them",
    # decisions
    "between": "the tolerance lies between lower and upper bound: measure more",
    "contradict": "bounds and estimate contradict each other: is the noise understated?",
    "within": "the upper bound is within the tolerance",
    "beyond": "the lower bound exceeds the tolerance",
    "some_excepted": "the upper bound is within the tolerance but leaves {excepted:.0f} candidates "
    "out: measure more points",
    "no_upper": "no upper bound is stated",
}


# What to do where readings contradict an assumption of the bounds.
ADVICE = {
    "predicted": "Begin a new campaign, and record readings of an instrument.",
    "scatter": "Check whether something moves; begin a new campaign with the noise tested (kinacc "
    "repeatability) or estimated (--noise estimate).",
    "tails": "Check the readings; begin a new campaign, with --wrong-readings where some may go "
    "wrong.",
    "wrong_readings": "Check each reading named: strike it where something went wrong (kinacc "
    "campaign strike FOLDER NUMBER --reason ..), else begin a new campaign with --wrong-readings.",
    "drift": "Find what moved or warmed up, and begin a new campaign.",
    "step": "Find what moved, and begin a new campaign.",
}


def reason(why: Reason | None) -> str:
    """Return the text of a reason; empty for None."""
    return "" if why is None else REASONS[why.code].format(**why.numbers)
