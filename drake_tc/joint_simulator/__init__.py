"""An independent simulation of one joint that shares no formula with the effects; rehearsals and blind rigs use it."""
