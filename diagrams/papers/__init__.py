"""The papers' tables and figures, computed anew: a folder a paper, with the expected values beside."""
