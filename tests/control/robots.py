"""A planar double pendulum as a robot file: point masses m1, m2 at the ends of links l1, l2, swinging about y."""

from pathlib import Path

import numpy as np

from drake_tc.robot.robot import Robot, load_robot

M1, M2, L1, L2, G = 2.0, 1.5, 0.7, 0.4, 9.81

LINK = """
  <link name="{name}"><inertial><origin xyz="0 0 {z}"/><mass value="{mass}"/>
    <inertia ixx="1e-12" iyy="1e-12" izz="1e-12" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
TINY = 1e-9


def pendulum(folder: Path, *, joints: str = "[shoulder, elbow]", fixed: bool = True, more: str = "") -> Robot:
    parts = [
        LINK.format(name="base", z=0, mass=1.0),
        LINK.format(name="upper", z=-L1, mass=M1),
        LINK.format(name="lower", z=-L2, mass=M2),
        LINK.format(name="tip", z=0, mass=TINY),
    ]
    limit = '<limit lower="-3" upper="3" effort="50" velocity="10"/>'
    joint = """
  <joint name="{n}" type="{t}"><parent link="{p}"/><child link="{c}"/><origin xyz="0 0 {z}"/>
    <axis xyz="0 1 0"/>{l}</joint>"""
    parts += [
        joint.format(n="shoulder", t="revolute", p="base", c="upper", z=0, l=limit),
        joint.format(n="elbow", t="revolute", p="upper", c="lower", z=-L1, l=limit),
        joint.format(n="wrist", t="fixed", p="lower", c="tip", z=-L2, l=""),
    ]
    (folder / "pendulum.urdf").write_text(f'<robot name="pendulum">{"".join(parts)}\n</robot>\n')
    source = folder / "pendulum.yaml"
    source.write_text(
        f"name: pendulum\nurdf: pendulum.urdf\nbase: base\nfixed_base: {str(fixed).lower()}\njoints: {joints}\n"
        "force_torque: {hand: {joint: wrist}}\n" + more
    )
    return load_robot(source)


def dynamics(q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(M, h, J) by Lagrange's equations; J of the tip, [x y z; rotations] in the axes of the base."""
    a, ab = q[0], q[0] + q[1]
    c, s = np.cos(q[1]), np.sin(q[1])
    m11 = (M1 + M2) * L1**2 + M2 * L2**2 + 2 * M2 * L1 * L2 * c
    m12 = M2 * L2**2 + M2 * L1 * L2 * c
    mass = np.array([[m11, m12], [m12, M2 * L2**2]])
    coriolis = M2 * L1 * L2 * s * np.array([-2 * v[0] * v[1] - v[1] ** 2, v[0] ** 2])
    gravity = np.array([(M1 + M2) * G * L1 * np.sin(a) + M2 * G * L2 * np.sin(ab), M2 * G * L2 * np.sin(ab)])
    # the tip is at -L1 (sin a, cos a) - L2 (sin ab, cos ab) in (x, z)
    jacobian = np.zeros((6, 2))
    jacobian[0] = [-L1 * np.cos(a) - L2 * np.cos(ab), -L2 * np.cos(ab)]
    jacobian[2] = [L1 * np.sin(a) + L2 * np.sin(ab), L2 * np.sin(ab)]
    jacobian[4] = 1.0
    return mass, coriolis + gravity, jacobian
