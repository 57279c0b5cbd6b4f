"""The floating base's pose and velocity, from the point of each contact that stands still.

Source: Faraji et al., 2015, section III.
"""
