"""The torque loop piece by piece: its parts, ports, stages and observers, as `torque_loop` wires them."""
