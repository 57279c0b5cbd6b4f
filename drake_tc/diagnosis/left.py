"""What the logs could have shown."""

import numpy as np

from drake_tc.diagnosis.data.samples import rms
from drake_tc.diagnosis.evidence import Evidence, Scored
from drake_tc.diagnosis.priors import NAMED_FLOORS, SEEN


def visible_share(evidence: Evidence, scored: Scored, floor: float) -> float:
    """Smallest RMS effort error that the rows could have shown, over the RMS of the effort.

    A term x with coefficient c raises the log likelihood by c^2 |x|^2/(2 s^2), |x| that of the whitened
    column beside the others. `SEEN` of it, for a column as loud after the whitening as the effort itself, or half a
    noise floor.
    """
    model = evidence.model
    rows = model.train.rows
    effort = model.train.recorded.effort(())
    white = rows.whitened(effort[:, None], evidence.noise)[0]
    share = rms(white) / max(rms(effort[rows.index]), 1e-300)
    least = np.sqrt(2.0 * SEEN * scored.posterior.variance / max(white.shape[0], 1)) / max(share, 1e-300)
    return float(max(least, NAMED_FLOORS * floor) / model.scale)
