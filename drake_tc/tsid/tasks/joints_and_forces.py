"""Tasks of the joints: posture and torque.

The joints follow positions.

The torques stay near a reference.

Tasks of the contacts: forces and centres of pressure.

The contact forces stay near a reference.

The centre of pressure of a sole stays near a reference point.
"""

from collections.abc import Sequence

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.kernels.calls import Kernel
from drake_tc.tsid.contacts import ActiveContacts
from drake_tc.tsid.fused import Entry
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.rows import Parts, TaskRows, Terms, identity, selection
from drake_tc.tsid.tasks.base import Gains, gains
from drake_tc.types import FloatArray

_TARGET = Kernel("tsid.rows", "posture")


class PostureTask:
    """qdd_j = qdd_d + kp (q_d - q_j) + kd (qd_d - qd_j) of each chosen joint j.

    Reference (3n,): [q_d; qd_d; qdd_d] of all joints in the robot's order [rad, rad/s, rad/s^2].
    """

    def __init__(
        self,
        model: TsidModel,
        kp: Gains,
        kd: Gains,
        *,
        weight: Gains = 1.0,
        joints: Sequence[str] | None = None,
        name: str = "posture",
    ) -> None:
        """Keep the gains.

        Args:
            model: Of the robot.
            kp: Of each chosen joint, or one for all [1/s^2].
            kd: The same [1/s].
            weight: Of each chosen joint, or one for all.
            joints: Which take part; None for all, in the robot's order.
            name: Of the task.

        Raises:
            ParamsError: a joint that is not there or is named twice; gains or weights that are negative, not finite
                or of another size.
        """
        names = model.robot.joints
        selected = names if joints is None else tuple(joints)
        for i, joint in enumerate(selected):
            if joint not in names:
                raise ParamsError(f"task {name!r}: no joint {joint!r}; joints: {', '.join(names)}")
            if joint in selected[:i]:
                raise ParamsError(f"task {name!r}: joint {joint!r} is named twice")
        if not selected:
            raise ParamsError(f"task {name!r}: expected at least one joint, got none")
        self.name, self.reference_size = name, 3 * model.n
        self.weight = gains(f"task {name!r}: weight", weight, len(selected))
        self._kp = gains(f"task {name!r}: kp", kp, len(selected))
        self._kd = gains(f"task {name!r}: kd", kd, len(selected))
        self._joints = chosen = np.array([names.index(joint) for joint in selected], dtype=np.int64)
        self._velocity, self._position = model.actuated[chosen], model.positions[chosen]
        self._parts = selection(model.actuated[chosen], model.nv)

    def rest(self, terms: Terms) -> FloatArray:
        """The reference that asks for nothing at this state."""
        return np.concatenate((terms.joint_position, np.zeros(2 * terms.joint_position.size)))

    def compiled_entry(self, contacts: ActiveContacts) -> Entry:
        """Its numbers for the compiled tick."""
        places = self._joints, self._position, self._velocity
        return Entry("posture", self._joints.size, places, (self._kp, self._kd, self.weight))

    def rows(self, terms: Terms, reference: FloatArray) -> TaskRows:
        """The rows at this state."""
        places = self._joints, self._position, self._velocity
        target = _TARGET(terms.q, terms.v, places, (self._kp, self._kd), reference)
        return TaskRows(self.name, self._parts, target, self.weight)


class TorqueTask:
    """tau = tau_d, each joint with its weight; with tau_d = 0 the cost of torques of Faraji et al. (2015), Q_tau =
    weight^2.

    Reference (n,): tau_d in the robot's order [N m].
    """

    def __init__(self, model: TsidModel, *, weight: Gains = 1.0, name: str = "torque") -> None:
        """Keep the weights.

        Args:
            model: Of the robot.
            weight: Of each joint, or one for all.
            name: Of the task.

        Raises:
            ParamsError: weights that are negative, not finite or of another size.
        """
        self.name, self.reference_size = name, model.n
        self.weight = gains(f"task {name!r}: weight", weight, model.n)
        self._parts = Parts(torque=identity(model.n))

    def rest(self, terms: Terms) -> FloatArray:
        """The reference that asks for nothing at this state."""
        return np.zeros(self.reference_size)

    def compiled_entry(self, contacts: ActiveContacts) -> Entry:
        """Its numbers for the compiled tick."""
        return Entry("torque", self.weight.size, (), (self.weight,))

    def rows(self, terms: Terms, reference: FloatArray) -> TaskRows:
        """The rows at this state."""
        return TaskRows(self.name, self._parts, reference, self.weight)


