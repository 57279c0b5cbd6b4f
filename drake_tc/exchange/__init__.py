"""Identified models in the terms of other simulators, and what each of them cannot express."""
