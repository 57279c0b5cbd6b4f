"""One joint of the torque loop, tick by tick and without polynomials: an independent account of what is predicted."""

from collections import deque

import numpy as np

DT = 1e-3


class PolynomialWindow:
    """Value, rate and second derivative at mid-window of a polynomial through the last samples (numpy's polyfit)."""

    def __init__(self, window, order, first):
        self.samples = deque([first] * window, maxlen=window)
        self.time = (np.arange(window) - 0.5 * (window - 1)) * DT
        basis = np.vander(self.time, order + 1, increasing=True)
        self.pseudo = np.linalg.pinv(basis)
        self.estimate = np.array([first, 0.0, 0.0])

    def push(self, sample):
        self.samples.append(sample)
        coefficients = self.pseudo @ np.array(self.samples)
        found = np.zeros(3)
        found[: min(3, coefficients.size)] = coefficients[:3] * np.array([1.0, 1.0, 2.0])[: coefficients.size]
        self.estimate = found


def simulate(loop, motion, *, load, dry, encoder=None, torque=None, friction=None, share=None):
    """(error (T,), effort of the drive (T,)) of a joint that follows a motion.

    Args:
        loop: JointLoop whose numbers are taken.
        motion: (T, 3) q_d and its derivatives.
        load: (T,) torque on the link beside its inertia [N m], known to the controller at the reference.
        dry: (T,) torque that the drive loses and nobody compensates [N m].
        encoder, torque: (T,) noise.
        friction: (T,) dry friction, which opposes the joint's own speed and holds it at rest [N m].
        share: (T,) of the law in the command; the rest is the position at the start.
    """
    ticks = motion.shape[0]
    encoder = np.zeros(ticks) if encoder is None else encoder
    torque = np.zeros(ticks) if torque is None else torque
    friction = np.zeros(ticks) if friction is None else friction
    share = np.ones(ticks) if share is None else share
    q, v, total = motion[0, 0], 0.0, 0.0
    joint = PolynomialWindow(loop.window, loop.order, q)
    weight, noise = PolynomialWindow(loop.window, loop.order, load[0]), PolynomialWindow(loop.window, 1, 0.0)
    b = loop.k_v / loop.k_tau
    errors, efforts = np.empty(ticks), np.empty(ticks)
    for n in range(ticks):
        q_d, v_d, a_d = motion[n]
        reading = q + encoder[n]
        _, v_hat, a_hat = joint.estimate
        estimated = loop.link_inertia * a_hat + weight.estimate[0] + noise.estimate[0]
        desired = loop.link_inertia * a_d + load[n] + loop.ks * (q_d - reading) + loop.kd * (v_d - v_hat)
        asked = desired + loop.kp * (desired - estimated) + loop.ki * total
        command = reading + loop.k_tau_model * asked + loop.k_v_model * v_hat
        command = share[n] * command + (1.0 - share[n]) * motion[0, 0]
        errors[n], efforts[n] = q_d - q, command - q
        motor = (command - q) / loop.k_tau - dry[n] - load[n]
        v = (v + DT * motor / loop.inertia) / (1.0 + DT * b / loop.inertia)
        lost = DT * friction[n] / loop.inertia / (1.0 + DT * b / loop.inertia)
        v = np.sign(v) * max(abs(v) - lost, 0.0)
        total += DT * (desired - estimated)
        joint.push(reading)
        weight.push(load[n])
        noise.push(torque[n])
        q += DT * v
    return errors, efforts


def smooth_step(ticks, begin, lasts, height):
    """(T, 3) from 0 to `height`, at rest at both ends; a quintic."""
    s = np.clip((np.arange(ticks) * DT - begin) / lasts, 0.0, 1.0)
    value = height * (10 * s**3 - 15 * s**4 + 6 * s**5)
    rate = height / lasts * (30 * s**2 - 60 * s**3 + 30 * s**4)
    acceleration = height / lasts**2 * (60 * s - 180 * s**2 + 120 * s**3)
    return np.column_stack([value, rate, acceleration])
