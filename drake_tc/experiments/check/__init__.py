"""What logs can and cannot show, before any effect is looked for."""
