"""Why an effect was not added, as a sentence."""

from drake_tc.diagnosis.priors import ALTERNATIVE
from drake_tc.diagnosis.result.joint_result import RejectedEffect


def why_rejected(rejected: RejectedEffect) -> str:
    """One sentence without its full stop."""
    if rejected.reason != "too_little_evidence":
        return rejected.obstacle
    return f"the log odds of the model with it are {rejected.log_odds:+.1f}; {ALTERNATIVE:+g} are required"
