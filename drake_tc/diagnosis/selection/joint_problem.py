"""One joint's regression as a problem of the search engine."""

from collections.abc import Sequence

from drake_tc.effects.base import Context, Effect
from drake_tc.effects.obstacle import Obstacle


def candidates(
    library: Sequence[Effect], context: Context, declared: Sequence[str]
) -> tuple[list[Effect], list[tuple[str, Obstacle]]]:
    """Effects that can be looked for, and of the others the key and what stands in the way."""
    usable, obstacles = [], []
    for effect in library:
        if effect.id in declared:
            continue
        obstacle = effect.unavailable(context)
        if obstacle is None:
            usable.append(effect)
        else:
            obstacles.append((effect.key, obstacle))
    return usable, obstacles
