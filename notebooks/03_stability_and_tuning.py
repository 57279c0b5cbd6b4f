# ---
# jupyter:
#   jupytext:
#     formats: ipynb,py:percent
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Why a torque loop is stable, and what its gains should be
#
# [02_leg_torque_control](02_leg_torque_control.ipynb) closes a torque loop around a leg without joint-torque sensors,
# with the window and gains that a paper gives. This notebook asks why that loop is stable, how far it is from not
# being so, which window and gains would be better, and what is to be gained by predicting the estimates' delay and
# observing what the model lacks.
#
# **Everything here is simulated**, or computed from the numbers of the simulation. The drives have dry friction, a dead
# zone and a gain that switches with the direction; the sensors have a humanoid's noise and bias.

# %%
import tempfile
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import LogNorm

from drake_tc.analysis.sampled import linearise
from drake_tc.analysis.stability_map import Axis, stability_map
from drake_tc.analysis.torque_loop.one_joint import one_joint_loop
from drake_tc.analysis.torque_loop.tuned import joint_tasks, tuned_fields, tuned_scenario
from drake_tc.analysis.tracking_error import filtered_task, predicted_error
from drake_tc.analysis.tuning import SearchSpace, assess, default_goals, draw_fronts, tune, with_setting
from drake_tc.control.joint_loop import with_values
from drake_tc.diagrams.papers.delprete2016.sliding_prediction import floating, predicted
from drake_tc.diagrams.papers.delprete2016.stability import BEGIN, LASTS, WATCHED, Released, pushed
from drake_tc.diagrams.papers.delprete2016.tuning import BEGIN as SWING_BEGINS
from drake_tc.diagrams.papers.delprete2016.tuning import IDENTIFIED
from drake_tc.loops.scenarios import PushSpec
from drake_tc.loops.torque.default_gains import joint_loops
from drake_tc.loops.torque.running import simulate_scenario
from drake_tc.loops.torque.stages import sliding_scenario
from drake_tc.registry import diagram_entry

folder = Path(tempfile.mkdtemp())
leg = diagram_entry("hrp2_leg")
swing = leg.scenario("stairs_swing")

# %% [markdown]
# ## 1. One joint is a sampled linear system
#
# Take the knee by itself, the other joints held still, in steady sliding: dry friction is then a constant and the dead
# zone is passed, so both drop out of small motions. What is left is linear. The plant is a link behind a servo. The
# filters fit polynomials to the last $N$ samples, which makes them weighted sums, so the closed loop is one polynomial
# in $z^{-1}$ with a degree a little above $N$. `JointLoop` has it in closed form, and `joint_loops` reads its numbers
# off a scenario.

# %%
knee = joint_loops(swing)["r_knee"]
for name, unit in (
    ("inertia", "kg m^2, link and rotor"),
    ("link_inertia", "kg m^2, what the torque estimate sees"),
    ("k_tau", "rad/(N m), the drive's"),
    ("k_tau_model", "rad/(N m), the controller's"),
    ("k_v", "rad/(rad/s), the drive's"),
    ("k_v_model", "rad/(rad/s), the controller's"),
    ("window", "samples"),
    ("kp", "-"),
    ("ks", "N m/rad"),
    ("kd", "N m s/rad"),
):
    print(f"{name:<14}{getattr(knee, name):>11.4g}  {unit}")

# %%
print(f"degree {knee.eigenvalues.size}, spectral radius {knee.spectral_radius():.4f}; slowest eigenvalues:")
for z in knee.eigenvalues[knee.eigenvalues.imag >= 0.0][:4]:
    decay, frequency = -knee.dt / np.log(np.abs(z)), np.angle(z) / (2.0 * np.pi * knee.dt)
    print(f"  z = {z:.4f}: decays in {1e3 * decay:.0f} ms, at {frequency:.1f} Hz")
margins = knee.margins()
print(f"gain margin        {margins.gain_margin:.0f}")
print(f"phase margin       {np.degrees(margins.phase_margin):.0f} deg, at {margins.crossover / (2 * np.pi):.1f} Hz")
print(f"delay margin       {1e3 * margins.delay_margin:.1f} ms")
print(f"sensitivity peak   {margins.sensitivity_peak:.2f}")

