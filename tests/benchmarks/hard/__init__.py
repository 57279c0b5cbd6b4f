"""The harder draw: simulated single joints that test what the diagnosis names, written without it.

    python -m tests.benchmarks.hard --seed 1 --count 100 --folder out/hard [--only rig_007] [--json]

draws rigs, diagnoses them and prints the score; `--score` counts the reports that are in the folder. Half of the rigs
lack nothing. The others lack one to three causes, each of which leaves 1.5 to 10 floors. Every channel has its own age,
average, rate, jitter, steps, noise, gain and zero; friction and zero differ from run to run.
"""
