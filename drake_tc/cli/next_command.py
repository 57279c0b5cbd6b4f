"""The line `next: ...` on the error stream: the command that follows one that has ended well."""

import shlex
import sys

from drake_tc.config.files import utf8_text


def command_line(*words: object) -> str:
    """A drake-tc command that a shell takes as it is; bytes of names that are not UTF-8 are replaced."""
    return shlex.join(["drake-tc", *(utf8_text(str(word)) for word in words)])


def say_next(text: str) -> None:
    """Print what to run next."""
    print(f"next: {text}", file=sys.stderr)
