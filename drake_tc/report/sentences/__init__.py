"""Sentences on what the diagnosis found: console, report.json and HTML take them from here."""
