"""Mechanics: beam elements, condensation, joint springs, the parallelogram loop, statics."""

from typing import TYPE_CHECKING

from robots.lazily import lazily

if TYPE_CHECKING:
    from fem.compiled.compliance import compliance, deflection, directional_stiffness
    from fem.model import FLANGES, LINK_KINDS, ArmModel, LinkKind, build_model
    from fem.reference.shell_arm import ShellArmSolution, solve_shell_arm
    from fem.springs import ConstantSpring, LawSpring, SpringLaw
    from fem.statics.budget import Budget, PartKind, compliance_budget
    from fem.statics.factor import ComplianceFactor, compliance_factor
    from fem.statics.fields import ArmFields, arm_fields, link_shapes
    from fem.statics.flexibility import deflection_by_part, spring_influence
else:
    __getattr__ = lazily(__name__)

__all__ = [
    "FLANGES",
    "LINK_KINDS",
    "ArmFields",
    "ArmModel",
    "Budget",
    "ComplianceFactor",
    "ConstantSpring",
    "LawSpring",
    "LinkKind",
    "PartKind",
    "ShellArmSolution",
    "SpringLaw",
    "arm_fields",
    "build_model",
    "compliance",
    "compliance_budget",
    "compliance_factor",
    "deflection",
    "deflection_by_part",
    "directional_stiffness",
    "link_shapes",
    "solve_shell_arm",
    "spring_influence",
]
