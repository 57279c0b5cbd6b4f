"""Logs of simulated arms of several makers with an undeclared effect, for the blind benchmark of arms."""
