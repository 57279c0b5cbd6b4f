"""The gains of the torque controller, and the gains from tracking errors to effort that follow.

Source: Del Prete et al., 2016, eq. 10 to 14.

    tau*  = tau_d + Kp (tau_d - tau_hat) + Ki int (tau_d - tau_hat) dt
    tau_d = M qddot_d + h - J^T (f_d + Kf e_f) + Ks e + Kd edot

With tau_hat = M qddot + h - J^T f_hat (estimate and controller share the model), e_f = f_d - f_hat and Ki = 0,

    K_tau tau* = K_tau (M qddot_d + h - J^T f_d) + K6 e + K7 edot + K8 eddot + K9 e_f
    K6 = K_tau (I + Kp) Ks             K7 = K_tau (I + Kp) Kd
    K8 = K_tau Kp M                    K9 = -K_tau (Kp J^T (I + Kf) + J^T Kf)

K6 = 1 is as stiff as the drive's own position servo. n joints, m = 6 x sensors force components.
"""

from dataclasses import dataclass, field

import numpy as np

from drake_tc.actuation.joint_effects import JointValues, Models, joint_values, model_list
from drake_tc.errors import ParamsError
from drake_tc.types import FloatArray


def _array(name: str, value: object, shape: tuple[int, ...], lowest: float = -np.inf) -> FloatArray:
    """A read-only copy of shape `shape`, a number spread over it."""
    array = np.asarray(value, dtype=np.float64)
    if array.ndim == 0 and len(shape) == 1:
        array = np.full(shape, float(array))
    if array.shape != shape:
        raise ParamsError(f"{name}: expected shape {shape}, got {array.shape}")
    if not (np.all(np.isfinite(array)) and np.all(array >= lowest)):
        bound = "" if np.isinf(lowest) else f" >= {lowest:g}"
        raise ParamsError(f"{name}: expected finite numbers{bound}, got {array.tolist()}")
    array = array.copy()
    array.setflags(write=False)
    return array


def _freeze(owner: object, name: str, shape: tuple[int, ...], lowest: float = -np.inf) -> None:
    object.__setattr__(owner, name, _array(name, getattr(owner, name), shape, lowest))


@dataclass(frozen=True, eq=False)
class TorqueGains:
    """Gains as a designer of the torque loop sets them.

    Attributes:
        kp: (n,) [-] torque feedback, >= 0.
        ki: (n,) [1/s] integral torque feedback, >= 0.
        ks: (n,) [N m/rad] stiffness, >= 0.
        kd: (n,) [N m s/rad] damping, >= 0. Of these four a number is taken for all joints; at least one is an array.
        kf: (m, m) [-] force feedback; (m,) is taken as its diagonal; (0, 0), the default, without force sensors.

    Raises:
        ParamsError: sizes that do not agree, a gain that is not finite or is negative where that cannot be.

    Example:
        >>> models = load_models(MODELS / "hrp2_like" / "hrp2_like_leg_actuators.yaml")
        >>> TorqueGains.from_servo(models, k6=0.5, kp=1.0).kp
        array([1., 1., 1., 1., 1., 1.])
    """

    kp: FloatArray
    ki: FloatArray
    ks: FloatArray
    kd: FloatArray
    kf: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))

    def __post_init__(self) -> None:
        names = ("kp", "ki", "ks", "kd")
        sizes = [shape for shape in (np.shape(getattr(self, name)) for name in names) if shape]
        if not sizes or len(sizes[0]) != 1 or sizes[0][0] < 1:
            raise ParamsError(
                f"kp, ki, ks, kd: expected one number per joint, shape (n,), in at least one, got shapes {sizes}"
            )
        for name in names:
            _freeze(self, name, sizes[0], 0.0)
        kf = np.asarray(self.kf, dtype=np.float64)
        if kf.ndim == 1:
            object.__setattr__(self, "kf", np.diag(kf) if kf.size else np.zeros((0, 0)))
        _freeze(self, "kf", (kf.shape[0] if kf.ndim else 0,) * 2)

    @property
    def size(self) -> int:
        """Joints n."""
        return int(self.kp.size)

    @classmethod
    def from_servo(
        cls,
        models: Models,
        k6: JointValues = 1.0,
        k7: JointValues = 0.0,
        kp: JointValues = 2.0,
        *,
        ki: JointValues = 0.0,
        kf: FloatArray | None = None,
    ) -> "TorqueGains":
        """Gains of a loop that is k6 times as stiff as the position servo: Ks = K6/(K (1 + Kp)), Kd = K7/(K (1 + Kp)).

        K6 and K7 are the gains from e and edot to the effort (see the module), so that they compare with the servo's
        own; K is the drive gain of each model.

        Args:
            models: One per joint, by joint or in order.
            k6: [effort/rad]; 1 is as stiff as a position servo. One number, one per joint, or by joint, as the others.
            k7: [effort s/rad].
            kp: [-].
            ki: [1/s].
            kf: (m,) diagonal or (m, m); None: no force sensors.

        Raises:
            ParamsError: sizes that do not agree, or a gain that is negative or not finite.
        """
        listed = model_list(models)
        joints = [model.joint for model in listed]
        of = {name: joint_values(name, v, joints) for name, v in (("k6", k6), ("k7", k7), ("kp", kp), ("ki", ki))}
        for name, values in of.items():
            _array(name, values, values.shape, 0.0)
        loop = np.array([model.drive.gain for model in listed]) * (1.0 + of["kp"])
        force = np.zeros((0, 0)) if kf is None else kf
        return cls(of["kp"], of["ki"], of["k6"] / loop, of["k7"] / loop, force)
