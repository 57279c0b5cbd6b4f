"""How wrong a model's joint torques are, as a file: `close-loop` writes it, controllers read their Sigma from it.

What makes a matrix a covariance.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
import yaml

from drake_tc.config.files import write_whole
from drake_tc.config.keys import AnyNumber, Keys, Names, Number, key
from drake_tc.config.quoted import quoted
from drake_tc.config.records import validated
from drake_tc.config.yaml_file import read_yaml
from drake_tc.errors import ParamsError
from drake_tc.types import FloatArray

ROUNDING = 1e-9
"""Relative to the largest variance: how far from symmetric and positive semidefinite a covariance may be."""


def checked_covariance(covariance: FloatArray) -> FloatArray:
    """(n, n) exactly symmetric, variances >= 0, of a matrix that is so but for rounding.

    Args:
        covariance: (n, n), n >= 1.

    Raises:
        ParamsError: not finite, not symmetric or not positive semidefinite.
    """
    if not np.isfinite(covariance).all():
        raise ParamsError("covariance: expected finite numbers, got NaN or infinity")
    largest = float(np.abs(np.diagonal(covariance)).max())
    skewness = float(np.abs(covariance - covariance.T).max())
    if skewness > ROUNDING * largest:
        raise ParamsError(f"covariance: expected a symmetric matrix; it differs from its transpose by {skewness:.3g}")
    mean: FloatArray = 0.5 * (covariance + covariance.T)
    lowest = float(np.linalg.eigvalsh(mean)[0])
    if lowest < -ROUNDING * largest:
        raise ParamsError(
            f"covariance: expected a positive semidefinite matrix; its smallest eigenvalue is {lowest:.3g}"
        )
    np.fill_diagonal(mean, np.maximum(np.diagonal(mean), 0.0))
    return mean


SCHEMA = 1
UNIT = "N*m"


class TorqueUncertaintyDocument(Keys):
    """What a torque uncertainty file may say. Only `joints` and `covariance` are used by controllers."""

    version: Literal[1] = key("Version of the file's layout.", name="schema", example=1, default=..., expected="1")
    unit: Literal["N*m"] = key(
        "Unit of the torques; the force of a joint that slides is in N.", example=UNIT, default=..., expected=UNIT
    )
    joints: Names = key("Joints, in the order of rows and columns.", example=["hip"], default=..., expected="names")
    covariance: list[list[Number]] = key(
        "E[e eᵀ] of the torque error e, the mean not taken off.",
        unit="(N·m)²",
        example=[[4.0]],
        default=...,
        expected="a list of rows",
    )
    mean: list[AnyNumber] | None = key("Mean of the error.", unit="N·m", example=[0.1], absent="not known")
    sigma_ci95: list[list[AnyNumber]] | None = key(
        "95 % interval of each standard deviation.", unit="N·m", example=[[1.8, 2.2]], absent="not known"
    )
    correlation_time: list[AnyNumber] | None = key(
        "Correlation time of the error.", unit="s", example=[0.02], absent="not known"
    )
    effective_samples: list[AnyNumber] | None = key(
        "Independent samples that would know the standard deviation as well.", example=[120.0], absent="not known"
    )
    samples: list[AnyNumber] | None = key("Rows that were looked at.", example=[4000.0], absent="not known")
    common_effective_samples: Number = key(
        "Effective samples over rows of all joints; 0 for a diagonal covariance.", example=80.0, default=0.0
    )
    shrinkage: Number = key("Share by which the correlations were drawn towards 0.", example=0.1, default=0.0)
    reference: dict[str, dict[str, AnyNumber]] | None = key(
        "By joint and cause of a ModelMonitor: the model error while nothing has changed, which it subtracts.",
        example={"hip": {"friction": 0.02}},
        absent="0",
    )
    provenance: dict[str, Any] | None = key(
        "Where the numbers come from; free-form.", example={"rig": "rig.yaml"}, absent="not known"
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
        reference: By joint and cause of a `ModelMonitor`, the change by which the model is off from the beginning.

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
    reference: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = len(self.joints)
        if n < 1 or len(set(self.joints)) != n:
            raise ParamsError(f"joints: expected at least one name, each once, got {list(self.joints)}")
        sizes = {"mean": (n,), "ci95": (n, 2)} | dict.fromkeys(
            ("correlation_time", "effective_samples", "samples"), (n,)
        )
        for name, shape in sizes.items():
            value = np.array(getattr(self, name), dtype=np.float64)
            if value.shape != shape:
                raise ParamsError(f"{name}: expected shape {shape}, as there are {n} joints, got {value.shape}")
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        covariance = np.asarray(self.covariance, dtype=np.float64)
        if covariance.shape != (n, n):
            raise ParamsError(f"covariance: expected shape {(n, n)}, as there are {n} joints, got {covariance.shape}")
        covariance = checked_covariance(covariance)
        covariance.setflags(write=False)
        object.__setattr__(self, "covariance", covariance)
        if not 0.0 <= self.shrinkage <= 1.0:
            raise ParamsError(f"shrinkage: expected 0 to 1, got {self.shrinkage}")

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
    read = validated(TorqueUncertaintyDocument, document, str(path))
    n = len(read.joints)

    def numbers(value: list[Any] | None, *shape: int) -> FloatArray:
        return np.full(shape, np.nan) if value is None else np.array(value, dtype=np.float64)

    try:
        _check_rows("covariance", read.covariance)
        _check_rows("sigma_ci95", read.sigma_ci95 or [])
        return TorqueUncertainty(
            joints=tuple(read.joints),
            covariance=numbers(read.covariance),
            mean=numbers(read.mean, n),
            ci95=numbers(read.sigma_ci95, n, 2),
            correlation_time=numbers(read.correlation_time, n),
            effective_samples=numbers(read.effective_samples, n),
            samples=numbers(read.samples, n),
            common_effective_samples=read.common_effective_samples,
            shrinkage=read.shrinkage,
            reference=read.reference or {},
            provenance=read.provenance or {},
        )
    except ParamsError as error:
        raise ParamsError(f"{path}: {error}") from None


def _check_rows(name: str, rows: list[list[float]]) -> None:
    if len({len(row) for row in rows}) > 1:
        raise ParamsError(f"{name}: expected rows of one length, got lengths {quoted([len(row) for row in rows])}")


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
    }
    if uncertainty.reference:
        document["reference"] = {joint: dict(off) for joint, off in uncertainty.reference.items()}
    document["provenance"] = dict(uncertainty.provenance)
    head = (
        "# Torque by which the model after errs on runs that took no part in fitting: link side [N m], about zero.\n"
        "# Of a joint that slides it is a force [N].\n"
        "# covariance: rows and columns as in joints; sigma_ci95 [N m]; correlation_time [s].\n"
    )
    body = yaml.safe_dump(document, sort_keys=False, allow_unicode=True, default_flow_style=None, width=10**6)
    path = Path(path)
    write_whole(path, head + body)
    return path
