"""Would this set-up have found it: the user's own motions, sensors and noise, with an effect put in by simulation."""
