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
# # Experiments that tell: check before, design next, rehearse
#
# [01_close_the_loop](01_close_the_loop.ipynb) finds the effects that a joint's model lacks. Whether it can find them
# depends on the logs: on the motion, on the load and on the sensors. This notebook asks three questions that can be
# answered before anything is recorded again:
#
# 1. What can these logs show, and from which size on? (`drake-tc check`)
# 2. Which motion, within the joint's limits, would show more? (`drake-tc design`)
# 3. Would this set-up have found an effect of a given size? (`drake-tc rehearse`)
#
# **Everything here is simulated.** The bench is the one of the demo of `drake-tc close-loop`, recorded for 8 s a run.

# %%
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from drake_tc.cli.demo import DemoLength, record_demo
from drake_tc.errors import ParamsError
from drake_tc.experiments.check.run import check_rig
from drake_tc.experiments.design.goal import parse_goal
from drake_tc.experiments.design.known import joint_from_logs, limits_with
from drake_tc.experiments.design.run import DesignOptions, design_joint
from drake_tc.experiments.rehearsal.run import rehearse
from drake_tc.experiments.rehearsal.twin import twin_of
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import load_rig

folder = Path(tempfile.mkdtemp())
rig_file, logs, holdout = record_demo(folder, 0, DemoLength(duration=8.0, period=2e-3, step=2.5e-4), jobs=1)
rig = load_rig(rig_file)
name = rig.joints[0]

# %% [markdown]
# ## 1. What can these logs show?
#
# The check fits the declared model alone. For every effect of the library it computes what the effect would do to the
# torque balance at these motions, and how much of that no change of the declared parameters imitates. Beside the noise
# of the balance, that gives the smallest size that a search would take for real.

# %%
checked = check_rig(rig_file, logs)
effects = checked.joints[name].effects
for finding in checked.joints[name].findings:
    print(f"{finding.level:8} {finding.text}")
print()
for each in effects.effects:
    if each.status in ("seen", "weakly"):
        print(f"{each.key:32} {each.status:8} found from {each.smallest:.3g} {each.size.unit}")

# %% [markdown]
# What is not seen has a reason. Some effects need a column that was not recorded; others are imitated by the declared
# model at these motions, or by another effect.

# %%
for each in effects.effects:
    if each.status == "not_separable":
        print(f"{each.key:32} not separable from {', '.join(each.not_separable_from)}")
    elif each.status == "not_seen":
        print(f"{each.key:32} {each.reason}")

# %% [markdown]
# ## 2. Which motion would show more?
#
# A design maximises the information within limits of position, velocity, acceleration and torque. The goal may be the
# parameters, or two effects that shall be told apart. Some pairs cannot be told apart by any motion, because they are
# the same function while the joint slides. The design then refuses, with the identity that proves it.

# %%
runs = load_runs([*logs, *holdout], rig)
joint, found_limits, prepared = joint_from_logs(rig, runs[: len(logs)], name)
limits = limits_with(found_limits, {"bandwidth_hz": 2.0}, name)
options = DesignOptions(duration=10.0, starts=1, iterations=8)
try:
    design_joint(joint, limits, parse_goal("tell:torque_sensor_bias,encoder_offset"), options)
except ParamsError as refusal:
    print(f"refused: {refusal}")

# %%
goal = parse_goal("parameters:load_dependent_friction,stribeck")
design = design_joint(joint, limits, goal, options, prepared)
for sentence in design.sentences:
    print(sentence)
ratio = np.median([each.after / each.default for each in design.expected])
print(f"the designed motion narrows the intervals: {ratio < 1.0}")
time, motion = design.motion(200.0)
figure, axes = plt.subplots(3, 1, sharex=True, figsize=(8, 5))
for row, label in enumerate(("position [rad]", "velocity [rad/s]", "acceleration [rad/s²]")):
    axes[row].plot(time, motion[row])
    axes[row].set_ylabel(label)
axes[2].set_xlabel("time [s]")
axes[0].set_title("The designed motion, with its lead-in and lead-out")
plt.show()
within = bool(np.abs(motion[1]).max() <= limits.velocity and np.abs(motion[2]).max() <= limits.acceleration)
print(f"the motion keeps its limits and begins and ends at rest: {within and abs(motion[1, [0, -1]]).max() < 1e-6}")

# %% [markdown]
# ## 3. Would this set-up have found it?
#
# A rehearsal puts an effect into the joint's own runs. An independent simulator, which shares no formula with the
# diagnosis, repeats the recorded motions with the recorded loads, sensors and noise. Each simulated joint is then
# diagnosed without knowing what was put in. Size 0 tells how often the effect is named although nothing is missing.

# %%
twin = twin_of(rig, runs, name)
rehearsed = rehearse(twin, "cable_spring", 8.0, [runs[-1].name], repeats=1, factors=(0.05, 1.0))
for point in rehearsed.points:
    print(f"{point.size:6.3g} {rehearsed.size.unit}: found in {point.found} of {point.trials}")
print(f"a spring of 8 N·m/rad is found: {rehearsed.points[-1].found == 1}")
print(f"a joint without a spring is said to have one: {rehearsed.points[0].found == 1}")

# %% [markdown]
# On the command line:
#
# ```
# drake-tc check --rig rig.yaml --log run1.parquet --log run2.parquet --out check
# drake-tc design --rig rig.yaml --log run1.parquet --goal tell:stribeck,load_dependent_friction --duration 30
# drake-tc design --rig rig.yaml --after out/report.json
# drake-tc design --rig rig.yaml --log run1.parquet --goal tell:stribeck,load_dependent_friction --load 0 --load 1.5@0.3
# drake-tc rehearse --rig rig.yaml --log run1.parquet --log run2.parquet --with backlash=0.001
# ```
