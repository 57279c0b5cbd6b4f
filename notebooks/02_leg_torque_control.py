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
# # A leg in torque control, without joint-torque sensors
#
# A humanoid's leg has six geared joints, each under its vendor's position servo: all that can be commanded is a
# position. There are encoders, an IMU in the torso and a six-axis force/torque sensor in the ankle, but no sensor of
# joint torque. This notebook closes a torque loop around it, lets the leg swing up a stair, press on an object and lose
# a sensor, and hands the log to the tool that improves the model.
#
# **Everything here is simulated**, by the Drake diagram `drake_tc.loops.torque.running`, with the noise and bias of a
# humanoid's sensors. The controller sees nothing else: not the true torques, and not the true actuators.

# %%
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from drake_tc import block_graph, close_loop, load_models
from drake_tc.control.guard import GuardMode
from drake_tc.control.torque_control import COMPONENTS
from drake_tc.diagrams.papers.delprete2016.stability import BEGIN, LASTS, pushed
from drake_tc.loops.torque.running import estimated, simulate_scenario, summarise, write_results
from drake_tc.registry import diagram_entry
from drake_tc.robot.plant import joint_limits

folder = Path(tempfile.mkdtemp())

# %% [markdown]
# ## 1. The robot is data, the experiment is data
#
# A robot file names the joints and the sensors of a URDF; a scenario file says what the robot is to do, under which
# controller, with what going wrong. No class knows this leg, so another robot is another file.

# %%
leg = diagram_entry("hrp2_leg")
scenario = leg.scenario("stairs_swing")
loop = leg.build(scenario)
print(scenario.path(scenario.robot).read_text())
print("scenarios:", ", ".join(leg.scenarios()))

# %% [markdown]
# Read the loop from the top left. The inverse dynamics turn the reference into desired joint torques. `torque_control`
# adds the feedback of the estimated torque and asks the actuator model for the command that makes the servo deliver it.
# The guard has the last word before the drives. Below, from right to left, the sensors' readings become an estimate
# of the joints' motion and of their torques, and the fault monitor looks at the raw readings.

# %%
block_graph(loop.diagram)

# %% [markdown]
# ## 2. A swing up a stair
#
# The same motion three times: under the vendor's servo; under torque control that is as stiff as that servo
# ($K_6 = 1$); and a quarter as stiff.

# %%
swings = {
    "servo": simulate_scenario(leg.scenario("stairs_swing_servo")),
    "K6 = 1": simulate_scenario(leg.scenario("stairs_swing", text="{log_components: true}")),
    "K6 = 0.25": simulate_scenario(leg.scenario("stairs_swing", text="{gains: {k6: 0.25}}")),
}
joints = loop.robot.joints
time = swings["servo"].time
reference = swings["servo"]["reference"][:, : len(joints)]
colours = {"servo": "0.55", "K6 = 1": "tab:blue", "K6 = 0.25": "tab:orange"}

fig, axis = plt.subplots(figsize=(11, 3), layout="constrained")
for joint, position in zip(joints, reference.T, strict=True):
    axis.plot(time, position, lw=1.2, label=joint)
axis.set(xlabel="time [s]", ylabel="reference position [rad]", title="the swing")
axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
plt.show()

# %% [markdown]
# Tracking errors, of the true positions. For the first half second the guard lets the command in without a bump;
# errors are counted from then on.

# %%
fig, axes = plt.subplots(2, 3, figsize=(12, 5), sharex=True, layout="constrained")
for i, (joint, axis) in enumerate(zip(joints, axes.flat, strict=True)):
    for name, swing in swings.items():
        axis.plot(time, 1e3 * swing.tracking_error[:, i], lw=1, color=colours[name], label=name)
    axis.set(title=joint, xlim=(0.7, time[-1]))
    late = [1e3 * swing.tracking_error[time > 0.7, i] for swing in swings.values()]
    reach = 1.1 * max(np.abs(error).max() for error in late)
    axis.set_ylim(-reach, reach)
for axis in axes[:, 0]:
    axis.set_ylabel("position error [mrad]")
for axis in axes[-1]:
    axis.set_xlabel("time [s]")
axes[0, 0].legend(loc="upper right")
plt.show()

