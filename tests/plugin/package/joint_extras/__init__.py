"""An effect, a task and a limit for drake_tc."""
