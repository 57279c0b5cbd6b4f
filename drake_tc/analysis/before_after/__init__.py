"""The torque loop along a held-out motion, its controller compensating the model before or after."""
