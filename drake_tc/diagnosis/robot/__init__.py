"""Robots: joints whose loads come from one model, which may itself be wrong or unknown."""
