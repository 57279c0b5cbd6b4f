"""The task, the limit and the effect of the installed package on an arm and a humanoid of other makers."""

import re
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from optional import skip_without_robots

from .conftest import ROOT

PAIRS = {
    "arm": ("panda_joint2", "panda_joint4"),
    "humanoid": ("leg_left_4_joint", "leg_right_4_joint"),
}
SOLES = """
contacts:
  right: {link: right_sole_link, half_length: 0.1, half_width: 0.06}
  left: {link: left_sole_link, half_length: 0.1, half_width: 0.06}
"""

TICK = """
import sys
import numpy as np
from drake_tc import RobustTsid, load_law

def tick(watts, speed):
    law = load_law(sys.argv[1], {"limits": {"joint_power": {"watts": watts}}})
    model = law.model
    first, second = (model.robot.joints.index(joint) for joint in sys.argv[2:])
    q, v = model.start.copy(), np.zeros(model.nv)
    v[model.actuated[second]] = speed
    system = RobustTsid(law, strict=True)
    context = system.CreateDefaultContext()
    system.GetInputPort("estimated_state").FixValue(context, np.concatenate((q, v)))
    apart = q[model.positions[first]] - q[model.positions[second]]
    system.GetInputPort("pair_reference").FixValue(context, [apart + 0.02])
    vdot = system.GetOutputPort("acceleration").Eval(context)
    power = speed * system.GetOutputPort("torque").Eval(context)[second]
    return vdot[model.actuated[first]] - vdot[model.actuated[second]], power

speed = 0.5 if tick(1e6, 0.5)[1] > 0.0 else -0.5
apart, power = tick(1e6, speed)
print(apart, power, tick(0.8 * abs(power), speed)[1])
"""

DRAG = """
import sys
import numpy as np
from drake_tc import ActuatorModel, ActuatorPlant, Drive, EffectValue, load_robot

robot = load_robot(sys.argv[1])
drag = EffectValue("seal_drag", {"cosine_drag": 0.25, "sine_drag": -0.4})
rng = np.random.default_rng(3)
q, v = rng.uniform(-1.0, 1.0, (2, len(robot.joints)))
torques = []
for more in ((), (drag,)):
    models = [
        ActuatorModel(joint, Drive("current", 0.5), (EffectValue("viscous", {"viscous": 0.7}), *more))
        for joint in robot.joints
    ]
    system = ActuatorPlant(models, dt=1e-6, inertias=1.0)
    context = system.CreateDefaultContext()
    system.GetInputPort("command").FixValue(context, np.ones(q.size))
    system.GetInputPort("state").FixValue(context, np.concatenate((q, v)))
    torques.append(system.GetOutputPort("actuation").Eval(context))
for row in (q, v, torques[0] - torques[1]):
    print(*row)
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """The robot files of `docs/your_own_robot.md`."""
    skip_without_robots()
    path = tmp_path_factory.mktemp("robots")
    page = (ROOT / "docs" / "your_own_robot.md").read_text("utf-8")
    for name, text in re.findall(r"File `(\w+\.yaml)`:\n\n```yaml\n(.*?)```", page, flags=re.DOTALL):
        (path / name).write_text(text, "utf-8")
    return path


@pytest.mark.parametrize("robot", ["arm", pytest.param("humanoid", marks=pytest.mark.slow)])
def test_task_and_limit_of_the_package(python, folder, robot):
    """The pair's accelerations differ by kp times the error, and the power of a driving joint stays below its limit."""
    (folder / f"{robot}_tsid.yaml").write_text(
        f"""
robot: {robot}.yaml
{SOLES if robot == "humanoid" else ""}
tasks:
  posture: {{kind: posture, kp: 10.0, kd: 5.0, weight: 0.01}}
  pair: {{kind: mirror, joints: [{", ".join(PAIRS[robot])}], kp: 100.0, kd: 0.0, weight: 1000.0}}
""",
        "utf-8",
    )
    ran = python("-c", TICK, f"{robot}_tsid.yaml", *PAIRS[robot], cwd=folder)
    assert ran.returncode == 0, ran.stderr
    apart, power, held = (float(number) for number in ran.stdout.split())
    assert_allclose(apart, 100.0 * 0.02, rtol=0.02)
    assert power > 0.0
    assert held <= 0.8 * power * (1.0 + 1e-9)


def test_effect_of_the_package(python, folder):
    """In every joint the drives' torque lacks (c cos q + s sin q) qdot."""
    ran = python("-c", DRAG, "arm.yaml", cwd=folder)
    assert ran.returncode == 0, ran.stderr
    q, v, lost = (np.array(line.split(), dtype=float) for line in ran.stdout.strip().splitlines())
    assert_allclose(lost, (0.25 * np.cos(q) - 0.4 * np.sin(q)) * v, rtol=1e-4, atol=1e-9)
