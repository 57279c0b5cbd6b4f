"""Generated inputs, most of them damaged, for every command: each is used, or refused in one good line."""
