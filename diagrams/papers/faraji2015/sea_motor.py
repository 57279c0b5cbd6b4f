"""Faraji et al. (2015), section II.A.

Motors identified joint by joint from sines and trapezoids under a hand, and a data sheet.
"""

import numpy as np

from drake_tc.actuation.plant import VoltageMotor
from drake_tc.diagrams.papers.expected_values import expectations
from drake_tc.diagrams.papers.faraji2015.sea_excitation import Excitation, record_excitation
from drake_tc.identification.motor_prior import UNKNOWNS, MotorFit, identify_motor
from drake_tc.loops.series_elastic.scenario import SeaScenario
from drake_tc.registry import sea_entry
from drake_tc.report.figure_row import Progress, Reproduction, evaluated
from drake_tc.types import TextTable, text_rows

JOINTS = ("r_knee", "r_shoulder_roll", "r_elbow")
TRUE = {"torque_constant": 0.04, "back_emf": 0.04, "resistance": 0.6, "rotor_inertia": 1.2e-5, "gear_ratio": 100.0}
"""What the robot file's actuators are computed from (the file's head)."""
SHEET_OFF = {"torque_constant": 1.08, "back_emf": 1.08, "resistance": 0.92, "rotor_inertia": 0.83}
"""Factors between the truth and the data sheet that the fit starts from."""
SHEET_FRICTION = {"coulomb": 1.0, "viscous": 1.0}
"""What the fit is told of the friction, whatever the joint [N m, N m s/rad]."""
NOTES = (
    "Simulated: 10 s of growing sines at 0.7 and 1.7 Hz and of trapezoids each, a position loop of 40 V/rad, a hand's"
    " torque of 12 N m at 0.31 Hz, encoder steps, torque noise. The data sheet is 8 % off (kt, ke, Rm), 17 % (Jm).",
    "The logs tell Rm/(kt N), damping, inertia and dry friction; kt and Rm apart only as far as tau_v is known.",
    "The simulation's step h of 0.25 ms adds F_v h/2 to the inertia, which the fit finds; intervals are held"
    " against what was simulated, Jm + F_v h/(2 N^2).",
    "An interval is of the logs' statistics and of the data sheet, not of effects that the model lacks: an undeclared"
    " torque ripple moves Jm far out of its interval.",
)


def true_motor(scenario: SeaScenario) -> VoltageMotor:
    """The simulated motor by its parts."""
    values = {value.key: value.parameters for value in scenario.actuator().effects}
    emf = TRUE["back_emf"] * TRUE["torque_constant"] * TRUE["gear_ratio"] ** 2 / TRUE["resistance"]
    return VoltageMotor(
        **TRUE,
        coulomb=values["coulomb"]["coulomb"],
        viscous=values["viscous"]["viscous"] - emf,
        stiffness=1.0 / values["elasticity"]["compliance"],
        voltage_limit=values["saturation"]["limit"],
    )


def data_sheet(motor: VoltageMotor) -> VoltageMotor:
    """What the fit is given of a motor."""
    return VoltageMotor(**{**vars(motor.scaled(**SHEET_OFF)), **SHEET_FRICTION})


def simulated_value(truth: VoltageMotor, name: str, step: float) -> float:
    """What a simulation with steps of `step` [s] has of an unknown: implicit damping adds F_v h/(2 N^2) to Jm."""
    added = truth.damping * step / (2.0 * truth.gear_ratio**2) if name == "rotor_inertia" else 0.0
    return float(getattr(truth, name)) + added


def motor(seed: int = 0, progress: Progress | None = None) -> Reproduction:
    """C.motor: errors of the identified parameters, joint by joint."""
    values: dict[str, float] = {}
    rows: list[tuple[str, MotorFit, VoltageMotor]] = []
    for number, joint in enumerate(JOINTS):
        if progress:
            progress(joint, number / len(JOINTS))
        scenario = sea_entry().scenario("held", text=f"{{joint: {joint}}}").changed(seed=seed)
        truth = true_motor(scenario)
        runs, rig = record_excitation(scenario)
        train = [run for name, run in runs.items() if name != "held_out"]
        rows.append((joint, identify_motor(train, rig, data_sheet(truth)), truth))
    for name in ("torque_constant", "resistance", "rotor_inertia", "coulomb"):
        errors = [abs(getattr(fit.motor, name) / getattr(truth, name) - 1.0) for _, fit, truth in rows]
        values[f"{name}: largest error of {len(JOINTS)} joints [%]"] = 100.0 * max(errors)
    damping = [abs(fit.motor.damping / truth.damping - 1.0) for _, fit, truth in rows]
    values["damping with back-EMF: largest error [%]"] = 100.0 * max(damping)
    step = Excitation().step
    inside = {
        name: np.mean([_holds(fit.spread[name], simulated_value(truth, name, step)) for _, fit, truth in rows])
        for name in UNKNOWNS
    }
    values |= {f"{name}: share of joints whose interval holds it": float(share) for name, share in inside.items()}
    values["share of all intervals that hold what was simulated"] = float(np.mean(list(inside.values())))
    names = [f"{joint}, {name}" for joint, _, _ in rows for name in UNKNOWNS]
    found = [getattr(fit.motor, name) for _, fit, _ in rows for name in UNKNOWNS]
    true = [getattr(truth, name) for _, _, truth in rows for name in UNKNOWNS]
    told = [getattr(data_sheet(truth), name) for _, _, truth in rows for name in UNKNOWNS]
    share = [fit.from_logs[name] for _, fit, _ in rows for name in UNKNOWNS]
    low, high = ([fit.spread[name][i] for _, fit, _ in rows for name in UNKNOWNS] for i in range(2))
    in_steps = [simulated_value(truth, name, step) for _, _, truth in rows for name in UNKNOWNS]
    headings = ("joint, parameter", "data sheet", "identified", "from", "to", "true", "simulated", "from the logs")
    columns = [told, found, low, high, true, in_steps, share]
    table = TextTable("motors, SI; 95 % intervals", headings, text_rows(names, columns, ".4g"))
    return Reproduction("C.motor", evaluated(values, expectations("c_motor")), (table,), NOTES)


def _holds(interval: tuple[float, float], value: float) -> bool:
    return interval[0] <= value <= interval[1]