# %%
turn = np.linspace(0.0, 2.0 * np.pi, 400)
opened = knee.open_loop(np.geomspace(5.0, np.pi / knee.dt, 4000))
reach = 1.0 / margins.sensitivity_peak
fig, axes = plt.subplots(1, 2, figsize=(10, 4.4), layout="constrained")
axes[0].plot(np.cos(turn), np.sin(turn), color="0.7", lw=1)
axes[0].plot(knee.eigenvalues.real, knee.eigenvalues.imag, "x", ms=5)
axes[0].set(title="closed loop: eigenvalues", xlabel="real", ylabel="imaginary", aspect="equal")
axes[1].plot(np.cos(turn), np.sin(turn), color="0.85", lw=1, label="unit circle")
axes[1].plot(-1.0 + reach * np.cos(turn), reach * np.sin(turn), color="tab:red", lw=1, ls=":", label="sensitivity peak")
axes[1].plot(opened.real, opened.imag)
axes[1].plot(-1.0, 0.0, "+", color="tab:red", ms=9, mew=2)
axes[1].set(title="loop cut at the drive's effort", xlabel="real", aspect="equal", xlim=(-2.6, 1.2), ylim=(-1.9, 1.9))
axes[1].legend(loc="lower right")
plt.show()

# %% [markdown]
# A closed form is easily wrong, so it is held against the complete Drake diagram of the same loop. `linearise` takes a
# diagram at one tick, kicks each of its states (filter windows and delay lines included), runs the simulation over one
# control period, and looks at what became of the kick. The slowest eigenvalues of that matrix have to be those of the
# polynomial. A shorter window leaves fewer states to kick.

# %%
plain = replace(swing, sensors="perfect", tare=0.0, guard=replace(swing.guard, start_time=0.05))
plain = sliding_scenario(plain, folder)
short = replace(plain, filters=replace(plain.filters, window=20))
one = one_joint_loop(short, "r_knee")
system = linearise(one.diagram, one.settled(0.3).get_context(), short.dt, step=1e-4)
mine = joint_loops(short)["r_knee"].eigenvalues[:6]
apart = np.abs(system.eigenvalues[:, None] - mine).min(axis=0)
print(f"{len(system.states)} states in the diagram; its eigenvalues are within {apart.max():.0e} of the polynomial's")

# %% [markdown]
# ## 2. Two fits of the friction, and what eigenvalues cannot see
#
# The feedforward compensates friction with a velocity that is late, and by as much as the friction model says. A
# symmetric fit of that model over-estimates friction on half of its data, an asymmetric one hardly ever. Here is the
# knee without any feedback, floating on its feedforward alone. The drive's gain depends on the direction, so there is a
# loop for each.

# %%
ways = {"forward": 1.0, "backward": -1.0, "mean of both": 0.0}
print(f"{'fit':<12}{'direction':<14}{'spectral radius':>16}{'critical speed':>18}")
for fit in ("symmetric", "asymmetric"):
    for way, direction in ways.items():
        found = predicted("r_knee", fit, direction)
        critical = f"{found.critical_speed:.2f} rad/s" if found.critical_speed > 0.0 else "none"
        print(f"{fit:<12}{way:<14}{found.spectral_radius:>16.5f}{critical:>18}")

# %% [markdown]
# Over both directions the radius is above 1 with the symmetric fit and below with the asymmetric one. Forward, though,
# it is above 1 with either: by the eigenvalue alone the asymmetric fit would be unstable as well.
#
# What the eigenvalue leaves out is drag. Dry friction and dead zone take a constant torque $D$ from a joint that
# slides, whatever its speed. With $b$ the viscous friction that there is and $K_v'/K_\tau$ what is compensated,
#
# $$ v(t) - v_c = (v(0) - v_c)\,\rho^{t/h}, \qquad v_c = \frac{D}{K_v'/K_\tau - b} . $$
#
# With $\rho > 1$ a joint runs away from any speed above $v_c$, and comes to rest from any below. So the prediction
# needs the speed at which the joint is let go. The simulation has the complete leg, all friction and the sensors'
# noise: the knee is pushed forward, hard or gently, and let go.

