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
# # Close the loop between a joint's model and its logs
#
# A geared joint sits under its vendor's position servo. We have logs of it and a model. The model does not quite fit.
# This notebook walks from the raw log to the effect that the model lacks, adds it, and drives the joint with the old
# and with the new model.
#
# **The rig is simulated**, by the Drake diagram `drake_tc.loops.joint_bench`: so that the story runs anywhere, and
# so that we can look up the truth at the end. The tool sees nothing but the files.

# %%
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from drake_tc import close_loop, feedforward_effort, load_models, load_rig, load_runs
from drake_tc.actuation.compensator import Motion
from drake_tc.actuation.free_run import model_to_simulate
from drake_tc.cli.close_loop_command import write_results
from drake_tc.cli.demo import GRAVITY_MOMENT, JOINT, LIMITS, LINK_INERTIA, DemoLength, demo_model, record_demo
from drake_tc.identification import growing_sinusoid
from drake_tc.loops.joint_bench import BenchScenario, Table, record_bench, rig_free_run

folder = Path(tempfile.mkdtemp())

# %% [markdown]
# ## 1. Three runs
#
# Static postures with pushes by hand, a sinusoid that grows, and a multisine. The first two are for fitting; the third
# is held out: it takes no part in fitting or in choosing.

# %%
rig_file, logs, holdout = record_demo(folder, seed=0, length=DemoLength(duration=16.0), jobs=1)
print(rig_file.read_text())

# %% [markdown]
# That is all the owner says of the joint: the drive is a position servo, and the rotor's inertia, seen through the
# gear, is 0.31 kg m². Viscous and Coulomb friction are always taken as modelled, with values to be found.

# %%
rig = load_rig(rig_file)
runs = load_runs([*logs, *holdout], rig)

fig, axes = plt.subplots(2, 3, figsize=(12, 5), sharex=True, layout="constrained")
for run, (above, below) in zip(runs, axes.T, strict=True):
    lag = run.columns[f"{JOINT}/position_command"] - run.columns[f"{JOINT}/position"]
    above.plot(run.time, run.columns[f"{JOINT}/position"], lw=1)
    below.plot(run.time, 1e3 * lag, lw=0.8, color="tab:orange")
    above.set_title(run.name.replace("_", " "))
    below.set_xlabel("time [s]")
axes[0, 0].set_ylabel("position [rad]")
axes[1, 0].set_ylabel("command - position [mrad]")
plt.show()

# %% [markdown]
# ## 2. What does the model lack?
#
# A position servo turns its position error into torque, so the error tells the torque:
#
# $$ \Delta q = K\,(\tau + J\ddot q + b\dot q + F\,\mathrm{sign}\,\dot q + \dots) $$
#
# `close_loop` fits what is declared, looks at what is left on every run, lets each effect of the library compete for
# it, and keeps those that are real: they must lower the cross-validated error by more than the sensors' resolution, in
# nearly every resample of the data.

# %%
result = write_results(close_loop(rig_file, logs, holdout, free_run=rig_free_run), folder / "out")
print(result)

# %% [markdown]
# Printed, a result is what the command prints; as the last line of a cell it has the plot of the residual beside it:
# measured and modelled effort on the run that was held out, and what each model leaves.

# %%
joint = result[JOINT]
joint.plot_residual()

# %% [markdown]
# ## 3. See it
#
# The residual of the declared model against velocity, on the held-out run: a step at zero is a dead zone, or Coulomb
# friction that the fit could not place; the peaks beside zero are friction that is higher at rest than in motion.
# Afterwards, nothing with a shape is left.

# %%
side = joint.heldout
velocity = side.samples.signals.velocity[side.samples.rows]
fig, axes = plt.subplots(1, 2, figsize=(11, 3.6), sharex=True, sharey=True, layout="constrained")
for axis, residual, title in zip(axes, (side.before, side.after), ("before", "after"), strict=True):
    axis.plot(velocity, 1e3 * residual, ".", ms=1.5, alpha=0.4)
    axis.set(title=title, xlabel="velocity [rad/s]")
axes[0].set_ylabel("residual, held out [mrad]")
plt.show()

# %% [markdown]
# ## 4. The improved model in the Drake diagram
#
# **Free run.** The diagram gets the recorded command and nothing else, and has to reproduce the recorded position.

# %%
trace = joint.free_run["multisine_held_out"]
fig, axis = plt.subplots(figsize=(11, 3), layout="constrained")
for name in ("before", "after"):
    axis.plot(trace["time"], 1e3 * (trace[name] - trace["recorded"]), lw=0.8, label=name)
axis.set(xlabel="time [s]", ylabel="simulated - recorded [mrad]")
axis.legend(loc="upper right")
plt.show()

# %% [markdown]
# **Feedforward torque control.** Now the model earns its living. We want the link to follow a motion that it has never
# made, so we compute the torque for it, and from the torque the command that makes the servo deliver it:
#
# $$ \tau_d = I\ddot q_d + m g l \sin q_d, \qquad q_{cmd} = q_d + \Delta q(\tau_d, \dot q_d, \ddot q_d) $$
#
# There is no feedback but the vendor's own. The joint that is driven is the true one, which has effects that only the
# improved model knows.

# %%
length = DemoLength(duration=10.0)
time = np.arange(round(length.duration / length.period) + 1) * length.period
desired = growing_sinusoid(time, 0.4, 0.0, 0.08, LIMITS)
tau_d = LINK_INERTIA * desired.acceleration + GRAVITY_MOMENT * np.sin(desired.position)
motion = Motion(desired.velocity, desired.position, desired.acceleration)

commands = {"servo alone": desired.position}
for name in ("before", "after"):
    model = load_models(folder / "out" / f"model_{name}.yaml")[JOINT]
    commands[f"model {name}"] = desired.position + feedforward_effort(model, tau_d, motion)

bench = BenchScenario(length.duration, length.period, length.step, LINK_INERTIA, GRAVITY_MOMENT)
plant = model_to_simulate(demo_model(seed=0), length.step)
errors = {}
for name, command in commands.items():
    driven = record_bench(plant, Table(time, command), bench, name=name)
    errors[name] = driven.columns[f"{JOINT}/position"] - desired.position

# %%
fig, axes = plt.subplots(3, 1, figsize=(11, 6), sharex=True, layout="constrained")
axes[0].plot(time, desired.position, "k", lw=1)
axes[0].set_ylabel("desired position [rad]")
for name, error in errors.items():
    axis = axes[1] if name == "servo alone" else axes[2]
    axis.plot(time, 1e3 * error, lw=0.8, label=f"{name}: {1e3 * np.sqrt(np.mean(error**2)):.2f} mrad RMS")
for axis in axes[1:]:
    axis.set_ylabel("position error [mrad]")
    axis.legend(loc="upper left")
axes[-1].set_xlabel("time [s]")
plt.show()

# %% [markdown]
# ## 5. The truth
#
# The rig was simulated, so we can look it up. On a real joint this cell does not exist, and the held-out run is all
# that there is.

# %%
for value in demo_model(seed=0).effects:
    print(value.key, dict(value.parameters))

# %% [markdown]
# The full report, with correlations, intervals, the rejected effects and the difference between the two model files,
# is the `report.html` that `drake-tc close-loop` writes.
