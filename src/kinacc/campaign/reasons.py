"""Codes of assessors in words: why something is said, withheld or taken, and what to do then."""

from __future__ import annotations

from kinacc.assess.statement import Reason

REASONS = {
    # assumptions
    "drawn_at_random": "the points were drawn at random from the region",
    # of statements withheld
    "nothing_measured": "nothing measured yet",
    "first_visit": "{left} more points of the first visit have to be read before anything is said",
    "first_visit_by_travel": "{left} points of the first visit, made in order of travel, are left",
    "predicted": "every reading ({read}) equals the predicted position to the last digit, which "
    "none of an instrument does: were predictions recorded?",
    "unmeasured": "{left} of {points} candidates are not measured",
    "few_points": "{read} points read; {share:.0%} of the region needs {needed}",
    "few_sizes": "{read} points read; a distribution needs at least {needed}, of different size",
    "much_noise": "noise makes up {part:.0%} of the mean square of the readings",
    "not_gamma": "the largest reading does not belong to a gamma distribution",
    "drift": "the reference poses show a drift of {size:.3f} mm over the campaign "
    "({x:+.3f}, {y:+.3f}, {z:+.3f}; standard deviation {deviation:.3f} mm)",
    "step": "the reference poses show that something moved between readings {after} and {before}: "
    "by {size:.3f} mm ({x:+.3f}, {y:+.3f}, {z:+.3f}; standard deviation {deviation:.3f} mm)",
    "scatter": "readings of one pose, taken one after the other, scatter {ratio:.2f} times as much "
    "as the noise stated ({freedom:.0f} degrees of freedom): it is stated too small, or something "
    "moves",
    "tails": "readings of one pose lie farther apart than normal noise of any size has them "
    "({farthest:.1f} standard deviations): some are wrong, or the noise is not normal",
    "wrong_readings": "readings that do not fit the others of their pose: {readings:.0f}",
    "noise_unknown": "the noise is not estimated yet: {freedom:.0f} of {needed:.0f} degrees of "
    "freedom",
    # of the noise that bounds take
    "noise_margin": "bounds take the noise {margin:g} times as large as stated: the plan has too "
    "few repeats to be sure of finding it stated too small",
    "noise_shown": "bounds take the noise {factor:.2f} times as large as stated: readings of one "
    "pose, taken one after the other, scatter so much ({freedom:.0f} degrees of freedom)",
    "noise_estimated": "the noise is estimated in this campaign: {factor:.2f} times as large as "
    "planned with ({freedom:.0f} degrees of freedom)",
    "noise_tested": "the noise is that of a repeatability test ({freedom:.0f} degrees of freedom)",
    "noise_limited": "the noise is at most {factor:.2f} times that of the repeatability test "
    "({freedom:.0f} degrees of freedom), and bounds take it so large: readings may be wrong",
    "noise_bounded": "nothing repeats, so the noise is bounded by the size of all readings: at "
    "most {factor:.2f} times as large as planned with",
    # of budgets that are small
    "excepted_ahead": "the bound will be on all candidates but {excepted:.0f}; with {enough:.0f} "
    "readings it would be on all of them",
    # of decisions on a tolerance
    "between": "the tolerance lies between lower and upper bound: measure more",
    "contradict": "the bounds contradict each other or the value: is the noise stated too small?",
    "within": "the upper bound is within the tolerance",
    "beyond": "the lower bound exceeds the tolerance",
    "some_excepted": "the upper bound is within the tolerance, and leaves {excepted:.0f} "
    "candidates out: measure more points",
    "no_upper": "no upper bound is stated",
}


# What to do where readings speak against what bounds rest on, and these are withheld.
ADVICE = {
    "scatter": "begin a new campaign with the noise as it is, tested (kinacc repeatability) or "
    "estimated (--noise estimate); look first whether something moves",
    "tails": "look what came between; begin a new campaign, guarded by --wrong-readings where "
    "readings may go wrong",
    "wrong_readings": "look at each reading named: where something went wrong, strike it (kinacc "
    "campaign strike FOLDER NUMBER --reason ..) and read on; where nothing is found, begin a new "
    "campaign with --wrong-readings",
    "drift": "find what moved or warmed up, and begin a new campaign",
    "step": "find what moved, and begin a new campaign",
}


def reason(why: Reason | None) -> str | None:
    """A reason in words; None where there is none."""
    return None if why is None else REASONS[why.code].format(**why.numbers)
