"""Control loops wired from the library's systems: torque loop, whole-body loop, series-elastic joint, joint bench."""