# %%
rms = {name: np.array([row["rms_error"] for row in summarise(swing)["joints"]]) for name, swing in swings.items()}
print(f"{'RMS error [mrad]':<18}" + "".join(f"{name:>12}" for name in rms) + f"{'ratio at K6 = 1':>20}")
for i, joint in enumerate(joints):
    ratio = (rms["servo"][i] / rms["K6 = 1"][i]) ** 2
    print(f"{joint:<18}" + "".join(f"{1e3 * error[i]:12.2f}" for error in rms.values()) + f"{ratio:20.1f}")

# %% [markdown]
# The last column is the ratio of the squared errors, servo over torque control. With the same stiffness the torque loop
# follows more closely, because it knows what the servo does not: how much torque the motion and the friction will ask.
# At a quarter of the stiffness it still does on the joints that move far (hip pitch, knee, ankle pitch).
# `drake-tc reproduce A.table2` runs two more stiffnesses and holds the ratios against the published ones.
#
# ## 3. What the command is made of
#
# A position servo is commanded with a position, so the torque loop asks for an offset $\Delta q$ from where the joint
# is. It has six parts:
#
# $$ \Delta q = K_\tau \tau_{ff} + K_v \dot q + (K_6 e_q + K_7 \dot e_q + K_8 \ddot e_q + K_9 e_f), $$
#
# the parts for torque, friction and feedback.

# %%
moving = swings["K6 = 1"]
parts = 1e3 * moving["components"].reshape(-1, len(COMPONENTS), len(joints))
offset = 1e3 * (moving["command"] - moving["encoder"])

fig, axes = plt.subplots(1, 2, figsize=(12, 3.8), sharex=True, layout="constrained")
for axis, joint in zip(axes, ("r_knee", "r_hip_pitch"), strict=True):
    i = joints.index(joint)
    axis.plot(time, offset[:, i], color="0.8", lw=4, label="all together")
    for component, name in enumerate(COMPONENTS):
        axis.plot(time, parts[:, component, i], lw=1, label=name.replace("_", " "))
    axis.set(title=f"{joint}, in motion", xlabel="time [s]", xlim=(0.7, time[-1]))
axes[0].set_ylabel("part of the command [mrad]")
axes[1].legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
plt.show()

# %% [markdown]
# In motion the friction feedforward is by far the largest part: behind such gears most of the motor's effort never
# reaches the link. It comes 40 ms late, as the velocity is estimated over the last 80 ms; the velocity feedback, which
# sees the same delay, makes up for some of it. A controller that lives on its friction model is as good as that model,
# and as dangerous.
#
# ## 4. Too much friction compensation runs away
#
# Friction that is compensated by more than there is, is negative friction. An ordinary least-squares fit lies in the
# middle of its data, so it over-estimates half of the time. An asymmetric fit, which punishes over-estimating a
# hundred times more, stays below. Here one joint floats on its feedforward alone, without any feedback; it is pushed
# (shaded) and let go.

# %%
fits = ("symmetric", "asymmetric")
runs = {(joint, fit): pushed(joint, fit) for joint in ("r_knee", "r_ankle_roll") for fit in fits}

fig, axes = plt.subplots(1, 2, figsize=(12, 3.4), layout="constrained")
for (joint, fit), run in runs.items():
    axis = axes[("r_knee", "r_ankle_roll").index(joint)]
    axis.plot(run.time, run.speed, color="tab:red" if fit == "symmetric" else "tab:blue", label=f"{fit} fit")
    axis.set(title=joint, xlabel="time [s]", xlim=(0.6, run.time[-1]))
    print(f"{joint:<14}{fit:<12} speed 0.4 s after release, over that at release: {run.growth:.2f}")
for axis in axes:
    axis.axvspan(BEGIN, BEGIN + LASTS, color="0.92")
axes[0].set_ylabel("speed [rad/s]")
axes[0].legend(loc="upper left")
plt.show()

# %% [markdown]
# After it was let go, the joint gets faster with the symmetric model, by itself, and slower with the asymmetric one.
# The swings above used the asymmetric model. `drake-tc reproduce A.stability` does this on every joint.
#
# ## 5. Force control on a rigid object
#
# The foot is on a rigid box. The vertical force is to follow a sine, the other axes are to stay at zero. Position
# feedback is down to a tenth of the servo's, so that force has its way.

