"""How wrong a model's joint torques are, as a file: `close-loop` writes it, controllers read their Sigma from it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from drake_tc.config.yaml_file import read_yaml
from drake_tc.control.covariance import checked_covariance
from drake_tc.errors import ParamsError
from drake_tc.types import FloatArray

SCHEMA = 1
UNIT = "N*m"

_REQUIRED = ("schema", "unit", "joints", "covariance")
_OPTIONAL = (
    "mean",
    "sigma_ci95",
    "correlation_time",
    "effective_samples",
    "samples",
    "common_effective_samples",
    "shrinkage",
    "provenance",
)


@dataclass(frozen=True, eq=False)
class TorqueUncertainty:
    """Covariance of the link-side torque by which a model errs, e ~ (0, Sigma); n joints.

    Attributes:
        joints: Names, in the order of rows and columns.
        covariance: (n, n) Sigma = E[e e^T] [(N m)^2], the mean not taken off: symmetric, positive semidefinite.
        mean: (n,) of e [N m].
        ci95: (n, 2) 95 % interval of each sigma [N m].
        correlation_time: (n,) integrated over positive and negative lags [s].
        effective_samples: (n,) independent normal samples that would know sigma as well.
        samples: (n,) rows that were looked at.
        common_effective_samples: The same for the covariances, over rows of all joints; 0: diagonal only.
        shrinkage: Share in [0, 1] by which the correlations were drawn towards 0.
        provenance: Where the numbers come from; free-form.

    Raises:
        ParamsError: sizes that do not agree, numbers that are not finite, or a matrix that is no covariance.
    """

    joints: tuple[str, ...]
    covariance: FloatArray
    mean: FloatArray
    ci95: FloatArray
    correlation_time: FloatArray
    effective_samples: FloatArray
    samples: FloatArray
    common_effective_samples: float = 0.0
    shrinkage: float = 0.0
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = len(self.joints)
        if n < 1 or len(set(self.joints)) != n:
            raise ParamsError(f"joints: wanted at least one name, each once; got {list(self.joints)}")
        sizes = {"mean": (n,), "ci95": (n, 2)} | dict.fromkeys(
            ("correlation_time", "effective_samples", "samples"), (n,)
        )
        for name, shape in sizes.items():
            value = np.array(getattr(self, name), dtype=np.float64)
            if value.shape != shape:
                raise ParamsError(f"{name}: wanted shape {shape}, as there are {n} joints; got {value.shape}")
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        covariance = np.asarray(self.covariance, dtype=np.float64)
        if covariance.shape != (n, n):
            raise ParamsError(f"covariance: wanted shape {(n, n)}, as there are {n} joints; got {covariance.shape}")
        covariance = checked_covariance(covariance)
        covariance.setflags(write=False)
        object.__setattr__(self, "covariance", covariance)
        if not 0.0 <= self.shrinkage <= 1.0:
            raise ParamsError(f"shrinkage: wanted 0 to 1; got {self.shrinkage}")

    @property
    def sigma(self) -> FloatArray:
        """(n,) [N m]."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def correlation(self) -> FloatArray:
        """(n, n); 0 beside a joint without any error."""
        outer = np.outer(self.sigma, self.sigma)
        return np.asarray(
            np.where(outer > 0.0, self.covariance / np.where(outer > 0.0, outer, 1.0), np.eye(len(outer)))
        )

    def of(self, joints: Sequence[str]) -> FloatArray:
        """Sigma (m, m) of these joints, in this order [(N m)^2].

        Raises:
            ParamsError: a joint that is not here.
        """
        for joint in joints:
            if joint not in self.joints:
                raise ParamsError(f"torque uncertainty: no joint {joint!r}; joints here: {', '.join(self.joints)}")
        at = [self.joints.index(joint) for joint in joints]
        return np.asarray(self.covariance[np.ix_(at, at)])


