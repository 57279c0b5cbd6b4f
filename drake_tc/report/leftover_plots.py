"""Where the unexplained remainder is: the residual after, against the signals that it depends on."""

from collections.abc import Sequence

from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.report.numbers import scale_for
from drake_tc.report.residual_plots import FULL_LOOK, Cloud, CloudLook, cloud_svg
from drake_tc.report.rows import quantity, rows_of
from drake_tc.report.signature_plots import SIZE

MOST_PLOTS = 4


def leftover_plots(joint: JointResult, prefix: str, look: CloudLook = FULL_LOOK) -> Sequence[str]:
    """Panels of SVG, most important signal first; stretches that stand out are shaded. None without structure.

    The held-out runs are drawn, unless every stretch that stands out lies in the training runs: then those are.
    """
    left = joint.unexplained
    if not left.structured:
        return []
    held = joint.heldout.samples.runs
    in_training = bool(left.confined_to) and not any(s.run in held for s in left.confined_to)
    split, where = (joint.train, "training runs") if in_training else (joint.heldout, "held-out runs")
    rows = rows_of(split)
    scale = scale_for(float(abs(split.after).max()), joint.unit)
    panels = []
    for name in left.depends_on[:MOST_PLOTS]:
        against = quantity(split, name, joint.unit, left.confined_to)
        if against is not None:
            title, own = f"after, {where}", f"{prefix}-left-{name}"
            cloud = Cloud(own, title, split.after, scale, joint.noise_floor, size=SIZE, look=look)
            panels.append(cloud_svg(cloud, against, rows))
    return panels
