"""How fast a filter of angle and bias forgets: at first all it has seen counts alike, later only the last times."""


def memory(seen: float, time: float, bias_time: float) -> tuple[float, float]:
    """(T, T_b) [s]: time constants of the angle and of its rate's bias, bias+ = bias + (angle's correction)/T_b.

    A line through errors of the same weight, seen for t, is the recursion of the gains 4 dt/t (angle) and 6 dt/t^2
    (bias); T = t/4 and T_b = t/1.5 until they reach those of the tuning.

    Args:
        seen: t [s].
        time: The largest T [s].
        bias_time: The largest T_b [s].
    """
    return min(time, 0.25 * seen), min(bias_time, seen / 1.5)
