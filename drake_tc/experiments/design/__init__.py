"""The next experiment: motions that measure parameters well, or tell two missing effects apart, within limits."""
