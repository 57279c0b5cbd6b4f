"""Why an effect was not added, as a sentence."""

from collections.abc import Mapping

from drake_tc.diagnosis.result.joint_result import RejectedEffect, Rejection

NO_GAIN = 5e-4
"""Cross-validated gain below which an effect is said not to lower the error at all."""
SENTENCES: Mapping[Rejection, str] = {
    "untested": "untested: the held-out runs ask for more effort than the training runs ever did",
    "below_floor": "it explains less than the sensors resolve",
    "too_little_evidence": "the logs hold too few independent samples to tell it from chance",
    "imperfect_form": "what it explains is small beside the chosen effects, and is more likely an error in their form",
    "withdrawn": "the search chose it, but it did not hold; the reason is listed among the effects that did not hold",
    "not_chosen": "beside the chosen effects it passes the thresholds, but the search, which compares whole sets of "
    "effects, took the other ones",
}
"""Of the reasons that need no figures."""


def why_rejected(rejected: RejectedEffect) -> str:
    """One sentence without its full stop."""
    if rejected.reason == "cannot_be_looked_for":
        return rejected.obstacle
    if rejected.reason == "too_little_gain":
        if rejected.train_gain < NO_GAIN:
            return "it does not lower the cross-validated error"
        gain, least = 100 * rejected.train_gain, 100 * rejected.least_gain
        return f"it lowers the cross-validated error by {gain:.1f} %, less than {least:g} %"
    if rejected.reason == "unstable":
        return f"it helps in only {100 * rejected.share:.0f} % of the resamples"
    return SENTENCES[rejected.reason]
