"""Why an effect was not added, as a sentence."""

from drake_tc.diagnosis.result.joint_result import RejectedEffect
from drake_tc.diagnosis.thresholds import JOINT

NO_GAIN = 5e-4
"""Cross-validated gain below which an effect is said not to lower the error at all."""


def why_rejected(rejected: RejectedEffect) -> str:
    """One sentence without its full stop."""
    least = JOINT.least_gain
    if rejected.reason == "cannot_be_looked_for":
        return rejected.obstacle
    if rejected.reason == "untested":
        return "untested: the held-out runs ask for more effort than the training runs ever did"
    if rejected.reason == "too_little_gain":
        if rejected.train_gain < NO_GAIN:
            return "it does not lower the cross-validated error"
        return f"it lowers the cross-validated error by {100 * rejected.train_gain:.1f} %, less than {100 * least:g} %"
    if rejected.reason == "below_floor":
        return "it explains less than the sensors resolve"
    if rejected.reason == "unstable":
        return f"it helps in only {100 * rejected.share:.0f} % of the resamples"
    return "what it explains is small beside the chosen effects, and is more likely an error in their form"
