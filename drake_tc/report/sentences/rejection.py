"""Why an effect was not added, as a sentence."""

from typing import assert_never

from drake_tc.diagnosis.result.joint_result import RejectedEffect

NO_GAIN = 5e-4
"""Cross-validated gain below which an effect is said not to lower the error at all."""


def why_rejected(rejected: RejectedEffect) -> str:
    """One sentence without its full stop."""
    match rejected.reason:
        case "cannot_be_looked_for" | "not_recorded" | "not_excited":
            return rejected.obstacle
        case "too_little_gain" if rejected.train_gain < NO_GAIN:
            return "it does not lower the cross-validated error"
        case "too_little_gain":
            gain, least = 100 * rejected.train_gain, 100 * rejected.least_gain
            return f"it lowers the cross-validated error by {gain:.1f} %, less than {least:g} %"
        case "unstable":
            return f"it helps in only {100 * rejected.share:.0f} % of the resamples"
        case "untested":
            return "untested: the held-out runs ask for more effort than the training runs ever did"
        case "below_floor":
            return "it explains less than the sensors resolve"
        case "too_little_evidence":
            return "the logs hold too few independent samples to tell it from chance"
        case "imperfect_form":
            return "what it explains is small beside the chosen effects, and is more likely an error in their form"
        case "withdrawn":
            return "the search chose it, but it did not hold; the reason is listed among the effects that did not hold"
        case "not_chosen":
            return (
                "beside the chosen effects it passes the thresholds, but the search, which compares whole sets of "
                "effects, took the other ones"
            )
        case _:
            assert_never(rejected.reason)
