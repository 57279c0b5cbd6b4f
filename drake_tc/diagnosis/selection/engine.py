"""Which effects are missing: a beam search over sets of effects by cross-validated error, on training runs alone.

The engine knows nothing of joints or rigid bodies. A `Problem` proposes one-effect-larger models, refines them and says
how well they do; `selection.joint` and `selection.shared` are the two kinds.
"""

from collections.abc import Callable

Progress = Callable[[str, float], None]
