"""Contacts held where they were made: the acceleration that takes drift and slip out again."""

from collections.abc import Sequence

import numpy as np

from drake_tc.control.rotation import rotation_vector
from drake_tc.tsid.terms import Pose, Terms
from drake_tc.types import FloatArray


def anchors(terms: Terms) -> list[Pose]:
    """Where the active contacts are now: (R_WC, p_WC) each, to be kept while they last."""
    return [terms.pose(contact.name) for contact in terms.contacts.contacts]


def holding_acceleration(terms: Terms, places: Sequence[Pose] | None, kp: float, kd: float) -> FloatArray:
    """a_c = -kd J v - kp [R^T (p - p_0); -log(R^T R_0)] of the active contacts (k,), rows as in J.

    Args:
        terms: At the state.
        places: (R_0, p_0) of each active contact, from `anchors`; None for damping alone.
        kp: [1/s^2].
        kd: [1/s].
    """
    wanted = -kd * terms.contact_velocity
    if places is None or kp == 0.0:
        return wanted
    for contact, rows, (rotation_0, position_0) in zip(
        terms.contacts.contacts, terms.contacts.rows, places, strict=True
    ):
        rotation, position = terms.pose(contact.name)
        drift = position - position_0
        if not contact.upright:
            drift = rotation.T.dot(drift)
        if contact.size == 6:
            drift = np.concatenate((drift, -rotation_vector(rotation.T.dot(rotation_0))))
        wanted[rows] -= kp * drift
    return wanted
