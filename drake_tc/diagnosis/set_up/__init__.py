"""Gross errors of an arm's set-up: a reversed joint, an effort in another unit, another mounting than the URDF's."""
