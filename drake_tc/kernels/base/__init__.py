"""The base of a legged robot: what a tick of its estimator computes (`drake_tc.estimation.base`)."""