# %%
contact = simulate_scenario(
    diagram_entry("hrp2_leg_contact").scenario("force_sine", text="{duration: 5.0, log_components: true}")
)
force = estimated(contact).contact_wrench
reference = contact["force_reference"]

fig, axes = plt.subplots(1, 3, figsize=(12, 3.4), sharex=True, sharey=True, layout="constrained")
for i, (axis, name) in enumerate(zip(axes, ("fx", "fy", "fz"), strict=True)):
    axis.plot(contact.time, force[:, i], lw=1, label="on the foot")
    axis.plot(contact.time, reference[:, i], "k--", lw=1, label="reference")
    axis.set(title=name, xlabel="time [s]", xlim=(0.5, 5.0))
axes[0].set_ylabel("force [N]")
axes[0].legend(loc="upper left")
plt.show()

settled = contact.time > 3.0
error = (force - reference)[settled, :3]
for name, share in zip(("fx", "fy", "fz"), np.abs(error).max(axis=0) / 50.0, strict=True):
    print(f"{name}: largest error {100 * share:4.1f} % of the sine's amplitude, once it has settled")

# %% [markdown]
# No delay is to be seen and next to nothing leaks to the other axes; the peaks fall a little short.
# What is the command made of now?

# %%
i = joints.index("r_knee")
parts = 1e3 * contact["components"].reshape(-1, len(COMPONENTS), len(joints))[:, :, i]
fig, axis = plt.subplots(figsize=(11, 3.4), layout="constrained")
for component, name in enumerate(COMPONENTS):
    axis.plot(contact.time, parts[:, component], lw=1, label=name.replace("_", " "))
axis.set(title="r_knee, in force control", xlabel="time [s]", ylabel="part of the command [mrad]", xlim=(0.7, 5.0))
axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
plt.show()

# %% [markdown]
# Nothing moves, so the torque feedforward leads where friction led before, and the force feedback corrects it.
#
# ## 6. A sensor fails in mid swing
#
# What goes wrong is part of the scenario too. On the left the encoders send nothing for 20 ms; on the right the IMU
# freezes for good. The fault monitor flags it, and the guard stops listening to the controller. It holds the last good
# command (hold), then makes each drive a damper (damp); once the readings are sound again, it leads the command back
# to the controller's, at a walk (start).

# %%
faults = {
    "encoders silent for 20 ms": "{encoder: [{kind: dropped, start: 1.3, duration: 0.02}]}",
    "IMU frozen for good": "{imu: [{kind: frozen, start: 1.3}]}",
}
shades = {GuardMode.HOLD: "tab:orange", GuardMode.DAMP: "tab:red", GuardMode.START: "tab:green"}

fig, axes = plt.subplots(2, 2, figsize=(12, 5), sharex=True, sharey="row", layout="constrained")
for (title, text), column in zip(faults.items(), axes.T, strict=True):
    failed = simulate_scenario(leg.scenario("stairs_swing", text=f"{{duration: 2.3, faults: {text}}}"))
    mode = np.round(failed["mode"][:, 0])
    for axis, joint in zip(column, ("r_hip_pitch", "r_knee"), strict=True):
        i = joints.index(joint)
        axis.plot(failed.time, failed["reference"][:, i], "k--", lw=1, label="reference")
        axis.plot(failed.time, failed.position[:, i], lw=1.5, label="position")
        for guard_mode, colour in shades.items():
            inside, upright = mode == guard_mode, axis.get_xaxis_transform()
            label = guard_mode.name.lower()
            axis.fill_between(failed.time, 0, 1, inside, transform=upright, color=colour, alpha=0.15, lw=0, label=label)
        axis.axvline(1.3, color="0.5", lw=0.8, ls=":")
        axis.set_xlim(1.1, 2.3)
    column[0].set_title(title)
    column[1].set_xlabel("time [s]")
    for fault in summarise(failed)["faults"]:
        print(f"{title}: {fault['name']} flagged {1e3 * (fault['first'] - 1.3):.0f} ms after it began")
    share = (np.abs(failed["actuation"]) / joint_limits(loop.robot).effort).max()
    finite = np.isfinite(failed["command"]).all()
    print(f"  largest torque {100 * share:.0f} % of its limit; all commands finite: {finite}")
axes[0, 0].set_ylabel("r_hip_pitch [rad]")
axes[1, 0].set_ylabel("r_knee [rad]")
axes[0, 1].legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
plt.show()

