"""M qddot + h of a robot with a welded base by a block of Drake's own: what a tick needs of it runs in C++."""

from pydrake.systems.controllers import InverseDynamics
from pydrake.systems.framework import DiagramBuilder, OutputPort

from drake_tc.control.dynamics_terms import DynamicsTerms
from drake_tc.loops.ports import picked


def rigid_torque(builder: DiagramBuilder, terms: DynamicsTerms, motion: OutputPort) -> OutputPort:
    """Add the block `rigid_torque`, and selectors that bring motion and torque into order.

    Args:
        builder: Of the diagram.
        terms: Of the robot's links, to be kept as long as the diagram: the block stands on its plant.
        motion: (3n,) [q; qdot; qddot], finite whatever happens: Drake refuses a state that is not.

    Returns:
        (n,) M(q) qddot + h(q, qdot), gravity included, in the robot's order [N m].
    """
    n = terms.size
    block = InverseDynamics(terms.plant, InverseDynamics.InverseDynamicsMode.kInverseDynamics)
    builder.AddNamedSystem("rigid_torque", block)
    places = {
        "estimated_state": [*terms.to_plant, *(n + i for i in terms.to_plant)],
        "desired_acceleration": [2 * n + i for i in terms.to_plant],
    }
    for name, port in picked(builder, "rigid_motion", motion, places).items():
        builder.Connect(port, block.GetInputPort(name))
    ours = {"inertial_torque": terms.from_plant}
    torque: OutputPort = picked(builder, "rigid_torque_in_order", block.get_output_port(), ours)["inertial_torque"]
    return torque
