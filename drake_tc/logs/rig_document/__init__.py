"""The rig file as a pydantic model: the one source of its checks, its page (RIG.md) and its JSON schema."""