def load_torque_uncertainty(path: Path | str) -> TorqueUncertainty:
    """Read the file strictly; what only describes the estimate may be missing (NaN then).

    Raises:
        ParamsError: the file cannot be read, a key is unknown, missing or given twice, or a value is not possible; the
            message names file and key.
    """
    document = read_yaml(Path(path), "torque uncertainty file")
    possible = (*_REQUIRED, *_OPTIONAL)
    if not isinstance(document, dict):
        raise ParamsError(f"{path}: wanted a mapping with {', '.join(_REQUIRED)}; got {type(document).__name__}")
    for key in document:
        if key not in possible:
            raise ParamsError(f"{path}: unknown key {key!r}; possible: {', '.join(possible)}")
    for key in _REQUIRED:
        if key not in document:
            raise ParamsError(f"{path}: missing key {key!r}; wanted: {', '.join(_REQUIRED)}")
    if document["schema"] != SCHEMA or document["unit"] != UNIT:
        raise ParamsError(
            f"{path}: wanted schema {SCHEMA} and unit {UNIT}; got {document['schema']!r} and {document['unit']!r}"
        )
    joints = document["joints"]
    if not isinstance(joints, list) or not all(isinstance(joint, str) and joint for joint in joints):
        raise ParamsError(f"{path}: joints: wanted a list of names; got {joints!r}")
    try:
        return _from_document(document, tuple(joints))
    except ParamsError as error:
        raise ParamsError(f"{path}: {error}") from None


def _from_document(document: Mapping[str, Any], joints: tuple[str, ...]) -> TorqueUncertainty:
    n = len(joints)

    def numbers(key: str, shape: tuple[int, ...]) -> FloatArray:
        value = document.get(key)
        return np.full(shape, np.nan) if value is None else _array(key, value)

    provenance = document.get("provenance") or {}
    if not isinstance(provenance, dict):
        raise ParamsError(f"provenance: wanted a mapping; got {provenance!r}")
    return TorqueUncertainty(
        joints=joints,
        covariance=_array("covariance", document["covariance"]),
        mean=numbers("mean", (n,)),
        ci95=numbers("sigma_ci95", (n, 2)),
        correlation_time=numbers("correlation_time", (n,)),
        effective_samples=numbers("effective_samples", (n,)),
        samples=numbers("samples", (n,)),
        common_effective_samples=_number("common_effective_samples", document.get("common_effective_samples", 0.0)),
        shrinkage=_number("shrinkage", document.get("shrinkage", 0.0)),
        provenance=provenance,
    )


def _array(key: str, value: object) -> FloatArray:
    rows = value if isinstance(value, list) else [value]
    if any(isinstance(row, list) for row in rows):
        each = [_array(key, row) for row in rows]
        if len({row.shape for row in each}) != 1:
            raise ParamsError(f"{key}: wanted rows of one length; got {value!r}")
        return np.array(each)
    return np.array([_number(key, row) for row in rows])


def _number(key: str, value: object) -> float:
    """A float; text such as 1e-4, which YAML 1.1 does not take for a number, is read as one."""
    if isinstance(value, (int, float, str)) and not isinstance(value, bool):
        try:
            return float(value)
        except ValueError:
            pass
    raise ParamsError(f"{key}: wanted numbers; got {value!r}")


def save_torque_uncertainty(uncertainty: TorqueUncertainty, path: Path | str) -> Path:
    """Write a file that `load_torque_uncertainty` reads back to the same numbers."""
    document: dict[str, Any] = {
        "schema": SCHEMA,
        "unit": UNIT,
        "joints": list(uncertainty.joints),
        "covariance": uncertainty.covariance.tolist(),
        "mean": uncertainty.mean.tolist(),
        "sigma_ci95": uncertainty.ci95.tolist(),
        "correlation_time": uncertainty.correlation_time.tolist(),
        "effective_samples": uncertainty.effective_samples.tolist(),
        "samples": [int(count) for count in uncertainty.samples],
        "common_effective_samples": float(uncertainty.common_effective_samples),
        "shrinkage": float(uncertainty.shrinkage),
        "provenance": dict(uncertainty.provenance),
    }
    head = (
        "# Torque by which the model after errs on runs that took no part in fitting: link side [N m], about zero.\n"
        "# covariance: rows and columns as in joints; sigma_ci95 [N m]; correlation_time [s].\n"
    )
    body = yaml.safe_dump(document, sort_keys=False, allow_unicode=True, default_flow_style=None, width=10**6)
    path = Path(path)
    path.write_text(head + body, encoding="utf-8")
    return path
