"""The papers' tables and figures, computed anew: one file each, with expected values beside."""