# %% [markdown]
# Where there is nothing to go by, the leg stays where it is.
#
# ## 7. The log goes back into the loop
#
# Every run leaves a log of what the robot's own sensors saw, with the joint torques estimated from them, and a rig
# file: what `drake-tc close-loop` reads. So the swings themselves can say what the linear model of a joint lacks. The
# swing that was a quarter as stiff is held out.

# %%
logs = {name: write_results(swing, folder / name, "csv")[0] for name, swing in swings.items()}
rig = folder / "knee.yaml"
rig.write_text("{joint: r_knee, drive: position_servo, load: torque, declared: {rotor_inertia: 0.8}}")

result = close_loop(rig, [logs["servo"], logs["K6 = 1"]], [logs["K6 = 0.25"]])
knee = result.joints["r_knee"]
print(f"verdict: {knee.verdict}\n")
for name, found in (("before", knee.before), ("after", knee.after)):
    print(f"{name}: error of the command, held out {1e3 * found.heldout:.4f} mrad RMS")
print(f"noise floor {1e3 * knee.noise_floor:.4f} mrad\n")
for effect in knee.effects:
    for name, p in effect.parameters.items():
        print(f"{effect.title}: {name} {p.value:.4g}, 95 %: {p.ci95[0]:.4g} to {p.ci95[1]:.4g}")

# %%
side = knee.heldout
velocity = side.samples.signals.velocity[side.samples.rows]
fig, axes = plt.subplots(1, 2, figsize=(11, 3.4), sharex=True, sharey=True, layout="constrained")
for axis, residual, title in zip(axes, (side.before, side.after), ("before", "after"), strict=True):
    axis.plot(velocity, 1e3 * residual, ".", ms=2, alpha=0.5)
    axis.set(title=title, xlabel="r_knee velocity [rad/s]")
axes[0].set_ylabel("residual, held out [mrad]")
plt.show()

# %% [markdown]
# Before, each direction of motion has a line of its own. That is what the tool names: the servo's gain depends on the
# direction. The knee is simulated, so we can look up what it has:

# %%
for value in load_models(loop.robot.actuators)["r_knee"].effects:
    print(value.key, dict(value.parameters))

# %% [markdown]
# The switch is there. The dead zone is too, but a swing hides it: on a joint that turns round once, under little load,
# it looks like more dry friction. To tell the two apart takes logs with many reversals and large loads, the scenarios
# `identify_motion` and `identify_pushes`. In a shell:
#
#     drake-tc simulate hrp2_leg --scenario-name identify_motion --out out/motion
#     drake-tc simulate hrp2_leg --scenario-name identify_pushes --out out/pushes
#     drake-tc simulate hrp2_leg --scenario-name stairs_swing_servo --out out/swing
#     drake-tc close-loop --rig out/motion/rig.yaml --log out/motion/log.csv --log out/pushes/log.csv \
#         --holdout out/swing/log.csv --out out/leg
#
# `out/leg/model_after.yaml` can then be the scenario's `model`, and the controller compensates what was found. How an
# effect is found, and when none is, is the story of [01_close_the_loop](01_close_the_loop.ipynb).
#
# ## 8. Your turn
#
# Fields that you might change, as `text` in `leg.scenario("stairs_swing", text=...)`, or with `--scenario-text` in a
# shell:
#
# | text | what it asks |
# |---|---|
# | `{model: null}` | what if the controller knew the true actuators? |
# | `{model: ../models/hrp2_like/hrp2_like_leg_symmetric.yaml}` | and with the fit that runs away when floating? |
# | `{gains: {k6: 0.25, kp: 4.0}}` | soft in position, hard in torque |
# | `{filters: {window: 40}}` | half the delay, more noise |
# | `{sensors: {preset: realistic, encoder: {latency: 0.002}}}` | encoders that are 2 ms late |
# | `{masses: {r_foot: 1.3}}` | a foot that is 30 % heavier than the model thinks |
# | `{pushes: [{link: r_foot, begin: 1.2, duration: 0.3, force: [40.0, 0.0, 0.0]}]}` | a hand that pushes the foot |
#
# Every field: `drake-tc schema scenario --page`. Your own robot: [diagrams/README.md](../diagrams/README.md).
