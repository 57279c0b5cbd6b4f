"""Figures that the other README files' tables quote, as in `readme_quotes`."""

from readme_quotes import (
    ANALYSIS,
    IND_RECT_BOX,
    MILLI,
    OURS_PUSHED,
    PAPER_C,
    PERCENT,
    ROBUST,
    SEA,
    TSID,
    WAYS,
    WAYS_5,
    Quote,
    crossing,
    each,
    group,
    recorded,
    share,
    share_of_robots,
)

OTHER_PAGES: list[Quote] = [
    # --- robust task-space inverse dynamics
    (TSID, "1 | mean", 2, lambda: each("B.test1", "mean |p - p_ind|")),
    (
        TSID,
        "1 | states",
        2,
        lambda: [max(each("B.test1", "states with p_rect above p", "states with p_box above p"))],
    ),
    (
        TSID,
        "2 | p: classic",
        2,
        lambda: crossing("B.test2", "p, ", ("classic, w_f = 0", "classic, w_f > 0", *IND_RECT_BOX)),
    ),
    (
        TSID,
        "2 | p over",
        2,
        lambda: [
            value
            for w in ("=", ">")
            for value in crossing("B.test2", f"p over that of classic, w_f {w} 0, ", IND_RECT_BOX)
        ],
    ),
    (TSID, "2 † |", 2, lambda: crossing("B.test2", "p over that of classic while it crosses, ", IND_RECT_BOX)),
    (TSID, "2 | p_ind −", 2, lambda: each("B.test2", "p_ind minus p_rect", "p_rect minus p_box")),
    (TSID, "2 | largest error", 2, lambda: [max(group("B.test2", "largest CoM task error"))]),
    (
        TSID,
        "3 | p: classic",
        2,
        lambda: crossing("B.test3", "p, ", ("classic, w_f > 0", "p_ind", "p_box", "p_box, w = 1e-05", "p_rect")),
    ),
    (
        TSID,
        "3 | capture point",
        2,
        lambda: [
            max(0.0, *group("B.test3", "capture point beyond the feet, p_")),
            *crossing("B.test3", "states without solution, ", ("p_ind", "p_box")),
            1000,
        ],
    ),
    (
        TSID,
        "5 | controllers",
        2,
        lambda: [value for way in WAYS_5 for value in share("controllers that miss a limit, ", way)],
    ),
    (
        TSID,
        "5 † | the same",
        2,
        lambda: [
            value
            for way in WAYS_5
            for value in share("controllers that miss another limit than the capture point's, ", way)
        ],
    ),
    (
        TSID,
        "5 † | controllers",
        2,
        lambda: [
            *share("controllers that miss a limit, ", "p_ind, margin"),
            *each("B.test5", "mean p, p_ind, margin"),
        ],
    ),
    (
        TSID,
        "5 | states",
        2,
        lambda: [
            value
            for begin in ("states with a missed limit, ", "mean p, ")
            for value in crossing("B.test5", begin, WAYS_5)
        ],
    ),
    (
        TSID,
        "4 | least p",
        2,
        lambda: [
            min(
                p
                for name, p in recorded("B.test4").items()
                if name.startswith("p, sigma") and name.endswith(f", {form}")
            )
            for form in ("p_ind", "p_box", "p_box, w = 1e-05")
        ],
    ),
    *(
        (TSID, f"robots under {form}", cell, values)
        for form in ("classic", *ROBUST)
        for cell, values in (
            (1, lambda form=form: share_of_robots(form)),
            (2, lambda form=form: each("B.closed_loop", f"samples with a missed contact limit, {form}")),
            (3, lambda form=form: each("B.closed_loop", f"widest sway kept, {form} [cm]")),
        )
    ),
    # --- series-elastic joints
    (
        SEA,
        "observer + P: largest size",
        1,
        lambda: crossing(
            "C.bode",
            "observer + P: ",
            ("largest | |H| |, 2 to 10 Hz [dB]", "phase off the pure delay, largest, 2 to 10 Hz [deg]"),
        ),
    ),
    (
        SEA,
        "-3 dB bandwidth",
        1,
        lambda: each(
            "C.bode",
            "PI: -3 dB bandwidth [Hz]",
            "PI: -3 dB bandwidth by the linear prediction [Hz]",
            "bandwidth, observer + P over PI",
        ),
    ),
    (
        SEA,
        "predictor, phase lag",
        1,
        lambda: each(
            "C.bode",
            "phase lag with the predictor over without, largest, 2 to 10 Hz",
            "observer + P, predictor: largest | |H| |, 2 to 10 Hz [dB]",
        ),
    ),
    (
        SEA,
        "measured off",
        1,
        lambda: crossing("C.bode", "measured off linear, observer + P, 2 to 10 Hz ", ("[dB]", "[deg]")),
    ),
    (
        SEA,
        "feedforward; feedforward",
        1,
        lambda: each(
            "C.bode",
            *(
                f"{law}: largest | |H| |, 2 to 10 Hz [dB]"
                for law in ("feedforward", "feedforward + P", "momentum observer", "PI")
            ),
        ),
    ),
    (
        SEA,
        "observer + P, held by",
        1,
        lambda: crossing(
            "C.bode",
            "held by a hand of 2000 N m/rad: ",
            ("largest | |H| | [dB]", "phase off the pure delay [deg]"),
        ),
    ),
    # --- analysis and tuning
    (ANALYSIS, "24 pushes", 1, lambda: [*group("A.stability", "pushes that prediction"), 24]),
    (
        ANALYSIS,
        "256 loops",
        1,
        lambda: each("A.stability_grid", "verdicts that disagree", "unstable loops, by spectral radius"),
    ),
    (ANALYSIS, "piecewise model", 1, lambda: [*group("A.stability", "joints unstable on the piecewise"), 6]),
    (
        ANALYSIS,
        "tracking error, tuned",
        1,
        lambda: crossing("A.tune", "tracking error, tuned over paper's, ", ("geometric mean of joints", "worst joint")),
    ),
    (ANALYSIS, "the same on the longer", 1, lambda: group("A.tune", "tracking error on another swing")),
    (
        ANALYSIS,
        "sensitivity peak, delay",
        1,
        lambda: [*group("A.tune", "sensitivity peak"), *group("A.tune", "delay margin")],
    ),
    (
        ANALYSIS,
        "100 perturbed plants",
        1,
        lambda: crossing("A.tune", "perturbed plants: tuned over paper's, ", ("median", "worst plant")),
    ),
    (
        ANALYSIS,
        "growth of the symmetric fit's",
        1,
        lambda: each("A.stability", "largest error of a predicted runaway's growth"),
    ),
    (
        ANALYSIS,
        "Kf at which",
        1,
        lambda: [
            *each("A.stability", "Kf at the border of force control, predicted"),
            None,
            *each("A.stability", "Kf at the border of force control, simulated"),
        ],
    ),
    (
        ANALYSIS,
        "plants with 30 %",
        1,
        lambda: [
            *each("A.tune", "perturbed plants: share with 30 % less error or better", times=PERCENT),
            None,
            *each("A.tune", "perturbed plants: ran away"),
        ],
    ),
    # --- the whole loop of Faraji et al. (2015)
    *(
        (
            PAPER_C,
            f"`{id_}`",
            cell,
            lambda id_=id_, names=names, times=times: each(id_, *names, times=times),
        )
        for id_ in ("C.turn1hz", "C.turn_half_hz", "C.genuflection")
        for cell, names, times in (
            (3, ("CoP estimator: largest error of the trunk [rad]",), MILLI),
            (4, ("vibration above 5 Hz, foot centre over ours",), 1.0),
            (5, tuple(f"base {what} error, ours over foot centre" for what in ("position", "velocity", "yaw")), 1.0),
        )
    ),
    *(
        (PAPER_C, begin, cell, lambda way=way, loop=loop: each("C.pushes", f"{way}: impulse survived, {loop} [N s]"))
        for begin, loop in (
            ("whole-body torque control", OURS_PUSHED),
            ("the same, 2 N m s/rad", "the same with joint damping"),
            ("stiff positions", "stiff positions"),
        )
        for cell, way in enumerate(WAYS, 1)
    ),
]
