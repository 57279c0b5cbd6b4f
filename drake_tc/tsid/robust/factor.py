"""A Hessian H = L L^T as Newton's steps use it."""

from typing import Protocol

from scipy.linalg.lapack import dpotrf, dpotrs, dtrtrs

from drake_tc.types import FloatArray


class Factor(Protocol):
    """L of H = L L^T.

    Attributes:
        failed: Whether H was not positive definite; nothing else is to be used then.
    """

    failed: bool

    def solve(self, vector: FloatArray) -> FloatArray:
        """H^-1 v, for v (n,)."""
        ...

    def whiten(self, columns: FloatArray) -> FloatArray:
        """L^-1 B, for B (n, k)."""
        ...

    def colour(self, vector: FloatArray) -> FloatArray:
        """L^-T v, for v (n,)."""
        ...

    def hessian(self) -> FloatArray:
        """(n, n) H."""
        ...


class DenseFactor:
    """Cholesky's, of a full matrix."""

    def __init__(self, hessian: FloatArray) -> None:
        self._hessian = hessian
        self._lower, failed = dpotrf(hessian, lower=1)
        self.failed = bool(failed)

    def solve(self, vector: FloatArray) -> FloatArray:
        """See `Factor`."""
        solved: FloatArray = dpotrs(self._lower, vector, lower=1)[0]
        return solved

    def whiten(self, columns: FloatArray) -> FloatArray:
        """See `Factor`."""
        whitened: FloatArray = dtrtrs(self._lower, columns, lower=1)[0]
        return whitened

    def colour(self, vector: FloatArray) -> FloatArray:
        """See `Factor`."""
        coloured: FloatArray = dtrtrs(self._lower, vector, lower=1, trans=1)[0]
        return coloured

    def hessian(self) -> FloatArray:
        """See `Factor`."""
        return self._hessian
