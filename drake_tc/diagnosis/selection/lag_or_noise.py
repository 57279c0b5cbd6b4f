"""Is a lag of the effort a lag, or does its low-pass only take noise out of the effort?

An effort that answers a torque which no column records, or that is noisy itself, fits the recorded torques better once
it is low-passed. A lag fits better because it comes late. Run backwards in time, the same filter attenuates as much and
comes early: the noise's benefit stays, the lag's turns into harm. With e_0 the cross-validated error without the lag,
e that with it and e_b that with it backwards, a lag must remove

    e_0^2 - e^2 > LAG_OVER_NOISE max(e_0^2 - e_b^2, 0)
"""

LATE = frozenset({"delay", "current_lag"})
"""Effects that differ only in the second order of frequency times delay: 1/(1 + T s) = exp(-T s) + (T s)^2/2 + ..."""
