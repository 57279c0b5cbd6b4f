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
# %% [markdown]
# # The same joint next month
#
# [01_close_the_loop](01_close_the_loop.ipynb) finds what the model of a joint lacks, and adds it. The model is then
# right for the day of its logs. This notebook asks three questions about the months after:
#
# 1. What changed since? (`drake-tc compare`)
# 2. How does it go on? (`drake-tc compare --history`)
# 3. Does the model still hold now, in the loop? (`ModelMonitor`)
#
# **Everything here is simulated.** The bench is the one of the demo of `drake-tc close-loop`. In every month its
# Coulomb friction grows by 0.3 N·m from 6 N·m, and nothing else changes.

# %%
import tempfile
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import drake_tc
from drake_tc.cli.demo import DemoLength, demo_model, demo_run, record_demo
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.result.models import models_of
from drake_tc.report.comparison import history_figure, history_sentences
from drake_tc.watch.history import add_session, read_history, trends
from drake_tc.watch.monitor import CAUSES

folder = Path(tempfile.mkdtemp())
length = DemoLength(duration=12.0, period=2e-3, step=2.5e-4)
rig, logs, holdout = record_demo(folder, 0, length, jobs=1)
options = DiagnosisOptions(assess_residual=False)

# %% [markdown]
# The model is made once, from three runs. It contains what the search found: a dead zone and Stribeck friction.

# %%
first = drake_tc.close_loop(rig, logs, holdout, options)
models_of(first, folder)
joint = next(iter(first.joints))
print(first.verdict, sorted(effect.id for effect in first[joint].effects))

# %% [markdown]
# ## 1. What changed since?
#
# Each month one run is recorded, with another excitation and another noise. The first one is of the joint as it was.

# %%
model, months, truth = demo_model(0), [], []
for month in range(5):
    coulomb = 6.0 + 0.3 * month
    worn = tuple(replace(v, parameters={"coulomb": coulomb}) if v.key == "coulomb" else v for v in model.effects)
    run = demo_run(replace(model, effects=worn), "multisine_held_out", 20 + month, length, np.random.default_rng(month))
    months.append(pd.DataFrame({"time": run.time, **run.columns}))
    truth.append(coulomb)

found = [drake_tc.compare(folder / "model_after.yaml", [log], rig, options=options) for log in months]
print([each.verdict for each in found], *(each[joint].why for each in found))
found[-1]

# %% [markdown]
# In the first month nothing changed. In the last one Coulomb friction is named, and nothing else, with an interval that
# contains the spread between sessions: a friction that differs by 2 % from day to day is no wear.

# %%
last = next(p for p in found[-1][joint].parameters if p.key == "coulomb")
print(f"Coulomb friction changed by {last.change.value:.2f} N m, truth {truth[-1] - 6.0:.2f} N m")
print("the interval holds the truth:", last.change.ci95[0] < truth[-1] - 6.0 < last.change.ci95[1])
print("changed:", [p.key for p in found[-1][joint].parameters if p.changed])

# %% [markdown]
# ## 2. How does it go on?
#
# A history keeps one record a session. The line through the values has an interval, and beyond the last session it
# becomes wider.

# %%
for month, each in enumerate(found):
    add_session(each, folder / "history", "A17", datetime(2026, 3 + month, 1, tzinfo=UTC))
sessions = read_history(folder / "history")
print(*history_sentences(sessions), sep="\n")
history_figure(sessions, joint)

# %%
line = trends(sessions, "A17", joint)["coulomb.coulomb"]
low, high = (30.5 * end for end in line.slope_ci95)
print(f"drift {30.5 * line.slope:.2f} [{low:.2f}, {high:.2f}] N m a month, truth 0.30")
print("the trend's interval holds the truth:", low < 0.3 < high)

# %% [markdown]
# ## 3. Does the model still hold now?
#
# In the loop there are no logs to fit. `ModelMonitor` compares the effort with the one that the model needs, at every
# tick, and names the cause that explains the difference. Here a joint with a current drive moves for 40 s. After 15 s
# its friction grows by a fifth, and after 30 s somebody pushes it.

# %%
known = drake_tc.ActuatorModel(
    "elbow",
    drake_tc.Drive("current", 0.08),
    tuple(drake_tc.EffectValue(k, {k: v}) for k, v in (("rotor_inertia", 0.3), ("viscous", 6.0), ("coulomb", 4.0))),
)
monitor = drake_tc.ModelMonitor([known], deviation=0.35, correlation_time=0.02)
t = np.arange(0.0, 40.0, 1e-3)
q, v = 0.5 * np.sin(2.0 * t) + 0.2 * np.sin(4.7 * t), np.cos(2.0 * t) + 0.94 * np.cos(4.7 * t)
a = -2.0 * np.sin(2.0 * t) - 4.418 * np.sin(4.7 * t)
push = 25.0 * np.clip(1.0 - np.abs((t - 30.15) / 0.15), 0.0, None)
noise = np.random.default_rng(1)
load = 15.0 * np.sin(q) + 0.8 * a + 0.15 * noise.standard_normal(t.size)
friction = (6.0 * v + 4.0 * np.tanh(v / 0.01)) * np.where(t < 15.0, 1.0, 1.2)
effort = 0.08 * (15.0 * np.sin(q) + 1.1 * a + friction + push + 0.3 * noise.standard_normal(t.size))
memory, shown = monitor.start()
rows = []
for k in range(t.size):
    seen = np.array([[x] for x in (q[k], v[k], a[k], load[k], effort[k], push[k])])
    needed = monitor.needed(seen, np.full(1, 25.0))
    monitor.tick(seen, needed, memory, shown)
    rows.append(shown[:4].copy())
residual, cause, change, statistic = np.array(rows).T

figure, axes = plt.subplots(2, 1, sharex=True, figsize=(7.0, 3.6))
axes[0].plot(t, statistic, color="tab:blue")
axes[0].axhline(1.0, color="gray", linewidth=0.8)
axes[0].set_ylabel("CUSUM over its limit")
axes[1].plot(t, 100.0 * change, color="tab:orange")
axes[1].set_ylabel("change named [%]")
axes[1].set_xlabel("time [s]")
figure.tight_layout()
plt.show()

# %%
begun = t[cause > 0.0][0]
named = sorted({CAUSES[int(c) - 1] for c in cause[t > 20.0] if c > 0.0})
print(f"named {begun - 15.0:.2f} s after the change; causes from 5 s after it on: {named}")
print("nothing named before:", not (cause[t < 15.0] > 0.0).any(), "; friction named at the end:", cause[-1] == 1.0)
print("the push is told as a push:", bool((cause[(t > 30.0) & (t < 30.4)] < 0.0).any()))
print(f"size of the change at the end: {100.0 * change[-1]:.0f} %")

# %% [markdown]
# The limits of both are on the page [The same joint later](../docs/same_joint_later.md).