class ForceTask:
    """f = f_d of the contacts that are active, each component with its weight.

    Reference (K,): f_d of all contacts of the model, active or not, in their axes [N, N m].

    With f_d = 0 and more weight on tangential forces and moments it is the paper's force regularisation.
    """

    def __init__(
        self, model: TsidModel, *, weight: float = 1.0, components: Sequence[float] | None = None, name: str = "force"
    ) -> None:
        """Keep the weights.

        Args:
            model: Of the robot, with contacts.
            weight: Of the task (the paper's w_f).
            components: (6,) weights of [fx fy fz tx ty tz] in every contact (a point takes the first three), or (K,)
                of all contacts, which is what six are of two points; None for ones. They multiply `weight`.
            name: Of the task.

        Raises:
            ParamsError: a model without contacts; weights that are negative, not finite or of another size.
        """
        if not model.contacts:
            raise ParamsError(
                f"task {name!r}: expected a model with contacts; robot {model.robot.name!r} has none here"
            )
        whole: Gains = 1.0 if components is None else np.asarray(components, dtype=float)
        if components is not None and len(components) == 6 != model.force_size:
            whole = np.concatenate([np.asarray(components, dtype=float)[: contact.size] for contact in model.contacts])
        scale = gains(f"task {name!r}: weight", weight, 1)
        self.name, self.reference_size = name, model.force_size
        self.weight = gains(f"task {name!r}: components", whole, model.force_size) * scale

    def rest(self, terms: Terms) -> FloatArray:
        """The reference that asks for nothing at this state."""
        return np.zeros(self.reference_size)

    def compiled_entry(self, contacts: ActiveContacts) -> Entry:
        """Its numbers for the compiled tick."""
        entries = contacts.entries
        return Entry("force", entries.size, (entries,), (self.weight[entries],))

    def rows(self, terms: Terms, reference: FloatArray) -> TaskRows:
        """The rows at this state."""
        entries = terms.contacts.entries
        return TaskRows(self.name, Parts(force=identity(entries.size)), reference[entries], self.weight[entries])


_ROWS = Kernel("tsid.rows", "pressure")


class CopTask:
    """x_d fz + ty = 0 and y_d fz - tx = 0 of one surface contact: its centre of pressure (-ty, tx) / fz is (x_d, y_d).

    Linear in f: the rows are the distance to the reference point times fz [N m]. Without rows while the contact is off.
    Reference (2,): [x_d; y_d] in the contact's frame [m].
    """

    reference_size = 2

    def __init__(self, model: TsidModel, contact: str, *, weight: Gains = 1.0, name: str | None = None) -> None:
        """Keep the weights.

        Args:
            model: Of the robot.
            contact: A surface contact of the model.
            weight: Of x and y, or one for both.
            name: Of the task; None for "<contact> pressure".

        Raises:
            ParamsError: a contact that is not there or is a point; weights that are negative, not finite or of
                another size.
        """
        self.name = f"{contact} pressure" if name is None else name
        surfaces = {item.name: i for i, item in enumerate(model.contacts) if item.kind == "surface"}
        if contact not in surfaces:
            raise ParamsError(
                f"task {self.name!r}: no surface contact {contact!r}; possible: {', '.join(surfaces) or 'none'}"
            )
        self._index = surfaces[contact]
        self.weight = gains(f"task {self.name!r}: weight", weight, 2)
        self._none = np.zeros(0)

    def rest(self, terms: Terms) -> FloatArray:
        """The reference that asks for nothing at this state."""
        return np.zeros(self.reference_size)

    def compiled_entry(self, contacts: ActiveContacts) -> Entry:
        """Its numbers for the compiled tick."""
        if self._index not in contacts.index:
            return Entry("pressure", 0, (0,), ())
        start = contacts.rows[contacts.index.index(self._index)].start
        return Entry("pressure", 2, (start,), (self.weight,))

    def rows(self, terms: Terms, reference: FloatArray) -> TaskRows:
        """The rows at this state."""
        active = terms.contacts
        if self._index not in active.index:
            return TaskRows(self.name, Parts(force=np.zeros((0, active.size))), self._none, self._none)
        start = active.rows[active.index.index(self._index)].start
        matrix = _ROWS(reference, start, active.size)
        return TaskRows(self.name, Parts(force=matrix), np.zeros(2), self.weight)