# %%
gently = replace(
    floating("r_knee", "symmetric"),
    duration=BEGIN + LASTS + WATCHED,
    pushes=(PushSpec("r_shank", BEGIN, LASTS, torque=(0.0, 25.0, 0.0)),),
)
late = simulate_scenario(gently, allow_runaway=True)
at = late.robot.joints.index("r_knee")
runs = {
    ("symmetric", "hard"): pushed("r_knee", "symmetric"),
    ("symmetric", "gently"): Released(late.time, np.abs(late.velocity[:, at])),
    ("asymmetric", "hard"): pushed("r_knee", "asymmetric"),
}
print(f"{'fit':<12}{'push':<8}{'released at':>12}{'critical':>10}{'growth predicted':>18}{'simulated':>11}")
for (fit, push), run in runs.items():
    found = predicted("r_knee", fit, 1.0)
    growth = found.growth(run.at_release, WATCHED)
    print(f"{fit:<12}{push:<8}{run.at_release:12.2f}{found.critical_speed:10.2f}{growth:18.2f}{run.growth:11.2f}")
    assert (growth > 1.0) == (run.growth > 1.0)
print("prediction and simulation judge all of them alike")

# %%
fig, axis = plt.subplots(figsize=(9, 3.6), layout="constrained")
colours = {"symmetric": "tab:red", "asymmetric": "tab:blue"}
for (fit, push), run in runs.items():
    style = "-" if push == "hard" else "--"
    axis.plot(run.time, run.speed, color=colours[fit], ls=style, label=f"{fit}, pushed {push}")
critical = predicted("r_knee", "symmetric", 1.0).critical_speed
axis.axhline(critical, color="tab:red", lw=1, ls=":", label="critical speed, symmetric")
axis.axvspan(BEGIN, BEGIN + LASTS, color="0.92", label="push")
axis.set(xlabel="time [s]", ylabel="speed of the knee [rad/s]", xlim=(0.6, BEGIN + LASTS + WATCHED), ylim=(0.0, None))
axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
plt.show()

# %% [markdown]
# `drake-tc reproduce A.stability` does this for every joint, both fits and both directions. Two more things are outside
# of this linear loop: a joint at rest, where dry friction is a stiff spring and hides instability, and the chatter of a
# dead zone's inverse around zero.
#
# ## 3. A map of stability
#
# Back to the loop with feedback. Window $N$ and torque gain $K_p$ are the two numbers that the paper chose by hand.
# Each point of the map is a loop of its own; the stiffness $K_6$ stays. The colour says what is left of a deviation
# after a tenth of a second: blue dies away, red grows, the line is the border. The star is the paper's setting.

# %%
loops = joint_loops(swing)
windows, gains = Axis.parse("window=8:136:16"), Axis.parse("kp=0:10:1.25")
maps = {joint: stability_map(loops[joint], windows, gains) for joint in ("r_knee", "r_hip_pitch")}
tried = {4.0: "o", 7.0: "X"}

fig, axes = plt.subplots(1, 2, figsize=(11, 4), sharey=True, layout="constrained")
for axis, (joint, found) in zip(axes, maps.items(), strict=True):
    left = found.radius ** (0.1 / swing.dt)
    mesh = axis.pcolormesh(
        found.x.values, found.y.values, left, cmap="RdBu_r", norm=LogNorm(1e-2, 1e2), shading="gouraud", rasterized=True
    )
    if not found.stable.all():
        axis.contour(found.x.values, found.y.values, found.radius, levels=[1.0], colors="black", linewidths=2)
    axis.plot(*found.present, "*", ms=15, color="tab:orange", mec="black", label="the paper's setting")
    axis.set(title=joint, xlabel="window [samples]")
    print(f"{joint}: {100 * found.stable.mean():.0f} % of the map is stable")
for kp, marker in tried.items():
    axes[1].plot(80, kp, marker, color="black", mfc="none", ms=8, label=f"simulated below, Kp = {kp:g}")
axes[0].set_ylabel("Kp [-]")
fig.legend(*axes[1].get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False)
fig.colorbar(mesh, ax=axes, label="left after 0.1 s", extend="both")
plt.show()

