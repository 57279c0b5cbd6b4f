"""The sentences of RIG.md; the tables in braces are written from the model of the rig file."""

TEXT = """# The rig file

<!-- Written by `drake-tc schema rig --page --out drake_tc/logs/RIG.md` from drake_tc/logs/rig_document. Do not edit. -->

A rig file (YAML) says what your logs show: the joints, how their drives are commanded, where the load torque comes from, and what
you already model. This page lists every key. `drake-tc schema rig` prints the JSON schema for editors, `drake-tc schema rig --page` prints this page.

With the YAML extension of VS Code or any editor that uses `yaml-language-server`, run `drake-tc schema rig --out rig.schema.json` and begin the rig file with

    # yaml-language-server: $schema=rig.schema.json

Plain numbers are in SI units. Where a key takes a unit, a text such as `20 ms` or `0.09 deg` is also possible.

## Two complete examples

A joint with a torque sensor (`drake_tc/logs/examples/joint_rig.yaml`):

```yaml
{joint_rig}
```

A leg whose load torques come from the robot's model, an F/T sensor and an IMU (`drake_tc/logs/examples/leg_rig.yaml`), and the robot file that it names:

```yaml
{leg_rig}
```

```yaml
{leg_robot}
```

[models/README.md](../../models/README.md) explains every key of a robot file.

## The keys

{top}

`drive`, `load`, `declared`, `saturation` and `drive_gain` take one value for all joints or a mapping by joint: `drive: {{hip: current, knee: voltage}}`.
A joint that a mapping by joint leaves out has the default; `drive` needs an entry for every joint. An optional key without a value counts as absent.

## `columns` and `units`: the log

A rig of one joint may name a column by its last part (`position` for `knee/position`). `units` takes a full name or a last part; a last part holds for all
joints. `position: deg` also holds for `position_command` and `motor_position` unless they have an entry of their own; a sign or a number does not carry over.
Every joint needs `position` and the command of its drive, and `torque` where `load: torque` holds. More columns make more effects visible.

{columns}

A column whose name nearly matches a canonical one, and a column that looks like a temperature, a supply voltage or a switch of the drive and is not used,
is pointed out in the report.

## `load`: where the load torque comes from

{load_words}

{load_kinds}

## `declared`: what you already model

| form | example |
|---|---|
| ids, values unknown | `declared: [stribeck, rotor_inertia]` |
| id: value of the first parameter, or nothing for an unknown value | `declared: {{rotor_inertia: 0.31, stribeck: null}}` |
| id: values by parameter | `declared: {{presliding_hysteresis: {{presliding: 2.0, presliding_travel: 0.004}}}}` |
| by joint | `declared: {{hip: {{rotor_inertia: 0.31}}, knee: [stribeck]}}` |

"Held" means that the fit takes the declared value as it is. "Fitted anew" means that the effect is part of the model and the logs give its value. The unit
"effort" is rad, A or V, by the kind of drive. Causes that no single joint owns ({robot_causes}) cannot be declared; `sensors` takes tolerances for sensors.

{effects}

## `sensors`: what your sensors do

For all joints under `sensors`, or for one joint under `sensors: <joint>`:

{noise}

For an F/T sensor of the robot file, under `sensors: ft_<sensor>`. Tolerances are standard deviations of errors that stay the same over all runs; an error within
tolerance is estimated and never reported:

{force_torque}

For an IMU of the robot file, under `sensors: imu_<sensor>`:

{imu}

What the parts stand for (`drake_tc/logs/sensors.py` has the sources):

{parts}
"""
