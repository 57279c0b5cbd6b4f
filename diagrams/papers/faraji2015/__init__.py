"""Faraji, Colasanto and Ijspeert (2015): inverse dynamics on a humanoid with series-elastic joints."""