# %% [markdown]
# The knee has much room, the hip pitch less. There, a shorter window does not make more: the torque estimate then acts
# at the frequency where the servo's own loop crosses over, without being in phase with it. Two of the hip's loops, one
# on each side of the border, as Drake diagrams of that one joint (its drive as in steady sliding), kicked and let go:

# %%
fig, axes = plt.subplots(1, 2, figsize=(11, 3), sharex=True, layout="constrained")
for axis, kp in zip(axes, tried, strict=True):
    radius = with_values(loops["r_hip_pitch"], {"kp": kp}).spectral_radius()
    one = one_joint_loop(replace(plain, gains=replace(plain.gains, kp=kp)), "r_hip_pitch")
    time, speed = one.speed_after(one.settled(0.2), 0.1, 0.8)
    early, end = (np.sqrt(np.mean(speed[(time > t) & (time < t + 0.2)] ** 2)) for t in (0.2, 0.6))
    fate = "dies away" if end < early else "grows"
    print(f"Kp = {kp:g} {fate}: spectral radius {radius:.4f}, speed at 0.6 s over that at 0.2 s {end / early:.2f}")
    axis.plot(time, 1e3 * speed, lw=1, color="tab:blue" if radius < 1.0 else "tab:red")
    axis.set(title=f"r_hip_pitch, Kp = {kp:g}", xlabel="time since the kick [s]")
axes[0].set_ylabel("speed [mrad/s]")
plt.show()

# %% [markdown]
# In a shell, with any two numbers of the loop, or with the verdict of the map held against simulation on a grid of
# loops:
#
#     drake-tc stability-map hrp2_leg --joint r_hip_pitch --x window=8:136:4 --y kp=0:10:0.5 --out out/map.svg
#     drake-tc reproduce A.stability_grid
#
# ## 4. Tuning
#
# Stable is not yet good. `tune` looks for the window, $K_p$, $K_i$ and $K_7$ with the least tracking error, among the
# settings that keep today's sensitivity peak and delay margin and let no more noise into the command than the vendor's
# servo makes of its encoder's. It does not simulate: along the reference, what the control law gives and what the drive
# needs are known functions of time, and their difference passes the linear loop. So many settings cost little. Here
# only the knee is tuned, in a small space. All that the tuning knows of the drives is a model that `close-loop`
# identified.

# %%
brisk = leg.scenario("brisk_swing")
known = replace(brisk, actuators=IDENTIFIED)
task = next(task for task in joint_tasks(known, SWING_BEGINS) if task.joint == "r_knee")
space = SearchSpace((12, 20, 30, 50, 80), (2,), kp=(0.0, 1.0, 2.0), ki=(0.0, 5.0, 10.0, 20.0), rounds=1)
tuning = tune([task], default_goals([task]), space)
(joint,) = tuning.joints
print(f"{tuning.tried} settings tried\n{'':<12}{'paper':>9}{'tuned':>9}")
for name in ("window", "kp", "ki", "k7"):
    print(f"{name:<12}" + "".join(f"{getattr(each.setting, name):9.4g}" for each in (joint.before, joint.after)))
for name, field, factor in (
    ("error [mrad]", "error", 1e3),
    ("peak", "sensitivity_peak", 1.0),
    ("delay [ms]", "delay_margin", 1e3),
    ("noise [N m]", "noise", 1.0),
):
    print(f"{name:<12}" + "".join(f"{factor * getattr(each, field):9.3f}" for each in (joint.before, joint.after)))
print(f"goals: peak <= {joint.goal.sensitivity_peak:.3f}, delay >= {1e3 * joint.goal.delay_margin:.3f} ms,", end=" ")
print(f"noise <= {joint.goal.noise:.3f} N m\n\nwhat a scenario takes: {tuned_fields(tuning)}")

# %% [markdown]
# The short window lets more noise through, within what was asked. Below, the points are the settings that no other
# one beats in error, sensitivity peak and noise together. The line joins those that nothing beats in error and peak
# alone.

# %%
fig = plt.figure(figsize=(7.5, 4.2), layout="constrained")
draw_fronts(fig, tuning)
fig.axes[0].set_yticks((0.3, 0.5, 1.0, 2.0), ("0.3", "0.5", "1", "2"))
fig.axes[0].minorticks_off()
plt.show()

