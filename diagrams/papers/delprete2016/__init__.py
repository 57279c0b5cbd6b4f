"""Del Prete, Mansard, Ramos, Stasse and Nori (2016): torque control with high-ratio gears and no torque sensors."""
