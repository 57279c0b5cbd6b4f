"""The diagrams by name, as `module:attribute`; `drake_tc.registry` reads them when a command asks for one."""

DIAGRAMS = {
    "hrp2_leg": "drake_tc.diagrams.hrp2_leg:HANGING",
    "hrp2_leg_contact": "drake_tc.diagrams.hrp2_leg:IN_CONTACT",
    "humanoid_tsid": "drake_tc.diagrams.humanoid_tsid:ENTRY",
    "sea_joint": "drake_tc.diagrams.sea_joint:ENTRY",
}