# %% [markdown]
# The prediction has to survive the complete leg: all six joints, the true drives, the sensors' noise. The other joints
# keep their gains, but share the new window, as a torque needs all joints' motion at one time.

# %%
settings = {
    "paper": (brisk, joint.before.setting),
    "tuned": (tuned_scenario(brisk, tuning), joint.after.setting),
}
fig, axes = plt.subplots(1, 2, figsize=(11, 3.2), sharex=True, sharey=True, layout="constrained")
simulated = {}
for axis, (name, (scenario, setting)) in zip(axes, settings.items(), strict=True):
    recording = simulate_scenario(scenario)
    filtered = filtered_task(task, setting.window, setting.order)
    foreseen = predicted_error(filtered, with_setting(filtered.task.loops[0], setting))
    counted = recording.time >= SWING_BEGINS
    simulated[name] = np.sqrt(np.mean(recording.tracking_error[counted] ** 2, axis=0))
    axis.plot(recording.time, 1e3 * recording.tracking_error[:, at], lw=1.2, label="simulated, complete leg")
    axis.plot(brisk.dt * np.arange(foreseen.size), 1e3 * foreseen, "k--", lw=1, label="predicted")
    axis.set(title=f"r_knee, {name} setting", xlabel="time [s]", xlim=(SWING_BEGINS, brisk.duration))
    rms = np.sqrt(np.mean(foreseen[task.begin :] ** 2))
    print(f"{name}: RMS error {1e3 * rms:.2f} mrad predicted, {1e3 * simulated[name][at]:.2f} mrad simulated")
axes[0].set_ylabel("position error [mrad]")
axes[0].legend(loc="upper right")
plt.show()
print(f"simulated, tuned is less than half of paper: {simulated['tuned'][at] < 0.5 * simulated['paper'][at]}")
print("\nsimulated RMS errors [mrad]:")
for i, other in enumerate(recording.robot.joints):
    print(f"{other:<14}" + "".join(f"{name:>8} {1e3 * error[i]:.2f}" for name, error in simulated.items()))

# %% [markdown]
# Where the joint has come to rest, at the end, dry friction holds it wherever it is, which the prediction does not
# know. Which of the changes makes the difference? The prediction answers that as well:

# %%
setting = joint.after.setting
for name, changed in (
    ("the paper's setting", joint.before.setting),
    ("its window with the tuned gains", replace(setting, window=joint.before.setting.window)),
    ("the tuned setting without Ki", replace(setting, ki=0.0)),
    ("the tuned setting", setting),
):
    found = assess(task, changed)
    peak, error = found.sensitivity_peak, 1e3 * found.error
    print(f"{name:<34}predicted error {error:.2f} mrad, sensitivity peak {peak:.2f}")

# %% [markdown]
# The short window makes the estimates less late, which helps by itself. The integral takes away what dry friction and
# dead zone leave, which is their share over $K_6$ whatever $K_p$ is; with the paper's window it does harm, as it sums
# up a torque that is late. A joint that was not tuned along may lose a little by the new window. Tune all of them, and
# see what is left of the gain on plants that are not what the model says:
#
#     drake-tc tune hrp2_leg --scenario-name brisk_swing --begin 0.28 --out out/tuned --plants 20
#     drake-tc simulate hrp2_leg --scenario-text "$(cat out/tuned/tuned.yaml)"
#     drake-tc reproduce A.tune
#
# Linear tuning does not see everything. Sensors that are older than modelled take much of the tuned gains' lead, and
# the margins are those of one joint at a time. The evidence is in
# [drake_tc/analysis/README.md](../drake_tc/analysis/README.md).
#
# ## 5. Beyond the paper: predictor and observer
#
# A soft joint hardly corrects what the feedforward leaves, and it leaves two things: the estimates are late, and the
# controller's linear model lacks dry friction and dead zone. The scenario `predicted_swing` adds a stage for each. A
# predictor runs the drives' model from the late estimate to now. An observer compares what the drives should give with
# what the links got, and the difference is compensated. Loads on the links, as the F/T sensor and the IMU have them,
# are no disturbance to it, so the joint stays soft to the touch. The swing is the short one of section 4, at a tenth of
# the servo's stiffness.

