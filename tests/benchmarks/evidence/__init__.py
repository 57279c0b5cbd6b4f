"""How far the experiments keep what they promise, measured on simulated rigs."""
