"""The report's section on causes that no single joint owns: what, where, by how much, and which joints say so."""

from collections.abc import Sequence
from dataclasses import dataclass

from drake_tc.diagnosis.result.rig_result import CloseLoopResult, SharedEffect
from drake_tc.report.numbers import interval, percent, pretty_unit, significant
from drake_tc.report.tables import ErrorTable, error_table
from drake_tc.report.words import joined, title_of

MEANING = {
    "link_mass": "the difference between the mass of the link and that in the robot's model",
    "link_com": "the offset of its centre of mass from that of the model, in the link's axes",
    "encoder_offset": "the constant error of the encoder's reading: the zero of the joint is wrong",
    "payload": "what the link carries beyond the robot's file, such as a tool: mass, and centre in the link's frame",
    "ft_bias": "the constant offset of the sensor, in its own axes",
    "ft_gain": "the relative error of the sensor's scale",
    "imu_bias": "the constant offset of the IMU, in its own axes",
    "delay": "the common delay from the command to the torque of every drive; it is part of each joint's model",
}
LATE_ENCODER = "the delay of the encoder's readings; the diagnosis compensates it"
LEAST_GAIN = 0.01


@dataclass(frozen=True)
class SharedCard:
    """One cause as the template shows it: texts only, and the width of each joint's bar [%]."""

    id: str
    title: str
    where: str
    meaning: str
    gain: str
    stability: str
    parameters: Sequence[tuple[str, str, str, str]]
    joints: Sequence[tuple[str, str, float, ErrorTable]]
    indistinguishable: str


def shared_section(result: CloseLoopResult) -> Sequence[SharedCard]:
    """A card for each shared cause; none when there is none."""
    return [_card(cause, result) for cause in result.shared]


def _card(cause: SharedEffect, result: CloseLoopResult) -> SharedCard:
    parameters = []
    for name, value in cause.parameters.items():
        shown, spread = interval(value.value, *value.ci95)
        parameters.append((name.replace("_", " "), shown, spread, pretty_unit(value.unit)))
    joints = [
        (name, percent(gain) if gain > LEAST_GAIN else significant(0.0), 100.0 * max(gain, 0.0), error_table(joint))
        for name, gain, joint in ((j.joint, cause.joints.get(j.joint, 0.0), j) for j in result.joints.values())
    ]
    return SharedCard(
        id=cause.id,
        title=cause.title,
        where=cause.where,
        meaning=LATE_ENCODER if cause.id == "delay" and cause.where in result.joints else MEANING[cause.id],
        gain=percent(cause.heldout_gain),
        stability=percent(cause.stability),
        parameters=parameters,
        joints=joints,
        indistinguishable=joined([f"{title_of(name)} ({where})" for name, where in cause.indistinguishable]),
    )