# %%
early = """{duration: 1.6, tare: 0.1, guard: {start_time: 0.2}, motion: {times: [0.3, 0.65, 1.05, 1.5]},
  gains: {k6: 0.1}}"""
swings = {
    "servo": simulate_scenario(leg.scenario("stairs_swing_servo", text=early)),
    "K6 = 0.1": simulate_scenario(leg.scenario("stairs_swing", text=early)),
    "K6 = 0.1, with both": simulate_scenario(leg.scenario("predicted_swing", text=early)),
}
joints, time = late.robot.joints, swings["servo"].time
counted = time >= SWING_BEGINS
colours = dict(zip(swings, ("0.55", "tab:orange", "tab:green"), strict=True))
fig, axes = plt.subplots(2, 3, figsize=(12, 5), sharex=True, layout="constrained")
for i, (name, axis) in enumerate(zip(joints, axes.flat, strict=True)):
    for kind, run in swings.items():
        axis.plot(time, 1e3 * run.tracking_error[:, i], lw=1.2, color=colours[kind], label=kind)
    reach = 1.1e3 * max(np.abs(run.tracking_error[counted, i]).max() for run in swings.values())
    axis.set(title=name, xlim=(SWING_BEGINS, time[-1]), ylim=(-reach, reach))
for axis in axes[:, 0]:
    axis.set_ylabel("position error [mrad]")
for axis in axes[-1]:
    axis.set_xlabel("time [s]")
fig.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False)
plt.show()

# %%
rms = {kind: np.sqrt(np.mean(run.tracking_error[counted] ** 2, axis=0)) for kind, run in swings.items()}
plainly, both = ((rms["servo"] / rms[kind]) ** 2 for kind in list(swings)[1:])
print(f"{'RMS error [mrad]':<18}{'servo':>8}{'without':>9}{'with':>8}{'squared, servo over: without':>31}{'with':>8}")
for i, name in enumerate(joints):
    errors = [1e3 * error[i] for error in rms.values()]
    print(f"{name:<18}{errors[0]:8.2f}{errors[1]:9.2f}{errors[2]:8.2f}{plainly[i]:31.2f}{both[i]:8.1f}")
print(f"joints better than the servo: without {np.sum(plainly > 1.0)}, with {np.sum(both > 1.0)} of {len(joints)}")

# %% [markdown]
# Without the two stages, a tenth of the stiffness costs most joints their lead over the servo, as it did in the paper.
# With them every joint is ahead. `drake-tc reproduce A.beyond` runs this with wrong drive constants, wrong delays, late
# sensors and a base that swings. Two limits are worth knowing before a robot is tried. The observer has to know
# the rotors' inertia, at least roughly; here it is in the scenario. And encoders that are late without the controller
# knowing take nearly all of the gain. The command prints the figures.
#
# ## 6. Back to the model
#
# Loop, tuning and observer all rest on the model of the drives, so it has to be held against the robot's own logs. A
# rig file may name the robot file; the load torques are then computed from encoders, IMU and F/T sensors, and causes
# that no single joint owns (a link's mass or centre, a bias or gain of the F/T sensor, a bias of the IMU) are looked
# for on all joints together. For the leg, `out/leg.yaml`:
#
#     robot: ../models/hrp2_like/hrp2_like_leg.yaml
#     drive: position_servo
#     load: {robot: estimate}
#     declared: [rotor_inertia]
#
# and in a shell:
#
#     drake-tc simulate hrp2_leg --scenario-name identify_motion --out out/motion
#     drake-tc simulate hrp2_leg --scenario-name identify_pushes --out out/pushes
#     drake-tc simulate hrp2_leg --scenario-name stairs_swing_servo --out out/swing
#     drake-tc close-loop --rig out/leg.yaml --log out/motion/log.csv --log out/pushes/log.csv \
#         --holdout out/swing/log.csv --out out/closed
#
# `out/closed/report.html` says which effect which joint's model lacks, and shows the torque loop simulated before and
# after, its tracking errors and the margins of section 1 beside each other. `model_after.yaml` is what a scenario takes
# as `model`. `torque_uncertainty.yaml` has the covariance of the torque by which that model still errs. The same
# commands take the logs of a real robot: only their columns count.
